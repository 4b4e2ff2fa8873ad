"""The pairs of links of a robot that may touch each other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import TYPE_CHECKING

from sim_action.robot.robot_model import Joint, RobotModel

if TYPE_CHECKING:
    from sim_action.robot.spec import Robot

LinkPair = tuple[str, str]
"""The names of two links, in the order of the model."""

NO_PAIRS = (
    "no two links of the robot can touch each other: each pair lacks a collision shape, is joined by one joint, or is "
    "disabled by the SRDF or by <exclude> of the model"
)


def touchable_pairs(model: RobotModel) -> Iterator[LinkPair]:
    """Yield the pairs of links that may touch each other.

    Left out are links without collision shapes, links that fixed joints hold together, neighbours (the two rigid bodies
    that a joint connects), and pairs that the SRDF or `<exclude>` of MJCF disables.
    """
    holders = rigid_bodies(model)
    neighbours = _neighbours(model, holders)
    disabled = frozenset[frozenset[str]]() if model.mjcf is None else model.mjcf.excluded
    disabled |= frozenset[frozenset[str]]() if model.srdf is None else model.srdf.disabled
    shaped = [link.name for link in model.links if link.collisions]
    for one, other in combinations(shaped, 2):
        bodies = holders[one], holders[other]
        if bodies[0] != bodies[1] and frozenset(bodies) not in neighbours and frozenset((one, other)) not in disabled:
            yield one, other


def rigid_bodies(model: RobotModel) -> dict[str, str]:
    """Return link -> the first link of its rigid body, whose links fixed joints hold together."""
    above = {joint.child: joint for joint in model.joints if not joint.moves}
    found: dict[str, str] = {}
    for link in model.links:
        way = [link.name]
        while way[-1] not in found and way[-1] in above:
            way.append(above[way[-1]].parent)
        found |= dict.fromkeys(way, found.get(way[-1], way[-1]))
    return found


def _neighbours(model: RobotModel, holders: Mapping[str, str]) -> set[frozenset[str]]:
    """Return the pairs of rigid bodies that one joint connects; a joint with several motions counts as one."""
    above = {joint.child: joint for joint in model.joints if joint.moves}
    found = set[frozenset[str]]()
    for joint in above.values():
        top = joint
        while (upper := above.get(top.parent)) is not None and _names(joint) & _names(upper):
            top = upper
        found.add(frozenset((holders[joint.child], holders[top.parent])))
    return found


def _names(joint: Joint) -> set[str]:
    """Return the names of the joint with several motions that a joint belongs to; empty for other joints."""
    return {joint.series, joint.ball} - {""}


def has_limb(model: RobotModel, wheels: frozenset[str], least: int) -> bool:
    """Return True if `least` joints with motors of their own follow each other, as in an arm or a leg.

    :param wheels: the joints of the drive, which do not count; neither do the last continuous joints of a chain.
    """
    parents = {joint.child: joint for joint in model.joints}
    followed = {joint.parent for joint in model.joints}
    lengths = Counter[str]()
    for link in model.links:
        name, count = link.name, 0
        while name in parents and count < least:
            joint = parents[name]
            is_rotor = joint.type == "continuous" and joint.child not in followed
            count += joint.moves and joint.mimic is None and joint.name not in wheels and not is_rotor
            name = joint.parent
        lengths[link.name] = count
    return max(lengths.values(), default=0) >= least


def undecided(robot: Robot) -> bool:
    """Return True if a scenario leaves open if the links of the robot collide."""
    return "self_collision" not in robot.model_fields_set

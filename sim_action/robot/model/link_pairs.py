"""The pairs of links of a robot that may touch each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import TYPE_CHECKING

from sim_action.robot.model.robot_model import MOVING_TYPES, Joint, RobotModel

if TYPE_CHECKING:
    from sim_action.robot.model.robot_spec import Robot

LinkPair = tuple[str, str]  # the names of two links, in the order of the model

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
    return {joint.series, joint.ball} - {""}


def has_limb(model: RobotModel, *, bolted: bool) -> bool:
    """Return True if the robot has an arm or a leg: motors that follow each other from the base to a link.

    They are at least two on a base that is fixed, and three on another one, which may carry a gripper. The last joint
    of a chain does not count if it turns without limits: it is a wheel or a rotor.
    """
    least = 2 if bolted else 3
    above = {joint.child: joint for joint in model.joints}
    carrying = {joint.parent for joint in model.joints}
    for link in model.links:
        name, count = link.name, 0
        while name in above and count < least:
            joint = above[name]
            is_rotor = joint.type == "continuous" and joint.child not in carrying
            count += joint.type in MOVING_TYPES and joint.mimic is None and not is_rotor
            name = joint.parent
        if count == least:
            return True
    return False


def unwatched_note(model: RobotModel, robot: Robot, *, bolted: bool) -> str | None:
    """Return a note if the links of an arm or leg can pass through each other, and the scenario leaves that open."""
    if "self_collision" in robot.model_fields_set or not has_limb(model, bolted=bolted):
        return None
    pair = next(touchable_pairs(model), None)
    if pair is None:
        return None
    found = f"links of the robot pass through each other, such as '{pair[0]}' and '{pair[1]}'"
    return f"{found}: set robot.self_collision: true, or expect self_collision; robot.self_collision: false accepts it"

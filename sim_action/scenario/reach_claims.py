"""The rules of the audit of claims about places that a link cannot come to, and bounds that it cannot leave.

The distance of a link from the first moving joint between its frame and the link is at most the sum of the distances
between the joints: joints turn about these places, whatever their positions. Only such certain findings are reported.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, Final

from sim_action.core import geometry, units
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.records import dataclass
from sim_action.core.yaml_document import KeyPath
from sim_action.robot.model.kinematics import link_of_frame, link_poses
from sim_action.robot.model.robot_model import WORLD, Joint, RobotModel
from sim_action.scenario.claim_audit import ClaimFinding, beyond
from sim_action.world.scene import Scene

# Limits of sliding joints give way a little; models and sums round.
_SLACK: Final = 1.05
_ROUNDING_M: Final = 1e-6
_JUDGED: Final = frozenset({"reach", "final_pose", "stay_within", "follow_path", "travel"})


@dataclass(frozen=True, slots=True)
class Range:
    """All places that the origin of a link may come to in a frame.

    Attributes:
        joint: name of the joint about which it moves.
        centre_xyz: m, the place of that joint.
        has_height: False if the z of the centre is unknown.
        radius: m, the greatest distance from the centre.
    """

    joint: str
    centre_xyz: Vector3
    has_height: bool
    radius: float

    def distance(self, place: dict[str, float]) -> float:
        """Return the least distance in m from the centre of a place of which some coordinates are given."""
        centre = dict(zip("xyz", self.centre_xyz, strict=True))
        return math.hypot(*(at - centre[axis] for axis, at in place.items() if axis != "z" or self.has_height))

    def farthest(self, place: dict[str, float]) -> float:
        """Return the greatest distance in m of the link from such a place; infinite if it is unknown."""
        return math.inf if "z" in place and not self.has_height else self.distance(place) + self.radius + _ROUNDING_M

    def is_within(self, bounds: dict[str, tuple[float, float]]) -> bool:
        """Return True if the link stays between the bounds of the axes, in m."""
        centre = dict(zip("xyz", self.centre_xyz, strict=True))
        return ("z" not in bounds or self.has_height) and all(
            lower <= centre[axis] - self.radius and centre[axis] + self.radius <= upper
            for axis, (lower, upper) in bounds.items()
        )


def audit_reach(leaves: Sequence[tuple[KeyPath, Any]], scene: Scene) -> Iterator[ClaimFinding]:
    """Yield places that a link cannot come to, and bounds that it cannot leave."""
    for path, assertion in leaves:
        if assertion.key not in _JUDGED or assertion.watches_base:
            continue
        found = range_of(scene, assertion.link or scene.model.root, assertion.frame)
        if found is None:
            continue
        who = assertion.link or "the base"
        if assertion.key == "stay_within":
            if found.is_within(assertion.intervals):
                most = f"{units.display(found.radius, 'm')} from joint '{found.joint}'"
                message = f"{who} cannot leave these bounds: it is never more than {most}; give narrower bounds"
                yield ClaimFinding("unreachable-limit", path, message)
            continue
        yield from _beyond_any_place(path, assertion, who, found)
        if assertion.key in {"reach", "final_pose"} and not getattr(assertion, "relative", False):
            place = {axis: at for axis in "xyz" if (at := getattr(assertion, axis)) is not None}
            yield from _beyond_reach(path, place, assertion.tolerance, (who, assertion.frame), found)
        elif assertion.key == "follow_path":
            yield from _path_beyond_reach(path, assertion, who, found)


def _beyond_any_place(path: KeyPath, assertion: Any, who: str, found: Range) -> Iterator[ClaimFinding]:
    """Yield distances that are greater than those of all places that the link may come to."""
    most, what = math.inf, "this place"
    match assertion.key:
        case "travel":
            most, what, fields = 2 * found.radius + _ROUNDING_M, "its start", ["at_most"]
        case "final_pose" if assertion.place and assertion.relative:
            most, fields = 2 * found.radius + _ROUNDING_M + math.hypot(*assertion.place.values()), ["tolerance"]
        case "final_pose" if assertion.place:
            most, fields = found.farthest(assertion.place), ["tolerance"]
        case "follow_path" if assertion.path and not assertion.smooth:
            points = (dict(zip("xyz", point.place, strict=False)) for point in assertion.path)
            most, what, fields = max(map(found.farthest, points)), "this path", ["max_error", "rms"]
        case _:
            return
    for field in fields:
        limit = getattr(assertion, field)
        if limit is not None and limit >= most:
            why = f"{who} is never more than {units.display(most, 'm')} from {what}"
            yield beyond((*path, field), limit, "m", why)


def _path_beyond_reach(path: KeyPath, assertion: Any, who: str, found: Range) -> Iterator[ClaimFinding]:
    """Yield the first point of a path that the link cannot come near enough to."""
    points = assertion.path or ()
    for index, point in enumerate(points):
        limits = [assertion.max_error]
        if assertion.end is not None and index == len(points) - 1:
            limits.append(assertion.end.tolerance)
        given = [limit for limit in limits if limit is not None]
        place = dict(zip("xyz", point.place, strict=False))
        far = (
            list(_beyond_reach((*path, "path", index), place, min(given), (who, assertion.frame), found))
            if given
            else []
        )
        yield from far
        if far:
            return


def _beyond_reach(
    path: KeyPath, place: dict[str, float], tolerance: float, seen: tuple[str, str], found: Range
) -> Iterator[ClaimFinding]:
    """Yield a place beyond the range of a link; `seen`: the link and the frame."""
    who, frame = seen
    away = found.distance(place) if place else 0.0
    most = found.radius + _ROUNDING_M
    if away > most + tolerance:
        far, longest = units.display_apart(away, most, "m")
        message = f"this place is {far} from joint '{found.joint}', but {who} reaches at most {longest} from there"
        yield ClaimFinding(
            "unreachable-target", path, f"{message}; move it, or the robot; check 'frame', which is {frame}"
        )


def range_of(scene: Scene, link: str, frame: str) -> Range | None:
    """Return the places that a link may come to in a frame; None if they are unlimited, or not known before a run."""
    model, base, has_height = scene.model, Pose(), True
    if frame == WORLD:
        if not scene.bolted:
            return None
        placement = scene.placement
        base = Pose((placement.x, placement.y, placement.z or 0.0), placement.orientation_xyzw)
        has_height = placement.z is not None
    start = model.root if frame == WORLD else link_of_frame(model, frame)
    if start not in model.links_by_name or link not in model.links_by_name:
        return None
    chain = [joint for joint in _between(model, start, link) if joint.moves]
    if not chain:
        return None
    poses = link_poses(model, {})
    places = [geometry.compose(poses[joint.child], Pose(joint.anchor_xyz)).position_xyz for joint in chain]
    slides = sum(_slide(joint) for joint in chain)
    radius = sum(math.dist(*pair) for pair in pairwise([*places, poses[link].position_xyz])) + slides
    seen = base if frame == WORLD else geometry.inverse(poses[start])
    centre = geometry.compose(seen, Pose(places[0])).position_xyz
    return Range(chain[0].name, centre, has_height, radius) if math.isfinite(radius) else None


def _between(model: RobotModel, start: str, link: str) -> list[Joint]:
    """Return the joints on the way from one link to another."""
    up, down = _to_root(model, start), _to_root(model, link)
    while up and down and up[-1] is down[-1]:
        up.pop()
        down.pop()
    return [*up, *reversed(down)]


def _to_root(model: RobotModel, link: str) -> list[Joint]:
    joints = list[Joint]()
    while link != model.root:
        joints += reversed(model.joints_to[link])
        link = joints[-1].parent
    return joints


def _slide(joint: Joint) -> float:
    """Return the greatest displacement of a joint in m; 0 if it turns, infinite without limits."""
    if joint.type != "prismatic":
        return 0.0
    if joint.lower is None or joint.upper is None or joint.lower > joint.upper:
        return math.inf
    return _SLACK * max(abs(joint.lower), abs(joint.upper))

"""The reach of a robot, for the audit of claims: places of a link, readings of a joint, bodies and patches.

The distance of a link from the first moving joint between its frame and the link is at most the sum of the distances
between the joints: joints turn about these places in all positions. Only such certain findings are reported.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise, product
from typing import Final

from sim_action.core import geometry, units
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass
from sim_action.core.wording import quoted
from sim_action.core.yaml_document import KeyPath
from sim_action.robot.model.kinematics import link_of_frame, link_poses, shape_box
from sim_action.robot.model.robot_model import WORLD, Joint, Reading, RobotModel
from sim_action.state.timeline import TimeMark
from sim_action.state.trace import Trace
from sim_action.world.body import Body, placed
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun, beyond
from sim_action.world.parts import lowest, reach
from sim_action.world.physics import Patch
from sim_action.world.scene import Scene

_SLACK: Final = 1.05  # limits of sliding joints give way a little; models and sums round

# How far a stop of a joint gives way: a share of its range, and in addition an angle or a length.
_STOP_SHARE: Final = 0.01
_STOP_RAD: Final = math.radians(2)
_STOP_M: Final = 2e-3

# A limit beyond this multiple of a motor's speed is never reached, unless something else drives the joint.
_FAR: Final = 1.5

ROUNDING_M: Final = 1e-6  # in m: the rounding of sums of distances


@dataclass(frozen=True, slots=True)
class LinkRange:
    """All places that the origin of a link may come to in a frame."""

    who: str  # the link in a sentence
    frame: str
    joint: str  # name of the joint about which it moves; empty for a free base, which moves about its start
    centre_xyz: Vector3  # m, the place of that joint, or the start
    has_height: bool  # False if the z of the centre is unknown
    radius: float  # m, the greatest distance from the centre

    @property
    def middle(self) -> str:
        """The centre in a sentence."""
        return f"joint '{self.joint}'" if self.joint else "its start"

    def distance(self, place: Mapping[str, float]) -> float:
        """Return the least distance in m from the centre of a place of which some coordinates are given."""
        centre = dict(zip("xyz", self.centre_xyz, strict=True))
        return math.hypot(*(at - centre[axis] for axis, at in place.items() if axis != "z" or self.has_height))

    def farthest(self, place: Mapping[str, float]) -> float:
        """Return the greatest distance in m of the link from such a place; infinite if it is unknown."""
        return math.inf if "z" in place and not self.has_height else self.distance(place) + self.radius + ROUNDING_M

    def is_within(self, bounds: Mapping[str, tuple[float, float]]) -> bool:
        """Return True if the link stays between the bounds of the axes, in m."""
        centre = dict(zip("xyz", self.centre_xyz, strict=True))
        return ("z" not in bounds or self.has_height) and all(
            lower <= centre[axis] - self.radius and centre[axis] + self.radius <= upper
            for axis, (lower, upper) in bounds.items()
        )

    def too_wide(self, most: float, what: str, limits: Mapping[str, float | None]) -> Findings:
        """Yield limits of the distance from `what`, which is at most `most`, in m by their key."""
        for key, limit in limits.items():
            if limit is not None and limit >= most:
                why = f"{self.who} is never more than {units.display(most, 'm')} from {what}"
                yield beyond((key,), limit, "m", why)

    def never_moves(self, limits: Mapping[str, float | None]) -> Findings:
        """Yield limits, by their key, of the motion of a link whose origin is on the axis of its only joint."""
        for key, limit in limits.items():
            if limit is not None:
                message = (
                    f"the origin of {self.who} is on the axis of '{self.joint}', so it never moves in {self.frame}"
                )
                yield ClaimFinding("unreachable-limit", (key,), f"{message}; limit 'angular', or name another link")

    def out_of_reach(self, path: KeyPath, place: Mapping[str, float], tolerance: float) -> Findings:
        """Yield a place, stated at `path`, that the link cannot come near enough to."""
        away, most = self.distance(place), self.radius + ROUNDING_M
        if place and away > most + tolerance:
            far, longest = units.display_apart(away, most, "m")
            reach = f"but {self.who} reaches at most {longest} from there"
            use = f"move it, or the robot; check 'frame', which is {self.frame}"
            message = f"this place is {far} from {self.middle}, {reach}; {use}"
            yield ClaimFinding("unreachable-target", path, message)


def range_of(scene: Scene, link: str | None, frame: str) -> LinkRange | None:
    """Return the places that a link, or the base, may come to in a stable run; None if unlimited or unknown."""
    who, link = link or "the base", link or scene.model.root
    model, base, has_height = scene.model, Pose(), True
    if frame == WORLD:
        placement = scene.placement
        if not scene.bolted:
            start_xyz, far = (placement.x, placement.y, placement.z or 0.0), scene.physics.max_distance
            return LinkRange(who, frame, "", start_xyz, True, far) if link == model.root else None
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
    if not math.isfinite(radius):
        return None
    return LinkRange(who, frame, chain[0].name, centre, has_height, radius)


def joints_between(scene: Scene, link: str | None, frame: str) -> tuple[str, ...]:
    """Return the names of the joints that move a link, or the base link, in a frame."""
    model = scene.model
    start = model.root if frame == WORLD else link_of_frame(model, frame)
    return tuple(joint.name for joint in _between(model, start, link or model.root) if joint.moves)


def least_distance(scene: Scene, link: str, other: str) -> float:
    """Return a lower bound of the distance in m of two links' shapes, for all joint positions; 0 if none is known.

    The axes of two joints that follow each other keep their distance, and a shape turns about the axis of its own.
    """
    chain = [joint for joint in _between(scene.model, link, other) if joint.moves]
    if not chain or any(joint.type not in ("revolute", "continuous") for joint in chain):
        return 0.0
    poses = link_poses(scene.model, {})
    places = [geometry.compose(poses[joint.child], Pose(joint.anchor_xyz)).position_xyz for joint in chain]
    between = [math.dist(*pair) for pair in pairwise(places)]
    apart = 2 * max(between, default=0.0) - sum(between)
    for name, place in ((link, places[0]), (other, places[-1])):
        shapes = scene.model.links_by_name[name].collisions
        boxes = (shape_box(geometry.compose(poses[name], shape.pose), shape) for shape in shapes)
        corners = (corner for box in boxes for corner in product(*zip(*box, strict=True)))
        apart -= max((math.dist(place, corner) for corner in corners), default=0.0)
    return max(0.0, apart)


def joint_range(scene: Scene, name: str, reading: str) -> tuple[float, float]:
    """Return the least and greatest reading that a joint can have in a run; a stop gives way a little."""
    joint, most = scene.model.joints_by_name.get(name), math.inf
    if joint is None:
        return -math.inf, math.inf
    slides = joint.type == "prismatic"
    if reading == "position":
        if joint.type == "continuous" or joint.lower is None or joint.upper is None or joint.lower > joint.upper:
            return -math.inf, math.inf
        gives = _STOP_SHARE * (joint.upper - joint.lower) + (_STOP_M if slides else _STOP_RAD)
        return joint.lower - gives, joint.upper + gives
    if reading == "velocity":
        most = scene.physics.max_speed if slides else scene.physics.max_turn_rate
    elif joint.max_effort and joint.mimic is None and name not in scene.stuck:
        # Without a limit in the model, or with a limit of 0, the effort is not limited.
        most = joint.max_effort
    return -most, most


def beyond_motor(scene: Scene, name: str, reading: str, limit: float) -> str | None:
    """Return why a limit of the velocity of a joint checks little: its motor never gets near; else None."""
    joint = scene.model.joints_by_name.get(name)
    if joint is None or reading != "velocity" or not joint.max_velocity or limit <= _FAR * joint.max_velocity:
        return None
    unit = joint.dimension("velocity").si
    most, stated = units.display(joint.max_velocity, unit), units.display(limit, unit)
    return f"the motor of {name} moves it with at most {most}, and the limit is {stated}; give a smaller limit"


def joint_range_in(run: JudgedRun, name: str, reading: str) -> tuple[float, float]:
    """Return the least and the greatest reading that a joint has in the time limit, moved by nothing but its motor."""
    joint = run.scene.model.joints_by_name.get(name)
    low, high = joint_range(run.scene, name, reading)
    if joint is None or reading != "position" or not joint.max_velocity or run.is_pushed((name,)):
        return low, high
    column = run.trace.joint_names.index(name)
    fastest = max(joint.max_velocity, float(abs(run.trace.joint_velocity[:, column]).max(initial=0.0)))
    start, way = float(run.trace.joint_position[0, column]), _FAR * fastest * run.time_limit
    return max(low, start - way), min(high, start + way)


def beyond_time(run: JudgedRun, names: Iterable[str], reading: Reading, allowed: tuple[float, float]) -> Findings:
    """Yield the finding that joints do not leave a range of readings in the time limit."""
    ranges = {name: joint_range_in(run, name, reading) for name in names}
    if ranges and all(allowed[0] <= low and high <= allowed[1] for low, high in ranges.values()):
        most = max(max(abs(low), abs(high)) for low, high in ranges.values())
        shown = units.display(most, run.scene.model.joints_by_name[next(iter(ranges))].dimension(reading).si)
        message = f"in the time limit, no motor turns {' or '.join(ranges)} beyond {shown}, even at its highest speed"
        yield ClaimFinding("limit-beyond-range", (), f"{message}; give a smaller limit, or more time")


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


_PASSED_M: Final = 0.5  # m: a robot that came so near to an object has passed it
_DRIVEN_M: Final = 0.1  # m: a robot that came nearer by less has not passed anything
# m: the stored trace has gaps.
_SLACK_M: Final = 0.05
_UPSIDE_DOWN_XYZW: Final = (1.0, 0.0, 0.0, 0.0)


def passed_by(scene: Scene, trace: Trace, body: Body) -> bool:
    """Return True if the robot came near to the initial place of a body, on the ground."""
    parts = scene.parts_of(body)
    x, y, _ = placed(body, parts).position_xyz
    near = scene.extent + max(map(reach, parts)) + _PASSED_M
    away = trace.planar_distance_to(x, y)
    return bool(away.min() <= near and away.max() - away.min() > _DRIVEN_M)


def out_of_reach(run: JudgedRun, bodies: Sequence[Body], distance: float = 0.0) -> Findings:
    """Yield the finding that no robot comes within a distance in m of some bodies: they are too low, or too high."""
    if run.verdict.passed and bodies and all(_is_out_of_reach(run, body, distance) for body in bodies):
        names = quoted([body.name for body in bodies])
        message = f"{names} is below the ground, or above the robot, so the robot cannot come near"
        yield ClaimFinding("nothing-to-touch", (), f"{message}; check 'z' of its pose")


def _is_out_of_reach(run: JudgedRun, body: Body, distance: float) -> bool:
    if body.mass is not None or body.path or not len(run.trace):
        return False
    # The z of the lowest and of the highest point of a body in m, where it starts.
    parts = run.scene.parts_of(body)
    _, _, z = (pose := placed(body, parts)).position_xyz
    upside_down = geometry.multiply(_UPSIDE_DOWN_XYZW, pose.orientation_xyzw)
    bottom, top = z + lowest(parts, pose.orientation_xyzw), z - lowest(parts, upside_down)
    heights, extent = run.trace.base_position_xyz[:, 2], _stretched(run.scene)
    low, high = float(heights.min()), float(heights.max())
    # A robot that falls below the ground may touch bodies there, one that flies may touch bodies above it.
    if top + distance < min(0.0, low + _SLACK_M):
        return True
    return bottom > high + extent + distance and low <= extent and high - low <= _DRIVEN_M


def is_untouched(scene: Scene, trace: Trace, patch: Patch) -> bool:
    """Return True if neither the robot nor an object that stays in its place was above a patch after it appeared."""
    for body in scene.world.objects:
        parts = scene.parts_of(body)
        place = np.array([placed(body, parts).position_xyz])
        if body.mass is not None and not _is_off(patch, place, max(map(reach, parts))):
            return False
    return _is_off(patch, trace.base_position_xyz[trace.time >= (patch.appears or 0.0)], _stretched(scene))


def reached_patches(scene: Scene, trace: Trace) -> Iterator[TimeMark]:
    """Yield the marks of the timeline at which the robot first came to a patch, within its extent."""
    for patch in scene.world.patches:
        near = ~_are_off(patch, trace.base_position_xyz, scene.extent) & (trace.time >= (patch.appears or 0.0))
        if near.any():
            time = float(trace.time[near.argmax()])
            yield TimeMark(time, time, f"reached {patch.words}")


def _is_off(patch: Patch, places: FloatArray, extent: float) -> bool:
    """Return True if a circle with a radius of `extent` in m about each of the places is off a patch."""
    return bool(_are_off(patch, places, extent).all())


def _are_off(patch: Patch, places: FloatArray, extent: float) -> NDArray[np.bool_]:
    """Return True for each place whose circle with a radius of `extent` in m is off a patch."""
    low, high = np.transpose(patch.bounds)
    off: NDArray[np.bool_] = ((places[:, :2] < low - extent) | (places[:, :2] > high + extent)).any(axis=1)
    return off


def _stretched(scene: Scene) -> float:
    """Return the extent of the robot in m with all links of its arms in a line."""
    joints = (joint for joint in scene.model.moving_joints if joint.type != "continuous")
    return scene.extent + sum(math.hypot(*joint.origin.position_xyz) for joint in joints) + _SLACK_M

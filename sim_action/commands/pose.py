"""Move a link along straight lines: `pose: {link: tool0, waypoints: [{x: 0.4, y: 0.1, z: 0.3}]}`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Annotated, ClassVar, Final, Literal, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.commands import ClosedLoop, Controller, LinkCommands, OpenLoop
from sim_action.commands.joints import BLENDS
from sim_action.commands.link_path import Blocked, Follower, Leg, LinkPath, after, distances, unreachable
from sim_action.core import geometry, units
from sim_action.core.errors import ScriptError, SourceProblem
from sim_action.core.field_types import (
    Coordinate,
    FrozenModel,
    NonNegativeSeconds,
    PositiveMetresPerSecond,
    PositiveRadiansPerSecond,
    PositiveSeconds,
    Radians,
)
from sim_action.core.geometry import Pose
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.inverse_kinematics import Chain, Values
from sim_action.robot.model.kinematics import link_poses, robot_box, why_no_link
from sim_action.state.command import JointTargets
from sim_action.state.joint_motion import RAMP_S, JointMotion
from sim_action.state.observation import Observation
from sim_action.state.timeline import TimeMark, waypoint_mark
from sim_action.world.claims import Findings, Setting, late_points
from sim_action.world.scene import Scene

_ANGLES: Final = ("roll", "pitch", "yaw")
_LONGEST_S: Final = 86_400.0  # the largest time_limit
_STILL_S: Final = 1e-6  # a way that takes less time than this is rounding

# Before the run, the process of all scenarios checks a path, and must not be kept busy. The run checks the rest.
MAX_CHECKED_WAYPOINTS: Final = 500
MAX_CHECKED_SAMPLES: Final = 10_000
_MAX_UNREACHABLE: Final = 10


class LinkWaypoint(FrozenModel):
    """A pose of the link; missing coordinates and angles keep their last value."""

    x: Coordinate | None = None
    y: Coordinate | None = None
    z: Coordinate | None = None
    roll: Radians | None = None
    pitch: Radians | None = None
    yaw: Radians | None = None
    speed: Annotated[
        PositiveMetresPerSecond | None, Field(description="largest speed on the way to it; default: that of the path")
    ] = None
    at: Annotated[PositiveSeconds | None, Field(description="sim time of arrival, instead of a speed")] = None
    hold: Annotated[NonNegativeSeconds, Field(le=_LONGEST_S, description="time at rest there")] = 0.0

    @model_validator(mode="after")
    def _has_one_time(self) -> Self:
        if self.speed is not None and self.at is not None:
            raise ValueError("'speed' and 'at' cannot be combined; remove one of them")
        return self

    @property
    def has_angles(self) -> bool:
        """True if it states a roll, pitch or yaw."""
        return any(getattr(self, name) is not None for name in _ANGLES)

    @property
    def is_empty(self) -> bool:
        """True if it neither moves the link nor waits."""
        stated = (self.x, self.y, self.z, self.at)
        return not (self.has_angles or self.hold) and all(value is None for value in stated)

    def after(self, before: Pose) -> Pose:
        """Return the pose at this waypoint, given the previous one."""
        stated = (self.x, self.y, self.z)
        x, y, z = (old if new is None else new for old, new in zip(before.position_xyz, stated, strict=True))
        if not self.has_angles:
            return Pose((x, y, z), before.orientation_xyzw)
        angles = geometry.rpy_from_quaternion(before.orientation_xyzw)
        turned = (self.roll, self.pitch, self.yaw)
        roll, pitch, yaw = (old if new is None else new for old, new in zip(angles, turned, strict=True))
        return Pose((x, y, z), geometry.quaternion_from_rpy(roll, pitch, yaw))


class LinkMotionSpec(FrozenModel):
    """The path of a link."""

    link: Annotated[str, Field(min_length=1, description="link that follows the path")]
    waypoints: Annotated[
        tuple[LinkWaypoint, ...], Field(min_length=1, description="poses of the link's frame, in the order of time")
    ]
    frame: Annotated[
        Literal["world", "base"], Field(description="frame of the waypoints: the world, or the base link")
    ] = "world"
    orientation: Annotated[
        Literal["follow", "free"],
        Field(description="`free`: only the position counts, for arms with fewer than six joints"),
    ] = "follow"
    speed: Annotated[PositiveMetresPerSecond, Field(description="largest speed of the link")] = 0.25
    turn_speed: Annotated[PositiveRadiansPerSecond, Field(description="largest angular speed of the link")] = (
        math.radians(90)
    )
    interpolation: Annotated[
        Literal["minimum_jerk", "linear"],
        Field(description="`minimum_jerk` rests at each waypoint; `linear` has constant speed"),
    ] = "minimum_jerk"


class PoseCommands(LinkCommands):
    """Moves a link along straight lines in space, such as the tool of an arm.

    The path starts where the link is at t = 0. Values that a waypoint leaves out keep their last value. The orientation
    follows the shortest rotation (slerp). All joints between the base and the link move, except those without a motor
    and followers. A redundant arm moves its joints as little as possible.

    `minimum_jerk` rests at each waypoint. `linear` passes the waypoints without a stop, and turns within 20 ms: at 0.25
    m/s it cuts a right-angled corner by 1 mm. `speed` and `turn_speed` are upper limits. After the last waypoint, the
    link stays there.

    In the frame `base`, and if the base is fixed, the joint positions are computed before the run. A waypoint out of
    reach, a line on which the arm would have to change its posture, and a speed that a joint cannot follow are errors
    then; beyond 500 waypoints or 20 m, they are noticed when the run starts. In the frame `world`, a robot with a free
    base corrects the joints at each tick; a pose more than 2 mm or 1 deg out of reach ends the run with an error.
    """

    key: ClassVar[str] = "pose"
    is_written: ClassVar[bool] = True

    pose: Annotated[LinkMotionSpec, Field(description="link, and its path")]

    def problems(self, workspace: Workspace) -> SpecProblems:
        """Yield times that are not in order, and waypoints and angles that have no effect."""
        last = 0.0
        for index, waypoint in enumerate(self.pose.waypoints):
            if waypoint.is_empty:
                message = (
                    "does not move the link, and does not wait: state a coordinate or an angle; to wait, 'hold: 1 s'"
                )
                yield ("pose", "waypoints", index), message
            if waypoint.at is not None:
                if waypoint.at <= last:
                    yield ("pose", "waypoints", index, "at"), f"must be later than {last:g} s, the time before it"
                last = waypoint.at
            last += waypoint.hold
            if self.pose.orientation == "free" and waypoint.has_angles:
                yield ("pose", "waypoints", index), "'orientation: free' ignores roll, pitch and yaw; remove them"

    @override
    def model_problems(self, scene: Scene) -> SpecProblems:
        if (trouble := _why_not_moved(self.pose.link, scene)) is not None:
            yield ("pose", "link"), trouble
            return
        try:
            follower, start = self._follower(scene)
        except units.UnitError:
            return  # reported for robot.joints
        base = self._expected_base(scene)
        if base is not None and not any(self.problems(scene.workspace)):
            yield from self._path_problems(follower, start, base)

    @override
    def joints(self, scene: Scene) -> frozenset[str]:
        if _why_not_moved(self.pose.link, scene) is not None:
            return frozenset()
        return frozenset(joint.name for joint in _chain(self.pose.link, scene).joints)

    @override
    def open(self, scene: Scene) -> Controller:

        follower, start = self._follower(scene)
        motion = _Motion(self, follower, start)
        if self.pose.frame == "world" and not scene.bolted:
            return ClosedLoop(
                motion.tracked, senses=False, begin=motion.begin, notes=motion.notes, marks=motion.marks, is_timed=True
            )
        if self.pose.frame == "world" and scene.placement.z is None:
            return ClosedLoop(motion.from_base, senses=False, marks=motion.marks, is_timed=True)
        base = self._expected_base(scene)
        assert base is not None
        try:
            targets, end = motion.plan(base)
        except Blocked as error:
            raise SourceProblem(str(error), "pose") from None
        names = [joint.name for joint in follower.chain.joints]
        holding = JointTargets(position=dict(zip(names, start, strict=True)))
        return OpenLoop(lambda time: targets if time <= end else None, holding, marks=motion.marks)

    @property
    @override
    def needed_rate(self) -> None:
        return None

    @override
    def tick_rate(self, physics_rate: float) -> float:
        """See CommandSource.tick_rate: a planned motion goes on between ticks, so few ticks are enough for it."""
        is_planned = self.pose.frame == "base" and self.is_perfect
        return physics_rate / max(1, round(physics_rate)) if is_planned else self.rate

    def path(self, start: Pose) -> LinkPath:
        """Return the path of the link from a start pose in the frame of the waypoints. Raises Blocked."""
        ways = (way for way in self._ways(start) if way.end > way.start)
        moving = tuple(way for way in ways if any(distances(way.origin, way.goal)))
        return LinkPath(moving, start, BLENDS[self.pose.interpolation])

    @override
    def robot_claims(self, scene: Scene, setting: Setting) -> Findings:
        yield from late_points(("pose", "waypoints"), self.arrivals(scene), setting)

    def arrivals(self, scene: Scene) -> tuple[float, ...]:
        """Return the sim time in s of arrival at each waypoint, from the start on, until one is not reached."""
        times = list[float]()
        if _why_not_moved(self.pose.link, scene) is not None:
            return ()
        try:
            base = Pose() if self.pose.frame == "base" else _fixed_base(scene)
            follower, start = self._follower(scene)
            times.extend(way.end for way in self._ways(geometry.compose(base or Pose(), follower.chain.pose(start))))
        except (Blocked, units.UnitError):
            pass  # reported by model_problems, or by robot.joints
        return tuple(times)

    def _ways(self, start: Pose) -> Iterator[Leg]:
        """Yield the way to each waypoint; some need no time. Raises Blocked."""
        spec = self.pose
        is_straight = spec.interpolation == "linear"
        peak = BLENDS[spec.interpolation].peak or 1.0
        pose, time, rests = start, 0.0, True
        for index, waypoint in enumerate(spec.waypoints):
            goal = waypoint.after(pose)
            distance, angle = distances(pose, goal)
            turning = angle / spec.turn_speed if spec.orientation == "follow" else 0.0
            needed = peak * max(distance / (waypoint.speed or spec.speed), turning)
            rested, rests = rests, not is_straight or waypoint.hold > 0 or index == len(spec.waypoints) - 1
            # A ramp from rest to the speed goes half as far as the speed would.
            needed = 0.0 if needed < _STILL_S else needed + is_straight * (rested + rests) * RAMP_S / 2
            arrival = time + needed if waypoint.at is None else waypoint.at
            if not arrival <= _LONGEST_S:
                message = f"the link would arrive at {arrival:.4g} s; a run lasts at most {_LONGEST_S:,.0f} s"
                raise Blocked(index, f"{message}: raise the speed, or lower 'at' or 'hold'")
            end = arrival
            if end < time or (end == time and needed):
                message = f"'at' must be later than {time:.6g} s, when the link leaves the waypoint before it"
                raise Blocked(index, message)
            yield Leg(index, time, end, pose, goal, (rested, rests))
            pose, time = goal, end + waypoint.hold

    def _path_problems(self, follower: Follower, start: Values, base: Pose) -> SpecProblems:
        """Yield waypoints out of reach; if there are none, the first line that the joints cannot follow."""
        origin = geometry.compose(base, follower.chain.pose(start))
        any_unreachable = False
        goals = islice(self._goals(origin), MAX_CHECKED_WAYPOINTS)
        for index, message in islice(unreachable(follower, goals, base, start), _MAX_UNREACHABLE):
            any_unreachable = True
            yield ("pose", "waypoints", index), message + self._orientation_hint(follower.chain)
        if any_unreachable:
            return
        try:
            path = self.path(origin).beginning(follower, MAX_CHECKED_WAYPOINTS, MAX_CHECKED_SAMPLES)
            follower.plan(path, base, start)
        except Blocked as error:
            yield ("pose", "waypoints", error.waypoint), str(error)

    def _orientation_hint(self, chain: Chain) -> str:
        few = len(chain.joints) < _FULL_POSE
        if self.pose.orientation == "free" or not few:
            return ""
        joints = f"{len(chain.joints)} joint" + ("s move" if len(chain.joints) > 1 else " moves")
        return f"; only {joints} it, so add 'orientation: free' if only its position counts"

    def _goals(self, pose: Pose) -> Iterator[Pose]:
        for waypoint in self.pose.waypoints:
            pose = waypoint.after(pose)
            yield pose

    def _follower(self, scene: Scene) -> tuple[Follower, Values]:
        """Return what finds joint positions, and those at the start. Raises units.UnitError."""
        chain, positions = _chain(self.pose.link, scene), scene.joint_positions
        start = tuple(positions[joint.name] for joint in chain.joints)
        return Follower(chain, self.pose.orientation == "follow", self.rate), start

    def _expected_base(self, scene: Scene) -> Pose | None:
        if self.pose.frame == "base":
            return Pose()
        return _fixed_base(scene) if scene.bolted else None


_FULL_POSE: Final = 6  # an arm needs at least so many joints to reach every pose around it


class _Motion:
    """The motion of the link in a run, with notes for the user; `marks`: arrivals, once planned."""

    def __init__(self, spec: PoseCommands, follower: Follower, start: Values) -> None:
        self.notes: list[str] = []
        self.marks: list[TimeMark] = []
        self._spec = spec
        self._follower = follower
        self._names = [joint.name for joint in follower.chain.joints]
        self._planned: tuple[JointTargets, float] | None = None
        self._path: LinkPath | None = None
        self._positions, self._before = start, start
        self._speeds: Sequence[float] = [0.0] * len(start)

    def plan(self, base: Pose) -> tuple[JointTargets, float]:
        """Return the motion for a pose of the base in the frame of the waypoints, and its end in s. Raises Blocked."""
        path = self._path_from(base)
        motion = self._follower.plan(path, base, self._positions).motion(self._names)
        return JointTargets(motions=(motion,)), path.end + 1 / self._spec.rate

    def _path_from(self, base: Pose) -> LinkPath:
        link, total = self._follower.chain.link, len(self._spec.pose.waypoints)
        path = self._spec.path(geometry.compose(base, self._follower.chain.pose(self._positions)))
        self.marks += (waypoint_mark(leg.end, leg.waypoint + 1, total, link) for leg in path.legs)
        return path

    def from_base(self, observation: Observation) -> JointTargets | None:
        """Return the targets of a tick; the first observation shows the height of a fixed base."""
        if self._planned is None:
            try:
                self._planned = self.plan(observation.pose)
            except Blocked as error:
                raise ScriptError(f"link '{self._follower.chain.link}': {error}") from None
        targets, end = self._planned
        return targets if observation.time <= end else None

    def begin(self) -> None:
        """Let `tracked` lead along the whole path from where the link is by then."""
        self._path = None
        self.marks.clear()

    def tracked(self, observation: Observation) -> JointTargets:
        """Return the motion until the next tick, for a base that moves."""
        base, chain, rate = observation.pose, self._follower.chain, self._spec.rate
        tick = round(observation.time * rate)
        try:
            if self._path is None:
                self._path = self._path_from(base)
            # The base moves on until the next tick.
            moved = after(base, observation.twist, 1 / rate)
            following = self._follower.follow(self._path, tick + 1, moved, self._positions)
        except Blocked as error:
            raise ScriptError(f"link '{chain.link}': {error}") from None
        current, before, times = self._positions, self._before, (tick / rate, (tick + 1) / rate)
        # The velocity at the next tick, from the positions at three ticks.
        speeds = [(3 * c - 4 * b + a) / 2 * rate for a, b, c in zip(before, current, following, strict=True)]
        motion = JointMotion.through(self._names, times, (current, following), (self._speeds, speeds))
        self._before, self._positions, self._speeds = current, following, speeds
        return JointTargets(motions=(motion,))


def _chain(link: str, scene: Scene) -> Chain:

    return Chain.of(scene.model, link, scene.joint_positions)


def _why_not_moved(link: str, scene: Scene) -> str | None:
    """Return a message if no joint with a motor moves a link relative to the base; None if one does."""
    if (unknown := why_no_link(scene.model, link)) is not None:
        return unknown
    try:
        chain = _chain(link, scene)
    except units.UnitError:
        return None
    if not chain.joints:
        return f"no joint with a motor is between the base link '{scene.model.root}' and link '{link}'"
    return None


def _fixed_base(scene: Scene) -> Pose | None:
    """Return the pose of a fixed base in the world; without a z it stands on the ground. None without known shapes."""
    at = scene.placement
    if at.z is not None:
        return Pose((at.x, at.y, at.z), at.orientation_xyzw)
    turned = Pose(orientation_xyzw=at.orientation_xyzw)
    poses = link_poses(scene.model, scene.joint_positions)
    box = robot_box(scene.model, {name: geometry.compose(turned, pose) for name, pose in poses.items()})
    return None if box is None else Pose((at.x, at.y, -box[0][2]), at.orientation_xyzw)

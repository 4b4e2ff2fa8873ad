"""`reach: {x: 2 m, y: 0}` and `final_pose: {x: 2 m, yaw: 90 deg}`: the place of a frame, once and at the end."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Reference
from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.bounds import ClosestApproach
from sim_action.assertions.monitors.watched import MotionAssertion, Watched
from sim_action.core import geometry, units
from sim_action.core.field_types import FrozenModel, Metres, PositiveMetres, PositiveRadians, Radians
from sim_action.core.geometry import Pose, Quaternion, Vector3
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, delegated, replace
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Mark, Signal, Verdict, goal, line
from sim_action.world.claims import HEADINGS, ORIENTATIONS, Ceiling, Findings, JudgedRun
from sim_action.world.robot_reach import ROUNDING_M, LinkRange
from sim_action.world.scene import Scene


class TargetOrientation(FrozenModel):
    """A full orientation: rotations about the fixed x, y and z axes of the frame, in this order."""

    roll: Radians = 0.0
    pitch: Radians = 0.0
    yaw: Radians = 0.0
    tolerance: Annotated[
        PositiveRadians, Field(description="maximum angle of the one rotation that would correct it")
    ] = math.radians(5)

    @property
    def orientation_xyzw(self) -> Quaternion:
        """The orientation as a quaternion."""
        return geometry.quaternion_from_rpy(self.roll, self.pitch, self.yaw)

    @property
    def text(self) -> str:
        """The orientation as text, such as "roll 180 deg, pitch 0 deg, yaw 90 deg"."""
        return rpy_text((self.roll, self.pitch, self.yaw))


def rpy_text(angles: Vector3) -> str:
    """Return roll, pitch and yaw, given in rad, as text."""
    names = ("roll", "pitch", "yaw")
    return ", ".join(f"{name} {units.display(angle, 'rad')}" for name, angle in zip(names, angles, strict=True))


@dataclass(frozen=True, slots=True)
class TargetAngle:
    """The heading or the orientation that a frame must have."""

    name: str  # "heading" or "orientation"
    tolerance: float  # maximum error in rad
    target: float | Quaternion  # the yaw in rad, or the orientation

    def error(self, trace: Trace) -> FloatArray:
        """Return the angle by which it is missed, (T,) rad in [0, pi]."""
        return trace.rotation_to(self.target) if isinstance(self.target, tuple) else trace.yaw_error_to(self.target)

    def orientation_at(self, trace: Trace, row: int) -> str:
        """Return the orientation at a row of a trace as text; empty for a heading, whose error says enough."""
        if not isinstance(self.target, tuple):
            return ""
        x, y, z, w = trace.base_orientation_xyzw[row].tolist()
        roll, pitch, yaw = (round(angle, 4) + 0.0 for angle in geometry.rpy_from_quaternion((x, y, z, w)))
        return rpy_text((roll, pitch, yaw))


class PoseTarget(MotionAssertion):
    """The base class of assertions on a place with a heading or an orientation."""

    names_frame: ClassVar[bool] = True
    ceilings: ClassVar[tuple[Ceiling, ...]] = (
        Ceiling("yaw_tolerance", "rad", HEADINGS),
        Ceiling("orientation.tolerance", "rad", ORIENTATIONS),
    )

    x: Annotated[Metres | None, Field(description="default: any")] = None
    y: Annotated[Metres | None, Field(description="default: any")] = None
    z: Annotated[Metres | None, Field(description="default: any height")] = None
    yaw: Annotated[Radians | None, Field(description="default: any heading")] = None
    tolerance: Annotated[PositiveMetres, Field(description="maximum distance from the place")] = 0.05
    yaw_tolerance: PositiveRadians = math.radians(5)
    orientation: Annotated[
        TargetOrientation | None, Field(description="all three angles, instead of 'yaw'; default: any")
    ] = None

    @model_validator(mode="after")
    def _has_one_angle(self) -> Self:
        if self.yaw is not None and self.orientation is not None:
            raise ValueError("give 'yaw' or 'orientation', not both; 'orientation' has a yaw of its own")
        return self

    @property
    def coordinates(self) -> dict[str, float]:
        """The given coordinates, by axis."""
        coordinates = {"x": self.x, "y": self.y, "z": self.z}
        return {axis: value for axis, value in coordinates.items() if value is not None}

    @override
    def range_claims(self, limits: LinkRange) -> Findings:
        yield from limits.out_of_reach((), self.coordinates, self.tolerance)

    def distance_from(self, start: Mapping[str, float]) -> float:
        """Return the distance in m of the place from the start of the base, whose coordinates are given by axis."""
        return math.hypot(*(value - start[axis] for axis, value in self.coordinates.items()))

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield a place, or a tolerance, to which the base would not come in the time limit."""
        yield from super().run_claims(run)
        if not self.watches_base:
            return
        away = self.distance_from(dict(zip("xyz", run.trace.base_position_xyz[0].tolist(), strict=True)))
        if run.is_part and not run.verdict.passed:
            yield from run.beyond_drive(away - self.tolerance, "move the place, or give more time")
        elif run.verdict.passed and self.coordinates and not self.facing:
            yield from run.beyond_drive(self.tolerance - away, "give a smaller tolerance", ("tolerance",))

    @property
    def facing(self) -> str:
        """The heading or the orientation in a title; empty if any is right."""
        if self.orientation is None:
            return "" if self.yaw is None else f"facing {units.display(self.yaw, 'rad')}"
        return f"at {self.orientation.text}"

    def angle(
        self, yaw: float = 0.0, left: Quaternion = geometry.IDENTITY, right: Quaternion = geometry.IDENTITY
    ) -> TargetAngle | None:
        """Return the required heading plus `yaw` in rad, or orientation between two rotations; None for any."""
        if self.orientation is not None:
            target = geometry.multiply(geometry.multiply(left, self.orientation.orientation_xyzw), right)
            return TargetAngle("orientation", self.orientation.tolerance, target)
        return None if self.yaw is None else TargetAngle("heading", self.yaw_tolerance, yaw + self.yaw)

    def marks_at(self, x: float, y: float, z: float | None, angle: TargetAngle | None) -> tuple[Mark, ...]:
        """Return the marks of the place in m and of the angle, with their tolerances."""
        if angle is None:
            return tuple(goal(x, y, z, self.tolerance))
        return tuple(goal(x, y, z, self.tolerance, angle.target, angle_tolerance=angle.tolerance))

    def approach(self, place: str, angle: TargetAngle | None) -> ClosestApproach:
        """Return the fold of the distance from the place and of the error of the angle."""
        nearest = ClosestApproach("came", place, "m", self.tolerance)
        return nearest if angle is None else replace(nearest, angle_tolerance=angle.tolerance, angle=angle.name)


class Reach(PoseTarget):
    """The origin of the base link, or of `link`, comes within `tolerance` of the point `x`, `y`, `z`.

    With `yaw`, the heading must be within `yaw_tolerance` of `yaw` at the same moment. With `orientation`, the one
    rotation that leads from the orientation to the required one must be at most its `tolerance`. All values are in
    `frame`, which may move. Reaching the point is a goal.
    """

    key: ClassVar[str] = "reach"
    reference: ClassVar[Reference] = Reference(
        "motion",
        "goal",
        "The robot was elsewhere, and then came to the place, with the heading `yaw` if it is given.",
        "The robot never came so near, or it was there at t = 0 and never came back.",
    )

    x: Metres
    y: Metres

    is_goal: ClassVar[bool] = True
    has_truth: ClassVar[bool] = True

    @override
    def title_of(self, watched: Watched) -> str:
        within = f"within {units.display(self.tolerance, 'm')}"
        return " ".join(filter(None, (self.key_of(watched), self.place, self.facing, within)))

    @property
    def place(self) -> str:
        """The point as text."""
        return f"({', '.join(f'{value:g}' for value in (self.x, self.y, self.z) if value is not None)})"

    @override
    def opened_on(self, watched: Watched, scene: Scene, start: Observation) -> Monitor:
        angle = self.angle()
        return ReachMonitor(self, self.approach(f"{self.place}{watched.inside}", angle), angle)

    @override
    def marks_in(self, watched: Watched, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        return self.marks_at(self.x, self.y, self.z, self.angle())


@dataclass(frozen=True, slots=True)
class ReachMonitor(Monitor):
    """The monitor of the distance from the point."""

    is_goal = True
    is_momentary = True

    spec: Reach
    nearest: ClosestApproach
    angle: TargetAngle | None  # the required heading or orientation; None for any
    orientation: str = ""  # the orientation at the best step as text; empty if none is required

    state: ClassVar[State] = delegated("nearest.state")

    @override
    def observe(self, trace: Trace) -> Self:
        nearest = self.nearest.observe(trace.time, *self._errors(trace))
        if self.angle is None or nearest.goal is self.nearest.goal:
            return replace(self, nearest=nearest)
        best = int((trace.time == nearest.goal.time).argmax())
        return replace(self, nearest=nearest, orientation=self.angle.orientation_at(trace, best))

    @override
    def truth(self, trace: Trace) -> Truth:
        return self.nearest.truth(trace.time, *self._errors(trace))

    @override
    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        return self.nearest.drawn(f"distance to {self.nearest.place}", trace.time, *self._errors(trace))

    def verdict(self) -> Verdict:
        """Return the verdict; if the orientation was missed, the message has the one at the best step."""
        verdict = self.nearest.verdict()
        if not self.orientation or (self.nearest.angle_error or 0.0) <= self.nearest.angle_tolerance:
            return verdict
        return replace(verdict, message=f"{verdict.message} with {self.orientation}")

    def _errors(self, trace: Trace) -> tuple[FloatArray, FloatArray | None]:
        return self._distance(trace), None if self.angle is None else self.angle.error(trace)

    def _distance(self, trace: Trace) -> FloatArray:
        if self.spec.z is None:
            return trace.planar_distance_to(self.spec.x, self.spec.y)
        return trace.distance_to((self.spec.x, self.spec.y, self.spec.z))


class FinalPose(PoseTarget):
    """At the end of the run, the base link, or `link`, is at `x`, `y`, `z` with the heading `yaw`, within tolerances.

    It is checked at the end of the run, or at `before`, and neither ends a run nor prolongs it. A run ends as soon as
    all goals are met; to let the robot stop first, add `settled` or a `duration`. Values that are left out are not
    checked. With `relative`, they are relative to the start: for the base, x is ahead and y to the left; for a `link`,
    they are along the axes of `frame`.
    """

    key: ClassVar[str] = "final_pose"
    reference: ClassVar[Reference] = Reference(
        "motion",
        "judged at the end",
        "At the last step, place and heading were within the tolerances.",
        "At the last step, the place or the heading was outside its tolerance.",
    )

    relative: Annotated[
        bool, Field(description="relative to the start pose (x ahead, y to the left); else in 'frame'")
    ] = False

    @model_validator(mode="after")
    def _is_somewhere(self) -> Self:
        if not self.coordinates and self.yaw is None and self.orientation is None:
            raise ValueError("give at least one of 'x', 'y', 'z', 'yaw' and 'orientation'")
        return self

    @property
    def place_text(self) -> str:
        """The place as text, such as "(2, 0)" or "x = 2 m"; empty if no coordinate is given."""
        if "x" in self.coordinates and "y" in self.coordinates:
            return f"({', '.join(f'{value:g}' for value in self.coordinates.values())})"
        return ", ".join(f"{axis} = {units.display(value, 'm')}" for axis, value in self.coordinates.items())

    is_over_time: ClassVar[bool] = False

    @override
    def range_claims(self, limits: LinkRange) -> Findings:
        if self.coordinates:
            most = limits.farthest(self.coordinates)
            if self.relative:
                most = 2 * limits.radius + ROUNDING_M + math.hypot(*self.coordinates.values())
            yield from limits.too_wide(most, "this place", {"tolerance": self.tolerance})
        if not self.relative:
            yield from super().range_claims(limits)

    @override
    def distance_from(self, start: Mapping[str, float]) -> float:
        return math.hypot(*self.coordinates.values()) if self.relative else super().distance_from(start)

    @override
    def title_of(self, watched: Watched) -> str:
        within = f"within {units.display(self.tolerance, 'm')}" if self.coordinates else ""
        start = "from the start" if self.relative else ""
        return " ".join(filter(None, (self.key_of(watched), self.place_text, self.facing, within, start)))

    @override
    def opened_on(self, watched: Watched, scene: Scene, start: Observation) -> Monitor:
        place = f"{self.place_text}{watched.inside}" if self.coordinates else ""
        angle = self._angle(watched.name, start)
        return FinalPoseMonitor(self, self._origin(watched.name, start), self.approach(place, angle), angle)

    def _origin(self, name: str, start: Observation) -> Pose:
        if not self.relative:
            return Pose()
        return Pose(start.pose.position_xyz) if name else start.pose

    def _angle(self, name: str, start: Observation) -> TargetAngle | None:
        if not self.relative:
            return self.angle()
        yaw = start.pose.yaw
        if name:
            return self.angle(yaw, right=start.pose.orientation_xyzw)
        return self.angle(yaw, left=geometry.quaternion_from_rpy(0.0, 0.0, yaw))

    def marks_in(self, watched: Watched, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """See MotionAssertion.marks_in. Returns the place, or a line if only x or y is given."""
        origin = self._origin(watched.name, start)
        angle = self._angle(watched.name, start)
        begin_x, begin_y, _ = start.pose.position_xyz
        if self.x is None or self.y is None:
            axes = {} if self.relative else {"x": self.x, "y": self.y}
            return tuple(line(axis, at, (begin_x, begin_y)) for axis, at in axes.items() if at is not None)
        cosine, sine = math.cos(origin.yaw), math.sin(origin.yaw)
        x, y, z = origin.position_xyz
        x, y = x + cosine * self.x - sine * self.y, y + sine * self.x + cosine * self.y
        height = None if self.z is None else z + self.z
        return self.marks_at(x, y, height, angle)


@dataclass(frozen=True, slots=True)
class FinalPoseMonitor(Monitor):
    """The monitor of the pose at the last step, and of the closest approach before it."""

    is_momentary = True
    spec: FinalPose
    origin: Pose  # pose of the frame of the place, in the world
    nearest: ClosestApproach
    angle: TargetAngle | None = None  # the required heading or orientation; None for any
    orientation: str = ""  # the orientation at the last step as text; empty if none is required
    distance: float = 0.0  # distance, angle_error: errors at the last step in m and rad; 0 where nothing is required
    angle_error: float = 0.0
    end: float | None = None  # sim time of the last step, in s

    state = State.HOLDS  # it stays open until the end, because the pose may still change

    @override
    def observe(self, trace: Trace) -> Self:
        if not len(trace):
            return self
        distance = self._distance(trace)
        angle_error = self._angle_error(trace)
        return replace(
            self,
            nearest=self.nearest.observe(trace.time, distance, angle_error),
            orientation="" if self.angle is None else self.angle.orientation_at(trace, -1),
            distance=float(distance[-1]),
            angle_error=0.0 if angle_error is None else float(angle_error[-1]),
            end=float(trace.time[-1]),
        )

    @override
    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        name = f"distance to {self.nearest.place}"
        curves = self.nearest.drawn(name, trace.time, self._distance(trace), self._angle_error(trace))
        return tuple(curve.at_end() for curve in (curves if self.spec.coordinates else curves[1:]))

    def verdict(self) -> Verdict:
        """Return the verdict on distance or angle, whichever is worse relative to its tolerance."""
        spec = self.spec
        errors = [(self.distance, spec.tolerance, "m")] if spec.coordinates else []
        errors += [] if self.angle is None else [(self.angle_error, self.angle.tolerance, "rad")]
        error, limit, unit = max(errors, key=lambda error: error[0] / error[1])
        if self.end is None:
            return Verdict(False, None, limit, None, unit, None, "no physics step to measure")
        passed = error <= limit
        message = f"ended {self._errors()} at {self.end:.2f} s{'' if passed else self._miss()}"
        return Verdict(passed, error, limit, limit - error, unit, self.end, message)

    def _errors(self) -> str:
        errors = []
        if self.spec.coordinates:
            near, _ = units.display_apart(self.distance, self.spec.tolerance, "m")
            errors.append(f"{near} from {self.nearest.place}")
        if self.angle is not None:
            off, _ = units.display_apart(self.angle_error, self.angle.tolerance, "rad")
            errors.append(f"{off} off its {self.angle.name}")
        return ", ".join(errors)

    def _miss(self) -> str:
        """Return the part of the message on the orientation and the closest approach: overshoot or shortfall."""
        nearest, is_turned = self.nearest, self.angle is not None and self.angle_error > self.angle.tolerance
        orientation = f" with {self.orientation}" if is_turned and self.orientation else ""
        if (nearest.distance, nearest.angle_error or 0.0) == (self.distance, self.angle_error):
            return orientation
        near = "within tolerance" if nearest.state is State.HOLDS else "closest"
        return f"{orientation}; it was {near} at {nearest.goal.time:.2f} s"

    def _distance(self, trace: Trace) -> FloatArray:
        """Return (T,) m, over the given axes, in the frame of `origin`."""
        from_origin = trace.base_position_xyz - np.asarray(self.origin.position_xyz)
        cosine, sine = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        x, y, z = from_origin.T
        axes = {"x": cosine * x + sine * y, "y": cosine * y - sine * x, "z": z}
        squares = [(axes[axis] - value) ** 2 for axis, value in self.spec.coordinates.items()]
        return np.asarray(np.sqrt(sum(squares, np.zeros(len(trace)))), dtype=np.float64)

    def _angle_error(self, trace: Trace) -> FloatArray | None:
        return None if self.angle is None else self.angle.error(trace)

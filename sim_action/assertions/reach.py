"""`reach: {x: 2 m, y: 0}`: the robot, or a link, reaches a point, optionally with a heading or an orientation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Reference
from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.goals import ClosestApproach
from sim_action.assertions.monitors.watched import MotionAssertion, Watched
from sim_action.core import geometry, units
from sim_action.core.field_types import FrozenModel, Metres, PositiveMetres, PositiveRadians, Radians
from sim_action.core.geometry import Quaternion, Vector3
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, replace
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Mark, Signal, Verdict, goal
from sim_action.world.claims import HEADINGS, ORIENTATIONS, Ceiling, Findings, JudgedRun
from sim_action.world.link_range import LinkRange
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

    def found(self, trace: Trace, row: int) -> str:
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
        given = {"x": self.x, "y": self.y, "z": self.z}
        return {axis: value for axis, value in given.items() if value is not None}

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
    found: str = ""  # the orientation at the best step as text; empty if none is required

    @property
    @override
    def state(self) -> State:
        return self.nearest.state

    @override
    def observe(self, trace: Trace) -> Self:
        nearest = self.nearest.observe(trace.time, *self._errors(trace))
        if self.angle is None or nearest.goal is self.nearest.goal:
            return replace(self, nearest=nearest)
        best = int((trace.time == nearest.goal.time).argmax())
        return replace(self, nearest=nearest, found=self.angle.found(trace, best))

    @override
    def truth(self, trace: Trace) -> Truth:
        return self.nearest.truth(trace.time, *self._errors(trace))

    @override
    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        return self.nearest.drawn(f"distance to {self.nearest.place}", trace.time, *self._errors(trace))

    def verdict(self) -> Verdict:
        """Return the verdict; if the orientation was missed, the message has the one at the best step."""
        told = self.nearest.verdict()
        if not self.found or (self.nearest.angle_error or 0.0) <= self.nearest.angle_tolerance:
            return told
        return replace(told, message=f"{told.message} with {self.found}")

    def _errors(self, trace: Trace) -> tuple[FloatArray, FloatArray | None]:
        return self._distance(trace), None if self.angle is None else self.angle.error(trace)

    def _distance(self, trace: Trace) -> FloatArray:
        if self.spec.z is None:
            return trace.planar_distance_to(self.spec.x, self.spec.y)
        return trace.distance_to((self.spec.x, self.spec.y, self.spec.z))

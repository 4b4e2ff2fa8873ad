"""`joint: {name: elbow, near: 90 deg}` and `joint_within: {position: {elbow: [0 deg, 90 deg]}}`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Assertion, Reference, shortened_title
from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.bounds import (
    Bounds,
    ClosestApproach,
    Interval,
    IntervalsMonitor,
    SignalMonitor,
    bounds_formula,
    check_order,
)
from sim_action.core import units
from sim_action.core.field_types import JointEffort, JointPosition, JointQuantity, JointVelocity
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, delegated, replace
from sim_action.core.wording import FirstFew, did_you_mean
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.joint_selection import (
    as_written,
    bare_angle,
    chosen,
    name_problem,
    reading_of,
    unit_problem,
)
from sim_action.robot.model.kinematics import beyond_limits
from sim_action.robot.model.robot_model import READINGS, Joint, Reading
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Signal, Verdict
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun, beyond
from sim_action.world.robot_reach import beyond_motor, beyond_time, joint_range
from sim_action.world.scene import Scene


class JointReading(Assertion):
    """A joint's `reading` (position, velocity, effort) reaches `at_least` or `near`, or never exceeds `at_most`.

    `reading` is the position, the velocity or the effort (torque or force) of the joint's motor.
    """

    key: ClassVar[str] = "joint"
    reference: ClassVar[Reference] = Reference(
        "joints",
        "`at_least`, `near`: goal; `at_most`: invariant",
        "The reading reached `at_least`, or came `near` after it was elsewhere, and exceeded `at_most` at no step.",
        "The reading never got there, was there only at t = 0, or exceeded `at_most` at a step.",
    )

    name: Annotated[str, Field(min_length=1, description="name of the joint in the model")]
    reading: Reading = "position"
    at_least: Annotated[JointQuantity | None, Field(description="a goal: must be reached")] = None
    at_most: Annotated[JointQuantity | None, Field(description="an invariant: must not be exceeded")] = None
    near: Annotated[JointQuantity | None, Field(description="a goal: must be reached within 'tolerance'")] = None
    tolerance: Annotated[JointQuantity | None, Field(description="required with 'near': allowed distance from it")] = (
        None
    )

    @model_validator(mode="after")
    def _asks_for_one_thing(self) -> Self:
        bounded = self.at_least is not None or self.at_most is not None
        if bounded == (self.near is not None):
            raise ValueError("give 'at_least' or 'at_most', or else 'near' with 'tolerance'")
        if (self.near is None) != (self.tolerance is None):
            raise ValueError("'near' and 'tolerance' go together")
        at_least, at_most, _, tolerance = (self._magnitude(value) for value in self._asked().values())
        check_order(at_least, at_most, "", (as_written(self.at_least or 0.0), as_written(self.at_most or 0.0)))
        if tolerance is not None and tolerance <= 0:
            raise ValueError("'tolerance' must be greater than 0")
        return self

    def _asked(self) -> dict[str, float | str | None]:
        return {"at_least": self.at_least, "at_most": self.at_most, "near": self.near, "tolerance": self.tolerance}

    def _magnitude(self, written: float | str | None) -> float | None:
        return None if written is None else units.parse(written, *READINGS[self.reading])

    @property
    @override
    def is_goal(self) -> bool:
        return self.at_most is None or self.at_least is not None

    has_truth: ClassVar[bool] = True

    @property
    @override
    def title(self) -> str:
        limits = ", ".join(
            f"{word.replace('_', ' ')} {as_written(value)}"
            for word, value in self._asked().items()
            if value is not None and word != "tolerance"
        )
        return f"joint {self.name} {self.reading} {limits}"

    @property
    @override
    def step_memory_s(self) -> float:
        return 0.0 if self.reading == "position" else 0.1

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield an unknown joint, and units that do not fit its type."""
        moving = [joint.name for joint in scene.model.moving_joints]
        if self.name not in moving:
            yield ("name",), f"the model has no moving joint '{self.name}'{did_you_mean(self.name, moving)}"
            return
        joint = scene.model.joints_by_name[self.name]
        for key, written in self._asked().items():
            try:
                units.parse(0.0 if written is None else written, joint.dimension(self.reading))
            except units.UnitError as error:
                yield (key,), str(error)
        if self.reading == "position" and not any(self._bare_angles(scene)):
            lower, upper = scene.model.reach(self.name)
            yield from self._unreachable(replace(joint, lower=lower, upper=upper))

    def _unreachable(self, joint: Joint) -> SpecProblems:
        """Yield a goal beyond the limits of the joint."""
        lower, upper = joint.range
        at_least, _, near, tolerance = (self._magnitude(value) for value in self._asked().values())
        if at_least is not None and at_least > upper and (problem := beyond_limits(joint, at_least)) is not None:
            yield ("at_least",), f"'{self.name}' never gets there: {problem}"
        if near is not None and abs(near - max(lower, min(upper, near))) > (tolerance or 0.0):
            yield ("near",), f"'{self.name}' never comes so near: {beyond_limits(joint, near)}"

    def _bare_angles(self, scene: Scene) -> Findings:
        for key, written in self._asked().items() if self.reading == "position" else ():
            if (problem := bare_angle(scene.model, (self.name,), written)) is not None:
                yield ClaimFinding("bare-angle", (key,), problem)

    @override
    def meaning(self, scene: Scene) -> str:
        from sim_action.assertions.temporal_logic.formula import Signal  # its name stands for another class here

        quantity = str(Signal(self.reading, self.name))
        at_least, at_most, near, tolerance = (self._magnitude(value) for value in self._asked().values())
        if near is not None:
            return f"eventually (abs({quantity} - {near!r}) <= {tolerance!r})"
        return bounds_formula(quantity, at_least, at_most)

    @override
    def robot_claims(self, scene: Scene) -> Findings:
        for finding in self._bare_angles(scene):
            yield finding
            return
        at_most = self._magnitude(self.at_most)
        _, high = joint_range(scene, self.name, self.reading)
        if at_most is not None and at_most >= high and self.at_least is None:
            unit = scene.model.joints_by_name[self.name].dimension(self.reading).si
            why = f"{self.name} has no {self.reading} above {units.display(high, unit)}"
            yield beyond(("at_most",), at_most, unit, why)
        elif at_most is not None and (reason := beyond_motor(scene, self.name, self.reading, at_most)):
            yield ClaimFinding("limit-beyond-range", ("at_most",), reason)

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield a limit that the joint does not exceed in the time limit, also of a part that did not hold."""
        at_least, at_most = self._magnitude(self.at_least), self._magnitude(self.at_most)
        limit = at_least if run.is_part and not run.verdict.passed else None if self.is_goal else at_most
        if limit is not None:
            yield from beyond_time(run, (self.name,), self.reading, (-math.inf, limit))

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        joint = scene.model.joints_by_name[self.name]
        unit, signal = joint.dimension(self.reading).si, reading_of(joint, self.reading)
        at_least, at_most, near, tolerance = (self._magnitude(value) for value in self._asked().values())
        if near is not None and tolerance is not None:
            nearest = ClosestApproach(f"{self.name} came", units.display(near, unit), unit, tolerance)
            return NearMonitor(f"{self.name} {self.reading}", signal, near, nearest, self.name)
        bounds = Bounds(f"{self.name} had {self.reading}", unit, at_least, at_most)
        return SignalMonitor(f"{self.name} {self.reading}", signal, bounds, self.name)


@dataclass(frozen=True, slots=True)
class NearMonitor(Monitor):
    """The monitor of the distance of a reading of a joint from a value."""

    is_goal = True
    is_momentary = True

    name: str
    signal: Callable[[Trace], FloatArray]
    value: float
    nearest: ClosestApproach
    joint: str

    state: ClassVar[State] = delegated("nearest.state")

    @override
    def observe(self, trace: Trace) -> Self:
        return replace(self, nearest=self.nearest.observe(trace.time, self._distance(trace)))

    @override
    def truth(self, trace: Trace) -> Truth:
        return self.nearest.truth(trace.time, self._distance(trace))

    @override
    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        return self.nearest.drawn(f"{self.name} from {self.nearest.place}", trace.time, self._distance(trace))

    def verdict(self) -> Verdict:
        """Return the verdict. `measured` is the least distance from the value, `limit` the tolerance."""
        return replace(self.nearest.verdict(), joint=self.joint)

    def _distance(self, trace: Trace) -> FloatArray:
        return abs(self.signal(trace) - self.value)


Written = float | str
_BOUNDS = "an invariant: name, or pattern such as '*_wheel_joint', to [lower, upper]"


class JointWithin(Assertion):
    """Positions, velocities and efforts (torques or forces) of joints stay between bounds.

    A pattern applies to every joint that matches it; `"*"` matches all.
    """

    key: ClassVar[str] = "joint_within"
    reference: ClassVar[Reference] = Reference(
        "joints",
        "invariant",
        "All readings were between their bounds at every step.",
        "A reading was outside a bound at a step.",
    )

    position: Annotated[dict[str, tuple[JointPosition, JointPosition]], Field(description=_BOUNDS)] = Field(
        default_factory=dict
    )
    velocity: Annotated[dict[str, tuple[JointVelocity, JointVelocity]], Field(description=_BOUNDS)] = Field(
        default_factory=dict
    )
    effort: Annotated[dict[str, tuple[JointEffort, JointEffort]], Field(description=_BOUNDS)] = Field(
        default_factory=dict
    )

    @model_validator(mode="after")
    def _bounds_something(self) -> Self:
        if not any(True for _ in self.asked()):
            raise ValueError("give at least one joint in 'position', 'velocity' or 'effort'")
        for reading, name, (written_lower, written_upper) in self.asked():
            lower, upper = (units.parse(bound, *READINGS[reading]) for bound in (written_lower, written_upper))
            if lower >= upper:
                raise ValueError(
                    f"the bounds of '{name}' are swapped or equal: {written_lower} is not less than {written_upper}"
                )
        return self

    def asked(self) -> Iterator[tuple[Reading, str, tuple[Written, Written]]]:
        """Yield each reading, joint name or pattern, and its bounds as written."""
        for name, bounds in self.position.items():
            yield "position", name, bounds
        for name, bounds in self.velocity.items():
            yield "velocity", name, bounds
        for name, bounds in self.effort.items():
            yield "effort", name, bounds

    has_truth: ClassVar[bool] = True

    @property
    @override
    def title(self) -> str:
        bounds = ((f"{name} {reading}", *map(as_written, bounds)) for reading, name, bounds in self.asked())
        return shortened_title(
            f"{self.key} " + ", ".join(f"{what} {lower} to {upper}" for what, lower, upper in bounds)
        )

    step_memory_s: ClassVar[float] = 0.1

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield unknown joints, and units that do not fit their type."""
        hinted = FirstFew()
        for reading, name, bounds in self.asked():
            if (trouble := name_problem(scene.model, name, hinted)) is not None:
                yield (reading, name), trouble
            for joint in chosen(scene.model, (name,)):
                for index, written in enumerate(bounds):
                    if (misfit := unit_problem(joint, reading, written)) is not None:
                        yield (reading, name, index), misfit

    @override
    def meaning(self, scene: Scene) -> str:
        from sim_action.assertions.temporal_logic.formula import Signal  # its name stands for another class here

        sides = (
            bounds_formula(
                str(Signal(reading, joint.name)),
                *(units.parse(bound, *READINGS[reading]) for bound in bounds),
                goal=False,
            )
            for reading, name, bounds in self.asked()
            for joint in chosen(scene.model, (name,))
        )
        return " and ".join(sides)

    @override
    def robot_claims(self, scene: Scene) -> Findings:
        for reading, name, bounds in self.asked():
            problems = [bare_angle(scene.model, (name,), bound) for bound in bounds if reading == "position"]
            for index, problem in enumerate(problems):
                if problem is not None:
                    yield ClaimFinding("bare-angle", (reading, name, index), problem)
            limits = [joint_range(scene, joint.name, reading) for joint in chosen(scene.model, (name,))]
            try:
                lower, upper = (units.parse(bound, *READINGS[reading]) for bound in bounds)
            except units.UnitError:
                continue  # reported as a problem
            if limits and not any(problems) and all(lower <= low and high <= upper for low, high in limits):
                message = f"{name} never leaves these bounds: its own limits are tighter; give tighter bounds"
                yield ClaimFinding("unreachable-limit", (reading, name), message)
                continue
            reasons = (beyond_motor(scene, joint.name, reading, upper) for joint in chosen(scene.model, (name,)))
            if (reason := next(reasons, None)) is not None:
                yield ClaimFinding("limit-beyond-range", (reading, name), reason)

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield positions that a joint does not leave in the time limit."""
        for reading, name, bounds in self.asked() if run.verdict.passed else ():
            lower, upper = (units.parse(bound, *READINGS[reading]) for bound in bounds)
            joints = [joint.name for joint in chosen(run.scene.model, (name,))]
            yield from (one.below((reading, name)) for one in beyond_time(run, joints, reading, (lower, upper)))

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        intervals = self._intervals(scene)
        return IntervalsMonitor(
            tuple(side for interval in intervals for side in interval.sides(interval.upper - interval.lower))
        )

    def _intervals(self, scene: Scene) -> Iterator[Interval]:
        for reading, name, bounds in self.asked():
            for joint in chosen(scene.model, (name,)):
                dimension = joint.dimension(reading)
                lower, upper = (units.parse(bound, dimension) for bound in bounds)
                label = joint.name if reading == "position" else f"{joint.name} {reading}"
                yield Interval(label, dimension.si, lower, upper, reading_of(joint, reading), joint.name)

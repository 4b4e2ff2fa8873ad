"""`effort: {joints: [elbow], at_most: 5 N m}` and `energy: {at_most: 5 J}`: the effort and the work of motors."""

from __future__ import annotations

import math
from collections.abc import Callable
from operator import ge, itemgetter
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Assertion, Reference, shortened_title
from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.bounds import AllLimits, Bounds, BoundsMonitor, SignalMonitor
from sim_action.core import units
from sim_action.core.field_types import JointEffort, NonNegativeJoules
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, replace
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.joint_selection import (
    as_written,
    choice_problems,
    chosen,
    motor_problems,
    reading_of,
    unit_problem,
)
from sim_action.robot.model.robot_model import READINGS
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Signal, Verdict
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun
from sim_action.world.robot_reach import joint_range
from sim_action.world.scene import Scene


class Effort(Assertion):
    """The effort (torque or force) of each motor never exceeds `at_most`, or its RMS is at most `rms_at_most`.

    Limits hold in both directions. The root mean square (RMS), a measure of motor heating, is judged at the end or at
    `before`. Efforts stay within the limits of the model, except for a motor that is `stuck` by `faults`. Velocity and
    position targets that jump from tick to tick cause peaks: if peaks matter, give the command the physics rate.
    """

    key: ClassVar[str] = "effort"
    reference: ClassVar[Reference] = Reference(
        "joints",
        "`at_most`: invariant; `rms_at_most`: judged at the end",
        "No effort exceeded `at_most` at any step, and each RMS at the end is at most `rms_at_most`.",
        "An effort exceeded `at_most` at a step, or an RMS is greater than `rms_at_most`.",
    )

    joints: Annotated[
        tuple[str, ...], Field(description="names, or patterns such as '*_wheel_joint'; default: all moving joints")
    ] = ()
    at_most: Annotated[JointEffort | None, Field(description="an invariant: must not be exceeded")] = None
    rms_at_most: Annotated[
        JointEffort | None, Field(description="upper limit of the root mean square over the run")
    ] = None

    @model_validator(mode="after")
    def _has_a_limit(self) -> Self:
        if not self._limits():
            raise ValueError("give 'at_most', 'rms_at_most' or both")
        for key, written in self._limits().items():
            if units.parse(written, *READINGS["effort"]) < 0:
                raise ValueError(f"'{key}' must not be less than 0: it limits both directions")
        return self

    def _limits(self) -> dict[str, float | str]:
        limits = {"at_most": self.at_most, "rms_at_most": self.rms_at_most}
        return {key: written for key, written in limits.items() if written is not None}

    @property
    @override
    def has_truth(self) -> bool:
        return self.rms_at_most is None

    @property
    @override
    def title(self) -> str:
        of = f" of {', '.join(self.joints)}" if self.joints else ""
        limits = (
            f"{key.replace('rms', 'RMS').replace('_', ' ')} {as_written(value)}"
            for key, value in self._limits().items()
        )
        return shortened_title(f"{self.key}{of} {', '.join(limits)}")

    @property
    @override
    def step_memory_s(self) -> float:
        return 0.1 if self.rms_at_most is None else math.inf

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield unknown joints, and limits whose unit does not fit the joint."""
        yield from choice_problems(scene.model, self.joints)
        yield from motor_problems(scene.model, self.joints)
        for key, written in self._limits().items():
            for joint in chosen(scene.model, self.joints):
                if (misfit := unit_problem(joint, "effort", written)) is not None:
                    hint = "" if self.joints else "; select joints of one kind with 'joints'"
                    yield (key,), f"{misfit}{hint}"
                    break

    @property
    @override
    def is_over_time(self) -> bool:
        return self.at_most is not None

    @override
    def robot_claims(self, scene: Scene) -> Findings:
        """Yield limits that the motors of all selected joints cannot exceed."""
        motors = [joint for joint in chosen(scene.model, self.joints) if joint.mimic is None]
        most = [joint_range(scene, joint.name, "effort")[1] for joint in motors]
        for key, written in self._limits().items():
            try:
                limits = [units.parse(written, joint.dimension("effort")) for joint in motors]
            except units.UnitError:
                continue  # reported as a problem
            if motors and all(map(ge, limits, most)):
                effort, joint = max(zip(most, motors, strict=True), key=itemgetter(0))
                motor = f"{units.display(effort, joint.dimension('effort').si)} ('{joint.name}')"
                message = f"this limit cannot be exceeded: the motors give at most {motor}; give a smaller limit"
                yield ClaimFinding("unreachable-limit", (key,), message)

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        monitors: list[Monitor] = []
        for joint in chosen(scene.model, self.joints):
            dimension = joint.dimension("effort")
            effort = reading_of(joint, "effort")
            limits = {key: units.parse(written, dimension) for key, written in self._limits().items()}
            who = f"{joint.name} exerted"
            if (at_most := limits.get("at_most")) is not None:
                bounds = Bounds(who, dimension.si, None, at_most)
                monitors.append(SignalMonitor(f"{joint.name} effort", magnitude(effort), bounds, joint.name))
            if (rms_at_most := limits.get("rms_at_most")) is not None:
                monitors.append(RootMeanSquareMonitor(joint.name, effort, dimension.si, rms_at_most))
        return AllLimits(tuple(monitors))


def magnitude(signal: Callable[[Trace], FloatArray]) -> Callable[[Trace], FloatArray]:
    """Return the absolute value of a signal, (T,)."""
    return lambda trace: np.abs(signal(trace))


@dataclass(frozen=True, slots=True)
class RootMeanSquareMonitor(Monitor):
    """The fold of the squares of an effort. It is judged at the end, because later steps can lower the RMS."""

    joint: str  # the joint whose motor exerts it
    signal: Callable[[Trace], FloatArray]
    unit: str
    limit: float
    squares: float = 0.0  # sum of the squares over `moments` steps, up to sim time `end` in s
    moments: int = 0
    end: float | None = None

    state = State.HOLDS

    @override
    def observe(self, trace: Trace) -> Self:
        if not len(trace):
            return self
        squares = float(self._squares(trace)[-1])
        return replace(self, squares=squares, moments=self.moments + len(trace), end=float(trace.time[-1]))

    def verdict(self) -> Verdict:
        """Return the verdict on the RMS so far."""
        if self.end is None:
            nothing = "no physics step to measure"
            return Verdict(True, None, self.limit, None, self.unit, None, nothing, joint=self.joint)
        measured = math.sqrt(self.squares / self.moments)
        passed = measured <= self.limit
        value, limit = units.display_apart(measured, self.limit, self.unit)
        end = f"until {self.end:.2f} s, {'limit' if passed else 'more than'} {limit}"
        message = f"{self.joint} exerted {value} RMS {end}"
        margin = self.limit - measured
        return Verdict(passed, measured, self.limit, margin, self.unit, self.end, message, joint=self.joint)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Each value is the RMS up to that step; the last one counts."""
        means = self._squares(trace) / (self.moments + np.arange(1, len(trace) + 1))
        return (Signal(f"{self.joint} RMS effort", self.unit, trace.time, np.sqrt(means), upper=self.limit).at_end(),)

    def _squares(self, trace: Trace) -> FloatArray:
        """Return (T,) the sum of squares up to each step."""
        # One running sum: otherwise rounding would depend on the block size.
        return np.asarray(np.cumsum(np.concatenate(([self.squares], self.signal(trace) ** 2)))[1:], dtype=np.float64)


Braking = Literal["free", "costs", "regained"]


class Energy(Assertion):
    """The mechanical work of the motors never exceeds `at_most`.

    The work is summed over joints and physics steps since `after`. A motor does positive work if its effort has the
    direction of the motion, and negative work if it brakes. `braking` sets how negative work counts: "free" ignores it,
    "costs" adds its magnitude, "regained" subtracts it. Heat and holding torque are not included: see `effort`.
    """

    key: ClassVar[str] = "energy"
    reference: ClassVar[Reference] = Reference(
        "joints",
        "invariant",
        "The work never exceeded `at_most`. A robot that stands still passes.",
        "The work exceeded `at_most`.",
    )
    measured_unit: ClassVar[str | None] = "J"

    at_most: Annotated[NonNegativeJoules, Field(description="an invariant: must not be exceeded")]
    joints: Annotated[
        tuple[str, ...], Field(description="names, or patterns such as '*_wheel_joint'; default: all moving joints")
    ] = ()
    braking: Annotated[Braking, Field(description="how negative work counts")] = "free"

    @property
    @override
    def title(self) -> str:
        of = f" of {', '.join(self.joints)}" if self.joints else ""
        return shortened_title(f"{self.key}{of} at most {units.display(self.at_most, 'J')}")

    step_memory_s: ClassVar[float] = math.inf

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield unknown joints."""
        yield from choice_problems(scene.model, self.joints)
        yield from motor_problems(scene.model, self.joints)

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield a limit above the work of all motors at their highest effort and speed until the time limit."""
        joints = chosen(run.scene.model, self.joints)
        power = sum((joint.max_effort or math.inf) * (joint.max_velocity or math.inf) for joint in joints)
        if self.at_most > power * run.time_limit and run.scene.stuck.isdisjoint(joint.name for joint in joints):
            most = units.display(power * run.time_limit, "J")
            message = f"these motors do at most {most} of work in the time limit, at their highest effort and speed"
            yield ClaimFinding("limit-beyond-range", ("at_most",), f"{message}; give a smaller limit")

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        names = tuple(joint.name for joint in chosen(scene.model, self.joints))
        moving = tuple(start.joints[name].velocity if name in start.joints else 0.0 for name in names)
        return EnergyMonitor(names, self.braking, Bounds("used", "J", None, self.at_most), start.time, moving)


@dataclass(frozen=True, slots=True)
class EnergyMonitor(BoundsMonitor):
    """The fold of the work so far."""

    joints: tuple[str, ...]
    braking: Braking
    bounds: Bounds
    time: float  # sim time of the last step, in s
    velocities: tuple[float, ...]  # velocity of each joint at that time, in rad/s or m/s
    work: float = 0.0  # the work so far, in J

    def begin(self, trace: Trace) -> Self:
        """See Monitor.begin. Work before the window does not count."""
        if not len(trace):
            return self
        velocities = tuple(trace.joint_velocity[-1, self._columns(trace)].tolist())
        return replace(self, time=float(trace.time[-1]), velocities=velocities)

    @override
    def observe(self, trace: Trace) -> Self:
        if not len(trace):
            return self
        work = self.values(trace)
        return replace(self.begin(trace), bounds=self.bounds.observe(trace.time, work), work=float(work[-1]))

    @override
    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        return (self.bounds.drawn("work", trace.time, self.values(trace)),)

    @override
    def verdict(self) -> Verdict:
        return replace(self.bounds.verdict(), joint=self.joints[0] if len(self.joints) == 1 else "")

    def values(self, trace: Trace) -> FloatArray:
        """See BoundsMonitor.values. Returns (T,) J, the work up to each step."""
        # One running sum: otherwise rounding would depend on the block size.
        work = np.cumsum(np.concatenate(([self.work], self._works(trace))))[1:]
        return np.asarray(work, dtype=np.float64)

    def _works(self, trace: Trace) -> FloatArray:
        """Return (T,) J, the work of each step: effort times mean velocity times step duration, over all joints."""
        columns = self._columns(trace)
        velocities = np.vstack((np.asarray(self.velocities), trace.joint_velocity[:, columns]))
        seconds = np.diff(trace.time, prepend=self.time)
        works = trace.joint_effort[:, columns] * (velocities[1:] + velocities[:-1]) / 2 * seconds[:, None]
        counted = {"free": np.clip(works, 0.0, None), "costs": np.abs(works), "regained": works}[self.braking]
        # Sum the joints in order, for the same reason.
        return np.asarray(np.cumsum(counted, axis=1)[:, -1], dtype=np.float64)

    def _columns(self, trace: Trace) -> list[int]:
        return [trace.joint_names.index(name) for name in self.joints]

"""`energy: {at_most: 5 J}`: the mechanical work of the motors."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field
from typing_extensions import override

from sim_action.assertions import Assertion, Reference, shortened_title
from sim_action.assertions.monitors import Monitor
from sim_action.assertions.monitors.bounds import Bounds, BoundsMonitor
from sim_action.core import units
from sim_action.core.field_types import NonNegativeJoules
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, replace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.model.joint_selection import choice_problems, chosen, motor_problems
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Signal, Verdict
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun
from sim_action.world.scene import Scene

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

    @property
    @override
    def step_memory_s(self) -> float:
        return float("inf")

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

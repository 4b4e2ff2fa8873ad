"""`energy: {at_most: 5 J}`: how much work the motors do."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

from pydantic import Field

from sim_action.assertions import Assertion, shortened_title
from sim_action.assertions.joint_selection import choice_problems, chosen
from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.bounds import Bounds
from sim_action.core import units
from sim_action.core.field_types import NonNegativeJoules
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.verdict import Signal
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.trace import FloatArray, Trace
    from sim_action.state.verdict import Verdict


Braking = Literal["free", "costs", "regained"]


class Energy(Assertion):
    """Mechanical work of the motors since `after`, added up over joints and physics steps, stays below a limit.

    A motor does work when it pushes the way its joint moves; when it pushes against it, it brakes. `braking` says what
    that is: free (only work counts), as dear as driving (the magnitude of each motor's power counts), or regained (it
    is taken off). Heat, and what holding still takes, is not in it: see `effort`.
    """

    key: ClassVar[str] = "energy"

    at_most: Annotated[NonNegativeJoules, Field(description="an invariant: must not be exceeded")]
    joints: Annotated[
        tuple[str, ...], Field(description="names, or patterns such as '*_wheel_joint'; left out: all that move")
    ] = ()
    braking: Annotated[Braking, Field(description="what it takes to slow down, or to let a load down")] = "free"

    @property
    def title(self) -> str:
        """See Assertion.title."""
        of = f" of {', '.join(self.joints)}" if self.joints else ""
        return shortened_title(f"{self.key}{of} at most {units.display(self.at_most, 'J')}")

    def problems(self, scene: Scene) -> SpecProblems:
        """Joints that are not there."""
        yield from choice_problems(scene.model, self.joints)

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        names = tuple(joint.name for joint in chosen(scene.model, self.joints))
        moving = tuple(start.joints[name].velocity if name in start.joints else 0.0 for name in names)
        return EnergyMonitor(names, self.braking, Bounds("used", "J", None, self.at_most), start.time, moving)


@dataclass(frozen=True, slots=True)
class EnergyMonitor:
    """Carries the work so far, and the moment that it goes on from.

    Attributes:
        time: s of sim time.
        velocities: of the joints at that time, in rad/s or m/s.
        work: J.
    """

    is_momentary: ClassVar[bool] = False

    joints: tuple[str, ...]
    braking: Braking
    bounds: Bounds
    time: float
    velocities: tuple[float, ...]
    work: float = 0.0

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self.bounds.state

    def begin(self, trace: Trace) -> Self:
        """See CumulativeMonitor.begin: the work until the window opens does not count."""
        if not len(trace):
            return self
        velocities = tuple(trace.joint_velocity[-1, self._columns(trace)].tolist())
        return replace(self, time=float(trace.time[-1]), velocities=velocities)

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if not len(trace):
            return self
        work = self._work_until(trace)
        return replace(self.begin(trace), bounds=self.bounds.observe(trace.time, work), work=float(work[-1]))

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See PlottableMonitor.signals."""
        return (self.bounds.drawn("work", trace.time, self._work_until(trace)),)

    def _work_until(self, trace: Trace) -> FloatArray:
        """(T,) J, up to each moment."""
        import numpy as np

        # The sum begins with what came before: added afterwards, it would round differently for every cut.
        work = np.cumsum(np.concatenate(([self.work], self._works(trace))))[1:]
        return np.asarray(work, dtype=np.float64)

    def verdict(self) -> Verdict:
        """See Monitor.verdict."""
        return self.bounds.verdict()

    def _works(self, trace: Trace) -> FloatArray:
        """(T,) J, of each step: its effort, times the way that the mean of the velocities about it makes."""
        import numpy as np

        columns = self._columns(trace)
        velocities = np.vstack((np.asarray(self.velocities), trace.joint_velocity[:, columns]))
        seconds = np.diff(trace.time, prepend=self.time)
        works = trace.joint_effort[:, columns] * (velocities[1:] + velocities[:-1]) / 2 * seconds[:, None]
        counted = {"free": np.clip(works, 0.0, None), "costs": np.abs(works), "regained": works}[self.braking]
        # One joint after the other, for the same reason.
        return np.asarray(np.cumsum(counted, axis=1)[:, -1], dtype=np.float64)

    def _columns(self, trace: Trace) -> list[int]:
        return [trace.joint_names.index(name) for name in self.joints]

"""`at_once: [{reach: ...}, {upright: ...}]`: several conditions are true at the same moment."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar, Self

from typing_extensions import override

from sim_action.assertions import Assertion
from sim_action.assertions.combined import Several
from sim_action.assertions.monitors import ConditionMonitor, Monitor, State, Truth, begun, has_truth
from sim_action.assertions.monitors.combination import UNKNOWN, truths
from sim_action.assertions.monitors.goals import Goal
from sim_action.assertions.monitors.window import signals_of
from sim_action.core.records import dataclass, replace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.trace_channels import Channels
from sim_action.state.verdict import Signal, Verdict
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from sim_action.state.observation import Observation
    from sim_action.state.trace import Trace


class AtOnce(Several):
    """All assertions of a list are true at one moment.

    It is a goal. Each part is judged at each moment by itself: a goal such as `reach` is true while the robot is there,
    an invariant such as `upright` is true while it is not broken, `settled` while the robot is at rest, and a sensor's
    reading counts until the next one. An assertion that has no truth at a moment, such as `final_pose`, is refused.
    """

    key: ClassVar[str] = "at_once"

    @property
    @override
    def is_goal(self) -> bool:
        return True

    @property
    @override
    def has_truth(self) -> bool:
        return True

    @property
    @override
    def channels(self) -> Channels:
        return self.truth_channels

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield the problems of all parts, and parts that have no truth at a moment."""
        yield from super().problems(scene)
        for place, part in self.placed_parts:
            if not part.has_truth:
                yield place, f"'{part.key}' is not true or false at a moment; use all_of, or another assertion"

    def signals(
        self, scene: Scene, start: Observation, trace: Trace, after: float = 0.0, before: float = math.inf
    ) -> tuple[Signal, ...]:
        """Return the number of conditions that are true, and the signals of all parts."""
        counts = signals_of(self.monitor(scene, start), trace, after, before)
        return (*counts, *super().signals(scene, start, trace, after, before))

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        monitors = tuple(_condition(part, scene, start) for part in self.parts)
        return AtOnceMonitor(tuple(part.inner_title for part in self.parts), monitors, (UNKNOWN,) * len(monitors))


def _condition(part: Assertion, scene: Scene, start: Observation) -> ConditionMonitor:
    monitor = part.monitor(scene, start)
    assert has_truth(monitor), "other parts are refused"
    return monitor


@dataclass(frozen=True, slots=True)
class AtOnceMonitor:
    """The fold of the number of parts that are true at the same moment.

    Attributes:
        before: the truth of each part at the last step: 1, 0 or UNKNOWN.
        best: the fold of the number of true parts minus the number of parts.
        missing: the titles of the parts that were not true at the best step.
        end: sim time of the last step, in s.
    """

    is_momentary: ClassVar[bool] = False

    titles: tuple[str, ...]
    monitors: tuple[ConditionMonitor, ...]
    before: tuple[int, ...]
    best: Goal = Goal()
    missing: tuple[str, ...] = ()
    end: float = 0.0

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self.best.state

    def begin(self, trace: Trace) -> Self:
        """See CumulativeMonitor.begin."""
        if not len(trace):
            return self
        before = tuple(self._truths(trace)[:, -1].tolist())
        monitors = tuple(begun(monitor, trace) for monitor in self.monitors)
        return replace(self, before=before, monitors=monitors)

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if not len(trace):
            return self
        states = self._truths(trace)
        holds = states > 0
        best = self.best.observe(trace.time, (holds.sum(axis=0) - len(holds)).astype(float))
        missing = self.missing
        if best is not self.best:
            at_best = holds[:, int((trace.time == best.time).argmax())]
            missing = tuple(title for title, holds in zip(self.titles, at_best, strict=True) if not holds)
        return replace(
            self,
            monitors=tuple(monitor.observe(trace) for monitor in self.monitors),
            before=tuple(states[:, -1].tolist()),
            best=best,
            missing=missing,
            end=float(trace.time[-1]),
        )

    def truth(self, trace: Trace) -> Truth:
        """See ConditionMonitor.truth."""
        import numpy as np

        states = self._truths(trace)
        known = (states != UNKNOWN).all(axis=0)
        return Truth(trace.time[known], np.asarray((states > 0).all(axis=0))[known])

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See PlottableMonitor.signals. Returns the number of true conditions at each step."""
        count = (self._truths(trace) > 0).sum(axis=0).astype(float)
        return (Signal("conditions that are true", "", trace.time, count, lower=float(len(self.monitors))),)

    def _truths(self, trace: Trace) -> NDArray[np.int8]:
        return truths(self.monitors, trace, self.before)

    def verdict(self) -> Verdict:
        """Return the verdict. `measured` is the greatest number of parts that were true at one moment."""
        total, best = len(self.monitors), self.best
        if best.margin is None or best.time is None:
            return Verdict(False, None, float(total), None, "", None, "no physics step to measure")
        count, passed = total + round(best.margin), best.state is State.HOLDS
        message = (
            f"all {total} were true at {best.time:.2f} s"
            if passed
            else f"at most {count or 'none'} of {total} were true at the same moment in {self.end:.1f} s, first at "
            f"{best.time:.2f} s; not true then: {', '.join(self.missing)}"
        )
        return Verdict(passed, float(count), float(total), best.margin, "", best.time, message)

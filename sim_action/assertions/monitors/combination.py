"""The monitors of `any_of`, `all_of` and `not`: they judge the monitors of other assertions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Final, Self

from sim_action.assertions.monitors import (
    ConditionMonitor,
    Monitor,
    State,
    Truth,
    begun,
    has_truth,
    is_decided,
    is_sampled,
    needed_until,
    unmet_premises,
)
from sim_action.assertions.monitors.goals import joined, joined_by_any
from sim_action.assertions.monitors.window import counted
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.verdict import Judged, VerdictStatus

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Verdict


@dataclass(frozen=True)
class Combination:
    """The monitor of several assertions: all of them must hold (`every`), or at least one.

    The state is cached, because each level of nesting would otherwise double the work.

    Attributes:
        began: the state of each monitor before the first step.
        steps: the steps so far.
        before: the truth of each monitor at the last step, 1, 0 or UNKNOWN, if there is a sensor among them.
    """

    titles: tuple[str, ...]
    monitors: tuple[Monitor, ...]
    began: tuple[State, ...]
    every: bool
    steps: Judged = Judged()
    before: tuple[int, ...] = ()

    @classmethod
    def of(cls, titles: Iterable[str], monitors: tuple[Monitor, ...], *, every: bool) -> Self:
        """Return the monitor before the first step."""
        began = tuple(monitor.state for monitor in monitors)
        return cls(tuple(titles), monitors, began, every, before=(UNKNOWN,) * len(monitors))

    @cached_property
    def state(self) -> State:
        """See Monitor.state."""
        states = [monitor.state for monitor in self.monitors]
        return joined(*states) if self.every else joined_by_any(zip(states, self._decided, strict=True))

    @cached_property
    def is_decided(self) -> bool:
        """See DecidingMonitor.is_decided."""
        alone = State.BROKEN if self.every else State.HOLDS
        pairs = zip(self.monitors, self._decided, strict=True)
        return all(self._decided) or any(decided and monitor.state is alone for monitor, decided in pairs)

    @cached_property
    def needed_until(self) -> float:
        """See BoundedMonitor.needed_until."""
        if self.is_decided:
            return 0.0
        return needed_until(*(m for m, decided in zip(self.monitors, self._decided, strict=True) if not decided))

    @property
    def unmet_premises(self) -> tuple[str, ...]:
        """See ConditionalMonitor.unmet_premises."""
        return unmet_premises(*self.monitors)

    @cached_property
    def _decided(self) -> list[bool]:
        return [is_decided(monitor, began) for monitor, began in zip(self.monitors, self.began, strict=True)]

    def begin(self, trace: Trace) -> Self:
        """See CumulativeMonitor.begin."""
        monitors = tuple(begun(monitor, trace) for monitor in self.monitors)
        return replace(self, monitors=monitors, before=self._last_truths(trace))

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        monitors = tuple(monitor.observe(trace) for monitor in self.monitors)
        return replace(self, monitors=monitors, steps=counted(self.steps, trace), before=self._last_truths(trace))

    @cached_property
    def _remembers(self) -> bool:
        return all(map(has_truth, self.monitors)) and any(map(is_sampled, self.monitors))

    def _last_truths(self, trace: Trace) -> tuple[int, ...]:
        if not self._remembers or not len(trace):
            return self.before
        return tuple(self._truths(trace)[:, -1].tolist())

    def _truths(self, trace: Trace) -> NDArray[np.int8]:
        return truths([monitor for monitor in self.monitors if has_truth(monitor)], trace, self.before)

    def truth(self, trace: Trace) -> Truth:
        """See ConditionMonitor.truth. All parts, or at least one, are true at the same moment."""
        import numpy as np

        each = self._truths(trace)
        known = (each != UNKNOWN).all(axis=0)
        holds = np.asarray((each > 0).all(axis=0) if self.every else (each > 0).any(axis=0))
        return Truth(trace.time[known], holds[known])

    def verdict(self) -> Verdict:
        """Return the verdict of the deciding part, with a message about all parts."""
        verdicts = [monitor.verdict().counted(self.steps) for monitor in self.monitors]
        statuses = [verdict.status for verdict in verdicts]
        order = _WORST_FIRST if self.every else _WORST_FIRST[::-1]
        status = min(statuses, key=order.index)
        candidates = [n for n, one in enumerate(statuses) if one == status]
        index = _decisive(verdicts, candidates, least=self.every, last=self.every == (status == "passed"))
        message = f"{self._count(statuses.count('passed'))}; {self.titles[index]}: {verdicts[index].message}"
        return replace(verdicts[index], message=message)

    def _count(self, holding: int) -> str:
        total = len(self.monitors)
        return f"all {total} hold" if holding == total else f"{holding or 'none'} of {total} hold"


_WORST_FIRST: Final[tuple[VerdictStatus, ...]] = ("failed", "not_exercised", "passed")


UNKNOWN: Final = -1
"""The truth of a condition before its first moment, where 1 is true and 0 is false."""


def truths(monitors: Sequence[ConditionMonitor], trace: Trace, before: Sequence[int]) -> NDArray[np.int8]:
    """Return (P, T) the truth of each of P conditions at the steps of a trace: 1, 0 or UNKNOWN.

    `before`: (P,) the truth at the step before them. A reading of a sensor counts from the step after it on.
    """
    import numpy as np

    rows = []
    for monitor, last in zip(monitors, before, strict=True):
        truth = monitor.truth(trace)
        # A sensor is read at a step, before the robot moves on: the reading comes with the steps after it.
        until = trace.time + (-TIME_EPSILON_S if is_sampled(monitor) else TIME_EPSILON_S)
        rows.append(np.concatenate(([last], truth.holds)).astype(np.int8)[np.searchsorted(truth.time, until)])
    return np.array(rows)


def _decisive(verdicts: Sequence[Verdict], candidates: Sequence[int], *, least: bool, last: bool) -> int:
    """Return the index of the deciding verdict: by margin if the units agree, else by time."""
    margins = {n: margin for n in candidates if (margin := verdicts[n].margin) is not None}
    if len(margins) == len(candidates) and len({verdicts[n].unit for n in candidates}) == 1:
        return (min if least else max)(margins, key=margins.__getitem__)
    times = {n: time for n in candidates if (time := verdicts[n].time) is not None}
    return (max if last else min)(times, key=times.__getitem__) if times else candidates[0]


@dataclass(frozen=True)
class NegationMonitor:
    """The monitor of the inner assertion with the opposite result. The state is cached, as in Combination.

    Attributes:
        began: the state of the inner monitor before the first step.
        steps: the steps so far.
    """

    monitor: Monitor
    began: State
    steps: Judged = Judged()

    @cached_property
    def state(self) -> State:
        """See Monitor.state."""
        if self.monitor.state is State.BROKEN:
            return State.HOLDS
        if self.monitor.state is State.HOLDS and self.is_decided:
            return State.BROKEN
        return State.HOLDS if self.began is State.PENDING else State.PENDING

    @cached_property
    def is_decided(self) -> bool:
        """See DecidingMonitor.is_decided."""
        return is_decided(self.monitor, self.began)

    @property
    def is_sampled(self) -> bool:
        """See SampledMonitor.is_sampled."""
        return is_sampled(self.monitor)

    @cached_property
    def needed_until(self) -> float:
        """See BoundedMonitor.needed_until."""
        return 0.0 if self.is_decided else needed_until(self.monitor)

    def begin(self, trace: Trace) -> Self:
        """See CumulativeMonitor.begin."""
        return replace(self, monitor=begun(self.monitor, trace))

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        return replace(self, monitor=self.monitor.observe(trace), steps=counted(self.steps, trace))

    def truth(self, trace: Trace) -> Truth:
        """See ConditionMonitor.truth."""
        import numpy as np

        assert has_truth(self.monitor), "the assertion says so"
        truth = self.monitor.truth(trace)
        return Truth(truth.time, np.logical_not(truth.holds))

    def verdict(self) -> Verdict:
        """Return the verdict of the inner assertion with the opposite result."""
        verdict = self.monitor.verdict().counted(self.steps)
        if verdict.status == "not_exercised":
            return verdict
        message = f"{verdict.message}, but 'not' requires the opposite" if verdict.passed else verdict.message
        return replace(verdict.contrary(), message=message)

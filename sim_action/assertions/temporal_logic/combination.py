"""The algebra of conditions: all or any of several, at any time or at the same moment, and the contrary of one.

`any_of`, `all_of`, `at_once` and `not` judge the monitors of other assertions. The formulas of `stl` join their
parts by the same rules.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any, ClassVar, Final, Self

from typing_extensions import override

from sim_action.assertions.monitors import Fold, Monitor, State, Truth
from sim_action.assertions.monitors.bounds import Goal
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass, delegated, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.trace import Trace
from sim_action.state.verdict import Judged, Signal, Verdict, VerdictStatus


class Junction(Fold):
    """All of several folds must hold (`every`), or at least one. It is decided as early as they allow.

    All is cached, because each level of nesting would otherwise double the work.
    """

    every: bool

    @property
    @abstractmethod
    def folds(self) -> Sequence[Fold]:
        """The folds that are joined."""

    @cached_property
    def state(self) -> State:
        """See Fold.state. A fold that holds is enough for any of them only if it is decided: it may still break."""
        if not self.every and self._decisive in self._results:
            return State.HOLDS
        states = {state for state, _ in self._results}
        if State.BROKEN in states and (self.every or len(states) == 1):
            return State.BROKEN
        return State.PENDING if State.PENDING in states else State.HOLDS

    @cached_property
    @override
    def is_decided(self) -> bool:
        return self._decisive in self._results or all(decided for _, decided in self._results)

    @cached_property
    @override
    def needed_until(self) -> float:
        if self.is_decided:
            return 0.0
        pairs = zip(self.folds, self._results, strict=True)
        return max(fold.needed_until for fold, (_, decided) in pairs if not decided)

    @property
    def _decisive(self) -> tuple[State, bool]:
        return State.BROKEN if self.every else State.HOLDS, True

    @cached_property
    def _results(self) -> list[tuple[State, bool]]:
        return [(fold.state, fold.is_decided) for fold in self.folds]


UNKNOWN: Final = -1  # the truth of a condition before its first moment, where 1 is true and 0 is false


@dataclass(frozen=True)
class Parts(Monitor):
    """The monitors of several assertions."""

    titles: tuple[str, ...]
    monitors: tuple[Monitor, ...]
    # True if the truth of each at the last step is needed: a sensor's truth lasts until the next reading
    remembers: bool
    before: tuple[int, ...]  # these truths, 1, 0 or UNKNOWN

    @classmethod
    def of(cls, titles: Iterable[str], monitors: tuple[Monitor, ...], *, remembers: bool, **fields: Any) -> Self:
        """Return the monitor before the first step."""
        return cls(tuple(titles), monitors, remembers, (UNKNOWN,) * len(monitors), **fields)

    @property
    @override
    def leaves(self) -> tuple[Monitor, ...]:
        return tuple(leaf for monitor in self.monitors for leaf in monitor.leaves)

    @property
    @override
    def unmet_premises(self) -> tuple[str, ...]:
        return tuple(premise for monitor in self.monitors for premise in monitor.unmet_premises)

    @override
    def begin(self, trace: Trace) -> Self:
        monitors = tuple(monitor.begin(trace) for monitor in self.monitors)
        return replace(self, monitors=monitors, before=self._last_truths(trace))

    def _last_truths(self, trace: Trace) -> tuple[int, ...]:
        return tuple(self._truths(trace)[:, -1].tolist()) if self.remembers and len(trace) else self.before

    def _truths(self, trace: Trace) -> NDArray[np.int8]:
        """Return (P, T) the truth of parts at steps: 1, 0, UNKNOWN; a reading counts from the step after it on."""
        rows = []
        for monitor, last in zip(self.monitors, self.before, strict=True):
            truth = monitor.truth(trace)
            # A sensor is read at a step, before the robot moves on: the reading comes with the steps after it.
            until = trace.time + (-TIME_EPSILON_S if monitor.is_sampled else TIME_EPSILON_S)
            rows.append(np.concatenate(([last], truth.holds)).astype(np.int8)[np.searchsorted(truth.time, until)])
        return np.array(rows)


@dataclass(frozen=True)
class Combination(Junction, Parts):
    """The monitor of `any_of` and `all_of`. Its results are cached."""

    every: bool = True
    steps: Judged = Judged()  # the steps so far

    folds: ClassVar[Sequence[Fold]] = delegated("monitors")

    @override
    def observe(self, trace: Trace) -> Self:
        monitors = tuple(monitor.observe(trace) for monitor in self.monitors)
        return replace(
            self, monitors=monitors, steps=self.steps.followed_by(trace.time), before=self._last_truths(trace)
        )

    def truth(self, trace: Trace) -> Truth:
        """See Monitor.truth. At least one part is true; `all_of` has no truth, see `at_once`."""
        truths = self._truths(trace)
        decided = (truths != UNKNOWN).all(axis=0)
        return Truth(trace.time[decided], np.asarray((truths > 0).any(axis=0))[decided])

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


def _decisive(verdicts: Sequence[Verdict], candidates: Sequence[int], *, least: bool, last: bool) -> int:
    """Return the index of the deciding verdict: by margin if the units agree, else by time."""
    margins = {n: margin for n in candidates if (margin := verdicts[n].margin) is not None}
    if len(margins) == len(candidates) and len({verdicts[n].unit for n in candidates}) == 1:
        return (min if least else max)(margins, key=margins.__getitem__)
    times = {n: time for n in candidates if (time := verdicts[n].time) is not None}
    return (max if last else min)(times, key=times.__getitem__) if times else candidates[0]


@dataclass(frozen=True)
class AtOnceMonitor(Parts):
    """The fold of the number of parts that are true at the same moment."""

    is_goal = True

    best: Goal = Goal()  # the fold of the number of true parts minus the number of parts
    missing: tuple[str, ...] = ()  # the titles of the parts that were not true at the best step
    end: float = 0.0  # sim time of the last step, in s

    state: ClassVar[State] = delegated("best.state")

    @override
    def observe(self, trace: Trace) -> Self:
        if not len(trace):
            return self
        truths = self._truths(trace)
        holds = truths > 0
        best = self.best.observe(trace.time, (holds.sum(axis=0) - len(holds)).astype(float))
        missing = self.missing
        if best is not self.best:
            at_best = holds[:, int((trace.time == best.time).argmax())]
            missing = tuple(title for title, holds in zip(self.titles, at_best, strict=True) if not holds)
        return replace(
            self,
            monitors=tuple(monitor.observe(trace) for monitor in self.monitors),
            before=tuple(truths[:, -1].tolist()),
            best=best,
            missing=missing,
            end=float(trace.time[-1]),
        )

    @override
    def truth(self, trace: Trace) -> Truth:
        truths = self._truths(trace)
        decided = (truths != UNKNOWN).all(axis=0)
        return Truth(trace.time[decided], np.asarray((truths > 0).all(axis=0))[decided])

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns the number of true conditions at each step."""
        count = (self._truths(trace) > 0).sum(axis=0).astype(float)
        return (Signal("conditions that are true", "", trace.time, count, lower=float(len(self.monitors))),)

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


@dataclass(frozen=True)
class NegationMonitor(Monitor):
    """The monitor of the inner assertion with the opposite result. The state is cached, as in Junction."""

    monitor: Monitor
    began: State  # the state of the inner monitor before the first step
    steps: Judged = Judged()  # the steps so far

    @cached_property
    @override
    def state(self) -> State:
        if self.monitor.state is State.BROKEN:
            return State.HOLDS
        if self.monitor.state is State.HOLDS and self.is_decided:
            return State.BROKEN
        return State.HOLDS if self.began is State.PENDING else State.PENDING

    @cached_property
    @override
    def is_decided(self) -> bool:
        return self.monitor.is_decided

    leaves: ClassVar[tuple[Monitor, ...]] = delegated("monitor.leaves")
    is_sampled: ClassVar[bool] = delegated("monitor.is_sampled")

    @cached_property
    @override
    def needed_until(self) -> float:
        return 0.0 if self.is_decided else self.monitor.needed_until

    @override
    def begin(self, trace: Trace) -> Self:
        return replace(self, monitor=self.monitor.begin(trace))

    @override
    def observe(self, trace: Trace) -> Self:
        return replace(self, monitor=self.monitor.observe(trace), steps=self.steps.followed_by(trace.time))

    @override
    def truth(self, trace: Trace) -> Truth:
        truth = self.monitor.truth(trace)
        return Truth(truth.time, np.logical_not(truth.holds))

    def verdict(self) -> Verdict:
        """Return the verdict of the inner assertion with the opposite result."""
        verdict = self.monitor.verdict().counted(self.steps)
        if verdict.status == "not_exercised":
            return verdict
        message = f"{verdict.message}, but 'not' requires the opposite" if verdict.passed else verdict.message
        return replace(verdict.contrary(), message=message)

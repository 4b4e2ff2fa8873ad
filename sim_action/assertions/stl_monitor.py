"""The fold of a formula: its outermost operators are goals and invariants, what is inside of them looks ahead."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Protocol, Self

from sim_action import units
from sim_action.assertions import State
from sim_action.assertions.fold import joined, joined_by_any
from sim_action.temporal_logic.formula import (
    Always,
    And,
    Comparison,
    Eventually,
    Formula,
    Implies,
    Interval,
    Not,
    Or,
    Signal,
    horizon,
    signals,
    signals_of,
)
from sim_action.temporal_logic.robustness import Cause, cause, robustness
from sim_action.temporal_logic.samples import Samples
from sim_action.verdict import Verdict

if TYPE_CHECKING:
    from sim_action.trace import Trace

_AT_ONCE: Final = Interval(0.0, 0.0)
# What looks further ahead, in s, would be computed anew with each block over too many moments.
_MOST_LOOKAHEAD: Final = 60.0
_TIME_ROUNDING: Final = 1e-9


class Part(Protocol):
    """A formula at the first moment, as far as it is known."""

    @property
    def state(self) -> State:
        """See Monitor.state."""

    @property
    def is_decided(self) -> bool:
        """See Decisive.is_decided."""

    def observe(self, samples: Samples) -> Part:
        """After the moments that follow."""

    def outcome(self) -> tuple[float, Cause | None]:
        """Its robustness, if nothing more came, and what decides it; infinite if no moment counts."""


def opened(formula: Formula, *, contrary: bool = False) -> Part:
    """The fold of a formula, or of its contrary, before the first moment."""
    match formula:
        case Not():
            return opened(formula.formula, contrary=not contrary)
        case And() | Or():
            parts = tuple(opened(part, contrary=contrary) for part in formula.formulas)
            return Joined(parts, every=isinstance(formula, And) != contrary)
        case Implies():
            parts = (opened(formula.premise, contrary=not contrary), opened(formula.conclusion, contrary=contrary))
            return Joined(parts, every=contrary)
        case Always() | Eventually():
            inner = Not(formula.formula) if contrary else formula.formula
            return Extreme.of(inner, formula.interval, greatest=isinstance(formula, Eventually) != contrary)
        case _:
            return Extreme.of(Not(formula) if contrary else formula, _AT_ONCE, greatest=True)


@dataclass(frozen=True, slots=True)
class Joined:
    """All of several (`every`), or any of them."""

    parts: tuple[Part, ...]
    every: bool

    @property
    def state(self) -> State:
        """See Monitor.state."""
        if self.every:
            return joined(*(part.state for part in self.parts))
        return joined_by_any((part.state, part.is_decided) for part in self.parts)

    @property
    def is_decided(self) -> bool:
        """See Decisive.is_decided."""
        alone = State.BROKEN if self.every else State.HOLDS
        known = [part.state for part in self.parts if part.is_decided]
        return alone in known or len(known) == len(self.parts)

    def observe(self, samples: Samples) -> Joined:
        """See Part.observe."""
        return replace(self, parts=tuple(part.observe(samples) for part in self.parts))

    def outcome(self) -> tuple[float, Cause | None]:
        """See Part.outcome."""
        outcomes = [part.outcome() for part in self.parts]
        return (min if self.every else max)(outcomes, key=lambda outcome: outcome[0])


@dataclass(frozen=True, slots=True)
class Chain:
    """Samples, and those that came before them: to add to it copies nothing."""

    samples: Samples
    earlier: Chain | None = None

    def whole(self) -> Samples:
        """All samples in one piece."""
        pieces = [self.samples]
        link = self.earlier
        while link is not None:
            pieces.append(link.samples)
            link = link.earlier
        return Samples.concatenate(pieces[::-1])


@dataclass(frozen=True, slots=True)
class Found:
    """The least or the greatest robustness so far, and the samples from its moment on that it was computed from."""

    value: float
    samples: Samples


@dataclass(frozen=True, slots=True)
class Extreme:
    """The least robustness of a formula over an interval (`always`), or the greatest (`eventually`).

    Attributes:
        reach: s that the formula looks ahead; infinite if it is judged at the end of the run.
        begin: s of sim time, the first moment seen.
        open: samples from the first moment on whose future is not known yet.
        found: among the moments whose future is known.
        closed: whether all moments of the interval are such.
    """

    formula: Formula
    interval: Interval
    greatest: bool
    reach: float
    begin: float | None = None
    open: Chain | None = None
    found: Found | None = None
    closed: bool = False

    @classmethod
    def of(cls, formula: Formula, interval: Interval, *, greatest: bool) -> Self:
        """The fold before the first moment."""
        reach = horizon(formula)
        return cls(formula, interval, greatest, reach if reach <= _MOST_LOOKAHEAD else math.inf)

    @property
    def state(self) -> State:
        """See Monitor.state: what is judged at the end of the run is neither waited for nor broken before."""
        if self._is_settled:
            return State.HOLDS if self.greatest else State.BROKEN
        if not self.greatest or math.isinf(self.reach):
            return State.HOLDS
        return State.BROKEN if self.closed else State.PENDING

    @property
    def is_decided(self) -> bool:
        """See Decisive.is_decided."""
        return self.closed or self._is_settled

    @property
    def _is_settled(self) -> bool:
        """Whether one moment has settled it, whatever the others are."""
        return self.found is not None and (self.found.value >= 0) == self.greatest

    def observe(self, samples: Samples) -> Self:
        """See Part.observe."""
        if self.closed or not len(samples):
            return self
        begin = float(samples.time[0]) if self.begin is None else self.begin
        if math.isinf(self.reach):
            return replace(self, begin=begin, open=Chain(samples, self.open))
        later = replace(self, begin=begin)
        rows = samples if self.open is None else Samples.concatenate((self.open.samples, samples))
        known = float(rows.time[-1]) - self.reach
        end = int(rows.after(known))
        return replace(
            later,
            open=Chain(rows.between(end, len(rows))) if end < len(rows) else None,
            found=later._best(rows, end),  # noqa: SLF001 - its own
            closed=begin + self.interval.end <= known + _TIME_ROUNDING,
        )

    def outcome(self) -> tuple[float, Cause | None]:
        """See Part.outcome."""
        found = self.found
        if self.open is not None and not self.closed:
            rows = self.open.whole()
            found = self._best(rows, len(rows))
        if found is None:
            return -math.inf if self.greatest else math.inf, None
        return found.value, cause(self.formula, found.samples)

    def _best(self, rows: Samples, end: int) -> Found | None:
        """The extreme so far, or a better one among the rows before `end` that lie in the interval."""
        assert self.begin is not None
        first = int(rows.at_or_after(self.begin + self.interval.start))
        last = min(end, int(rows.after(self.begin + self.interval.end)))
        if first >= last:
            return self.found
        margins = robustness(self.formula, rows.between(first, len(rows)))[: last - first]
        index = int(margins.argmax() if self.greatest else margins.argmin())
        value = float(margins[index])
        if self.found is not None and not (value > self.found.value if self.greatest else value < self.found.value):
            return self.found
        return Found(value, self._from(rows, first + index))

    def _from(self, rows: Samples, index: int) -> Samples:
        end = len(rows) if math.isinf(self.reach) else int(rows.after(float(rows.time[index]) + self.reach))
        return rows.between(index, end)


@dataclass(frozen=True, slots=True)
class StlMonitor:
    """The fold of a whole formula.

    Attributes:
        units: of each comparison's margin, the SI symbol.
    """

    part: Part
    signals: tuple[Signal, ...]
    start_xy: tuple[float, float]
    units: Mapping[Comparison, str]
    seen: bool = False

    @classmethod
    def of(cls, formula: Formula, start_xy: tuple[float, float], comparison_units: Mapping[Comparison, str]) -> Self:
        """The fold before the first moment; `start_xy` in m is where travel counts from."""
        return cls(opened(formula), signals_of(formula), start_xy, comparison_units)

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self.part.state

    @property
    def is_decided(self) -> bool:
        """See Decisive.is_decided."""
        return self.part.is_decided

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if not len(trace):
            return self
        samples = Samples.of(trace, self.signals, self.start_xy)
        return replace(self, part=self.part.observe(samples), seen=True)

    def verdict(self) -> Verdict:
        """Measured and limit are the two sides of the comparison that decides; the margin is the robustness."""
        value, decisive = self.part.outcome() if self.seen else (-math.inf, None)
        passed = value >= 0
        if decisive is None:
            message = "the run ended before the interval that decides" if self.seen else "no moment to measure"
            return Verdict(passed, None, None, None, "", None, message)
        unit = self.units[decisive.comparison]
        measured, limit, message = _told(decisive, unit)
        cut = "" if passed or self.state is State.BROKEN else ", and the run was over"
        return Verdict(passed, measured, limit, value + 0.0, unit, decisive.time, f"{message}{cut}")


def _told(decisive: Cause, unit: str) -> tuple[float, float, str]:
    """What is measured, against what, and that in words; of two signals the difference is."""
    comparison = decisive.comparison
    left, right = units.display_apart(decisive.left, decisive.right, unit)
    when = f"at {decisive.time:.2f} s"
    if any(signals(comparison.right)):
        message = f"{comparison} decides: {left} and {right} {when}"
        return decisive.left - decisive.right, 0.0, message
    message = f"{comparison.left} {comparison.relation} {right} decides: {left} {when}"
    return decisive.left, decisive.right, message

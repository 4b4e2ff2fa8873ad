"""Compare the runs of a gate in two results: a sample that both have with the same draws is a pair.

With the same draws, the old and the new version meet the same conditions. The difference between the two runs of a pair
is the change of the version, so that fewer runs show it than two independent sets of samples would need.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, Literal

from sim_action.core.records import dataclass, replace
from sim_action.core.statistics import Interval, holm, mcnemar, paired_bootstrap, rate_change
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.results.weaker_checks import Pair, WeakerCheck, has_same_limit, paired_expectations, weaker_checks

LEVEL: Final = 0.05  # a change of a pass rate is significant if its p-value is below this level
CONFIDENCE: Final = 0.95  # the confidence of the interval of a change
MIN_PAIRS_OF_MARGIN: Final = 20  # with fewer pairs, the interval of a mean covers its true value too rarely

RunPair = tuple[Outcome | None, Outcome | None]
"""The old and the new run of one sample; one of them is None if only one of the results has it."""

_MIN_RELATIVE_LOSS: Final = 0.01  # as a fraction of the limit: a smaller loss of margin is ignored


@dataclass(frozen=True, slots=True)
class Rate:
    """The runs that passed, of those with a verdict."""

    passed: int
    runs: int

    @property
    def share(self) -> float:
        """The share of passed runs; 0 without runs."""
        return self.passed / self.runs if self.runs else 0.0

    @classmethod
    def of(cls, outcomes: Iterable[Outcome | None]) -> Rate:
        """Count the runs with a verdict."""
        statuses = [outcome.status for outcome in outcomes if outcome is not None and _is_judged(outcome)]
        return cls(statuses.count("passed"), len(statuses))


@dataclass(frozen=True, slots=True)
class RateChange:
    """The change of the pass rate over pairs."""

    old: Rate  # old, new: the rates in the pairs
    new: Rate
    worse: int  # the number of pairs that passed before and fail now
    better: int  # the number of pairs that failed before and pass now
    p: float  # the two-sided p-value of no change, adjusted for `tests`
    tests: int = 1  # the number of gates of the comparison that can show a change

    @property
    def interval(self) -> Interval:
        """The interval of the new rate minus the old one, for this gate alone."""
        return rate_change(self.worse, self.better, self.old.runs, CONFIDENCE)

    @property
    def direction(self) -> Literal["fell", "rose"] | None:
        """The direction of a significant change; None: no change was shown."""
        if self.p >= LEVEL:
            return None
        return "fell" if self.worse > self.better else "rose"


@dataclass(frozen=True, slots=True)
class MarginLoss:
    """A smaller mean margin of an expectation over pairs."""

    expectation: str
    unit: str
    pairs: int
    old: float  # old, new: the mean margins in `unit`
    new: float
    change: Interval  # the interval of the mean change, in `unit`
    confidence: float  # of the interval: together, the intervals of all expectations of the gate have `CONFIDENCE`


@dataclass(frozen=True, slots=True)
class GateComparison:
    """The comparison of the runs of one gate."""

    old: Rate  # old, new: the rates of all runs, also of those without a partner
    new: Rate
    pairs: int  # the number of runs with the same draws and a verdict in both results
    left_out: int  # the number of samples without a verdict, or without a result, before or now
    same_draws: bool  # False if the samples differ: nothing more is compared then
    rate: RateChange | None = None  # the change of the pass rate; None without pairs, or if the samples differ
    margins: tuple[MarginLoss, ...] = ()  # the mean margins that are smaller now
    # expectations of the runs that check less than before: the first one of each kind and name
    weaker: tuple[WeakerCheck, ...] = ()
    moved: int = 0  # the number of pairs with different digests on the same engine build

    @property
    def failed(self) -> bool:
        """Return True if the pass rate fell significantly."""
        return self.rate is not None and self.rate.direction == "fell"

    @property
    def warnings(self) -> int:
        """The number of warnings; `weaker` is not counted."""
        return (not self.same_draws) + len(self.margins)


def compare_gate(old: Outcome | None, new: Outcome, runs: Sequence[RunPair], margin: float) -> GateComparison:
    """Compare the runs of a gate.

    Args:
        old: the old outcome of the gate itself; None if it is new.
        new: its new outcome.
        runs: all samples of both results, paired by their names.
        margin: warn if the new mean margin is less than this fraction of the old one.
    """
    judged = [(before, now) for before, now in runs if before and now and _is_judged(before) and _is_judged(now)]
    pairs = [(before, now) for before, now in judged if (before.variation, before.seed) == (now.variation, now.seed)]
    lacking = [any(before is None for before, _ in runs), any(now is None for _, now in runs)]
    planned = {gate.statistics.planned if gate and gate.statistics else None for gate in (old, new)}
    # If both planned the same number of runs, runs that only one of them has were lost.
    is_same_plan = len(planned) == 1 and not all(lacking)
    same_draws = len(pairs) == len(judged) and (is_same_plan or not any(lacking))
    rates = Rate.of(before for before, _ in runs), Rate.of(now for _, now in runs)
    weaker = tuple(_weaker(pairs or judged, same_draws=same_draws))
    if not same_draws:
        return GateComparison(*rates, len(pairs), 0, same_draws=False, weaker=weaker)
    return GateComparison(
        *rates,
        len(pairs),
        len(runs) - len(pairs),
        same_draws=True,
        rate=_rate_change(pairs) if pairs else None,
        margins=tuple(_margin_losses(pairs, margin)),
        weaker=weaker,
        moved=sum(moves_differently(before, now) for before, now in pairs),
    )


def adjusted(gates: Sequence[GateComparison | None]) -> list[GateComparison | None]:
    """Return the comparisons with p-values that hold for all gates together (Holm).

    A gate with so few changed pairs that no result is significant cannot give a wrong report, and does not count.
    """
    places = [place for place, gate in enumerate(gates) if gate and gate.rate and _can_be_significant(gate.rate)]
    rates = {place: rate for place in places if (gate := gates[place]) and (rate := gate.rate)}
    comparisons = list(gates)
    for (place, rate), p in zip(rates.items(), holm([rate.p for rate in rates.values()]), strict=True):
        gate = gates[place]
        assert gate is not None, "it has a rate"
        comparisons[place] = replace(gate, rate=replace(rate, p=p, tests=len(rates)))
    return comparisons


def is_smaller_margin(old: float, new: float, pairs: Iterable[Pair], threshold: float) -> bool:
    """Return True if a margin is less than a fraction of the old one, and the loss matters against the limit."""
    scales = [_scale(*pair) for pair in pairs]
    return new < threshold * old and old - new >= _MIN_RELATIVE_LOSS * _mean(scales)


def _mean(values: Sequence[float]) -> float:
    return math.fsum(value / len(values) for value in values)


def moves_differently(old: Outcome, new: Outcome) -> bool:
    """Return True if the digests differ with the same seed on the same engine build."""
    made_alike = _made_with(old) == _made_with(new)
    return made_alike and None not in (old.digest, new.digest) and old.digest != new.digest


def _made_with(outcome: Outcome) -> tuple[int | None, str | None, str | None]:
    build = outcome.provenance.engine_build if outcome.provenance else None
    return outcome.seed, outcome.engine, build


def _scale(old: ExpectationOutcome, new: ExpectationOutcome) -> float:
    if new.verdict.limit:
        return abs(new.verdict.limit)
    return max(abs(one.verdict.measured or 0.0) for one in (old, new))


def _is_judged(outcome: Outcome) -> bool:
    return outcome.status in ("passed", "failed")


def _rate_change(pairs: Sequence[tuple[Outcome, Outcome]]) -> RateChange:
    passed = [(old.status == "passed", new.status == "passed") for old, new in pairs]
    worse, better = passed.count((True, False)), passed.count((False, True))
    old, new = (Rate.of(outcomes) for outcomes in zip(*pairs, strict=True))
    return RateChange(old, new, worse, better, mcnemar(worse, better))


def _can_be_significant(rate: RateChange) -> bool:
    return mcnemar(rate.worse + rate.better, 0) < LEVEL


def _weaker(pairs: Iterable[tuple[Outcome, Outcome]], *, same_draws: bool) -> Iterator[WeakerCheck]:
    """Yield the first weaker check of each kind and expectation; with other draws, limits may be drawn as well."""
    seen = set[tuple[str, str]]()
    for old, new in pairs:
        for weaker in weaker_checks(old, new, paired_expectations(old, new)):
            key = weaker.kind, weaker.old.name
            if key not in seen and (same_draws or weaker.kind != "limit"):
                seen.add(key)
                yield weaker


def _margin_losses(pairs: Iterable[tuple[Outcome, Outcome]], threshold: float) -> Iterator[MarginLoss]:
    """Yield the losses beyond the threshold that are significant: in exact repetitions, the smallest is."""
    by_place: dict[tuple[int, str, str], list[Pair]] = {}
    for old, new in pairs:
        places = {id(expected): place for place, expected in enumerate(new.expectations)}
        for one, now in paired_expectations(old, new):
            if is_same_quantity(one, now):
                by_place.setdefault((places[id(now)], now.assertion, now.verdict.unit), []).append((one, now))
    compared = [several for several in by_place.values() if len(several) >= MIN_PAIRS_OF_MARGIN]
    for several in compared:
        margins = [(one.verdict.margin or 0.0, now.verdict.margin or 0.0) for one, now in several]
        old_mean, new_mean = map(_mean, zip(*margins, strict=True))
        if old_mean <= 0 or not is_smaller_margin(old_mean, new_mean, several, threshold):
            continue
        confidence = 1.0 - (1.0 - CONFIDENCE) / len(compared)
        change = paired_bootstrap([after - before for before, after in margins], confidence)
        if change.high < 0:
            first = several[0][1]
            name = first.name if all(now.name == first.name for _, now in several) else first.assertion
            yield MarginLoss(name, first.verdict.unit, len(margins), old_mean, new_mean, change, confidence)


def is_same_quantity(old: ExpectationOutcome, new: ExpectationOutcome) -> bool:
    """Return True if both margins are known, of one moment if of goals, and comparable."""
    before, now = old.verdict, new.verdict
    if before.margin is None or now.margin is None or not math.isfinite(now.margin - before.margin):
        return False
    if before.unit != now.unit or any(one.goal or one.cut_off for one in (before, now)):
        return False
    # The margin to a new limit is another quantity, unless the user keeps the name.
    return old.name == new.name or has_same_limit(before, now)

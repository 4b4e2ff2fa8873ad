"""The statistics of gates and of paired comparisons: pure functions of counts and numbers.

First exact statements about a pass rate: tails of the binomial distribution, bounds of the rate, and numbers of runs;
then the comparison of pairs, bounds of a quantile, and the sequential test of two rates.

The bounds of a rate are by Clopper and Pearson (Biometrika 26, 1934), each on one side and with the whole confidence:
in at most a share of 1 - confidence of all gates does the lower bound lie above the true rate, or the upper bound below
it. `proves` and `refutes` decide by the tails; the bounds are the rates at which these two change.

All functions raise ValueError for a count, rate, share or confidence outside its range. A confidence is at least 50 %:
below it, the same runs could prove and refute a rate.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Sequence
from random import Random
from typing import TYPE_CHECKING, Final, Literal

from sim_action.core.records import dataclass

if TYPE_CHECKING:
    from statistics import NormalDist


MAX_RUNS: Final = 10_000  # the largest number of runs that `runs_for_power` considers
_NEGLIGIBLE: Final = 1e-20  # the share of a sum below which its falling terms are left out

_ROUNDING: Final = 1e-12
"""A tail within this relative distance of 1 - confidence equals it: 1/8 at 87.5 %, despite rounding errors."""


@dataclass(frozen=True, slots=True)
class Chances:
    """The probabilities of the three verdicts of a gate; their sum is 1."""

    passed: float
    failed: float
    inconclusive: float


def at_least(k: int, n: int, p: float) -> float:
    """Return P(X >= k) for X successes of n trials with probability p; relative error below 1e-12."""
    below, above = _sums(k, n, p)
    return above / (below + above)


def at_most(k: int, n: int, p: float) -> float:
    """Return P(X <= k) for X successes of n trials with probability p; relative error below 1e-12."""
    below, above = _sums(k + 1, n, p)
    return below / (below + above)


def proves(passes: int, runs: int, rate: float, confidence: float) -> bool:
    """Return True if the lower bound is at or above the rate, that is P(X >= passes | rate) <= 1 - confidence."""
    _check(runs, passes=passes, confidence=confidence)
    return rate == 0.0 or at_least(passes, runs, rate) <= (1.0 - confidence) * (1.0 + _ROUNDING)


def refutes(passes: int, runs: int, rate: float, confidence: float) -> bool:
    """Return True if the upper bound is below the rate, that is P(X <= passes | rate) < 1 - confidence."""
    _check(runs, passes=passes, confidence=confidence)
    return at_most(passes, runs, rate) < (1.0 - confidence) * (1.0 - _ROUNDING)


def lower_bound(passes: int, runs: int, confidence: float) -> float:
    """Return the lower bound of the pass rate: the largest rate that the runs prove; 0 without a pass."""
    _check(runs, passes=passes, confidence=confidence)
    return _largest(lambda rate: proves(passes, runs, rate, confidence))


def upper_bound(passes: int, runs: int, confidence: float) -> float:
    """Return the upper bound of the pass rate: the largest rate that the runs do not refute; 1 if all passed."""
    _check(runs, passes=passes, confidence=confidence)
    return _largest(lambda rate: not refutes(passes, runs, rate, confidence))


def passes_needed(runs: int, rate: float, confidence: float) -> int | None:
    """Return the least number of passes that proves the rate, or None if so few runs cannot."""
    _check(runs, rate=rate, confidence=confidence)
    least = first(0, runs + 1, lambda passes: proves(passes, runs, rate, confidence))
    return None if least > runs else least


def passes_refuting(runs: int, rate: float, confidence: float) -> int | None:
    """Return the largest number of passes that refutes the rate, or None if so few runs cannot."""
    _check(runs, rate=rate, confidence=confidence)
    least = first(0, runs, lambda passes: not refutes(passes, runs, rate, confidence))
    return least - 1 if least else None


def runs_needed(rate: float, confidence: float, failures: int = 0) -> int:
    """Return the least number of runs that proves the rate although so many fail; the rate is neither 0 nor 1."""
    if not 0.0 < rate < 1.0 or failures < 0:
        raise ValueError(f"no number of runs proves the rate {rate} with {failures} failures")
    enough = failures + 1
    while not proves(enough - failures, enough, rate, confidence):
        enough *= 2
    return first(failures + 1, enough, lambda runs: proves(runs - failures, runs, rate, confidence))


def chances(true_rate: float, runs: int, rate: float, confidence: float) -> Chances:
    """Return the verdicts that a robot of a true rate gets from a gate of so many runs."""
    _check(runs, rate=true_rate)
    least = passes_needed(runs, rate, confidence)
    most = passes_refuting(runs, rate, confidence)
    passed = 0.0 if least is None else at_least(least, runs, true_rate)
    failed = 0.0 if most is None else at_most(most, runs, true_rate)
    return Chances(passed, failed, max(0.0, 1.0 - passed - failed))


def runs_for_power(true_rate: float, rate: float, confidence: float, power: float) -> int | None:
    """Return the least number of runs at which a robot of a true rate passes with the probability `power`.

    The probability is a saw-tooth over the number of runs: it jumps when one more failure is allowed, and falls from
    there to the next jump. So a larger number can have a smaller probability. The result is always at a jump. None: no
    number up to `MAX_RUNS` has the power.
    """
    _check(0, rate=true_rate)
    if not 0.0 < power < 1.0:
        raise ValueError(f"a power lies between 0 and 1, and is neither: {power}")
    runs = runs_needed(rate, confidence)
    if true_rate == 0.0:
        return None
    limit = (1.0 - confidence) * (1.0 + _ROUNDING)
    claimed, true = _FewFailures(runs, rate), _FewFailures(runs, true_rate)
    while runs <= MAX_RUNS:
        if true.probability >= power:
            return runs
        claimed.allow_one()
        true.allow_one()
        while claimed.probability > limit:
            runs += 1
            claimed.run_one()
            true.run_one()
    return None


class _FewFailures:
    """The probability that at most so many runs fail, while runs and allowed failures grow by one at a time."""

    def __init__(self, runs: int, rate: float) -> None:
        self.probability = self._last = rate**runs
        self._runs, self._failures, self._rate = runs, 0, rate

    def run_one(self) -> None:
        self.probability -= (1.0 - self._rate) * self._last
        self._runs += 1
        self._last *= self._rate * self._runs / (self._runs - self._failures)

    def allow_one(self) -> None:
        self._failures += 1
        odds = (1.0 - self._rate) / self._rate
        self._last *= odds * (self._runs - self._failures + 1) / self._failures
        self.probability += self._last


def _sums(k: int, n: int, p: float) -> tuple[float, float]:
    """Return sums over i < k and over i >= k, in proportion to P(X < k) and P(X >= k).

    The terms start with 1 at the mode and fall on both sides, by the ratio of neighbours. So none overflows, and one
    that underflows belongs to a probability that is 0 as a float.
    """
    _check(n, rate=p)
    if k <= 0:
        return 0.0, 1.0
    if k > n:
        return 1.0, 0.0
    if p in (0.0, 1.0):
        return 1.0 - p, p
    mode = min(n, int((n + 1) * p))
    odds = p / (1.0 - p)
    below, above = 0.0, 0.0
    term, i = 1.0, mode
    while i <= n and term > 0.0:
        if i < k:
            below += term
        else:
            above += term
            if term < _NEGLIGIBLE * above:
                break
        term *= odds * (n - i) / (i + 1)
        i += 1
    term, i = mode / (odds * (n - mode + 1)), mode - 1
    while i >= 0 and term > 0.0:
        if i >= k:
            above += term
        else:
            below += term
            if term < _NEGLIGIBLE * below:
                break
        term *= i / (odds * (n - i + 1))
        i -= 1
    return below, above


def _largest(holds: Callable[[float], bool]) -> float:
    """Return the largest rate up to which a condition holds; it holds at 0."""
    if holds(1.0):
        return 1.0
    low, high = 0.0, 1.0
    while low < (middle := (low + high) / 2.0) < high:
        if holds(middle):
            low = middle
        else:
            high = middle
    return low


def first(low: int, high: int, holds: Callable[[int], bool]) -> int:
    """Return the least number from `low` from which on a condition holds, or `high` if it holds at none below."""
    while low < high:
        middle = (low + high) // 2
        if holds(middle):
            high = middle
        else:
            low = middle + 1
    return low


def _check(runs: int, *, passes: int = 0, rate: float = 0.0, confidence: float = 0.5) -> None:
    """Raise ValueError for an argument outside its range."""
    if not 0 <= passes <= runs:
        raise ValueError(f"{passes} passes of {runs} runs: a number of passes lies between 0 and the number of runs")
    if not 0.0 <= rate <= 1.0:
        raise ValueError(f"a rate lies between 0 and 1: {rate}")
    if not 0.5 <= confidence < 1.0:
        raise ValueError(f"a confidence is at least 0.5 and below 1: {confidence}")


RESAMPLES: Final = 10_000


@dataclass(frozen=True, slots=True)
class Interval:
    """An interval with both ends."""

    low: float
    high: float


def mcnemar(worse: int, better: int) -> float:
    """Return the two-sided p-value of no change of the pass rate.

    `worse`: the number of pairs that passed with the old version and not with the new one; `better`: the number of
    pairs that passed with the new version and not with the old one.
    """
    if min(worse, better) < 0:
        raise ValueError(f"{worse} worse and {better} better pairs: neither number is negative")
    return min(1.0, 2.0 * at_most(min(worse, better), worse + better, 0.5))


def holm(p_values: Sequence[float]) -> list[float]:
    """Return the p-values of several tests, adjusted by Holm's method (Scandinavian Journal of Statistics 6, 1979).

    If each adjusted value is compared with one level, the chance of any wrong report is at most this level, however the
    tests depend on each other.
    """
    adjusted = [0.0] * len(p_values)
    most = 0.0
    for rank, place in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        most = max(most, min(1.0, (len(p_values) - rank) * p_values[place]))
        adjusted[place] = most
    return adjusted


def rate_change(worse: int, better: int, pairs: int, confidence: float) -> Interval:
    """Return the interval of the new pass rate minus the old one; `worse` and `better` as for `mcnemar`."""
    if min(worse, better) < 0 or worse + better > pairs or pairs < 1:
        raise ValueError(f"{worse} worse and {better} better pairs are not part of {pairs} pairs")
    # One more pair of each kind.
    share_worse, share_better = (worse + 1) / (pairs + 2), (better + 1) / (pairs + 2)
    change = share_better - share_worse
    half = _upper_normal(confidence) * math.sqrt((share_worse + share_better - change**2) / (pairs + 2))
    return Interval(max(-1.0, change - half), min(1.0, change + half))


def paired_bootstrap(differences: Sequence[float], confidence: float, seed: int = 0) -> Interval:
    """Return the interval of the mean of two or more differences; the seed of the resamples is fixed."""
    stated = list(map(float, differences))
    if len(stated) < 2 or not all(map(math.isfinite, stated)):
        raise ValueError(f"an interval needs at least two differences, and finite ones: {len(stated)} are given")
    z = _upper_normal(confidence)
    if min(stated) == max(stated):
        return Interval(stated[0], stated[0])
    # A power of 2 changes no digit, and the powers of values up to 1 stay in the range of floats.
    exponent = math.frexp(max(map(abs, stated)))[1]
    values = [math.ldexp(value, -exponent) for value in stated]
    mean = math.fsum(values) / len(values)
    # Plain Python: `sim-action compare` runs where numpy is not installed.
    choices, size = Random(seed).choices, len(values)
    means = sorted(sum(choices(values, k=size)) / size for _ in range(RESAMPLES))
    # Means that are equal but for rounding count half: differences with few distinct values have many of them.
    slack = 1e-12 * max(map(abs, values))
    share = (bisect_left(means, mean - slack) + bisect_right(means, mean + slack)) / (2.0 * len(means))
    bias = _normal().inv_cdf(min(max(share, 0.5 / RESAMPLES), 1.0 - 0.5 / RESAMPLES))
    deviations = [value - mean for value in values]
    cubes, squares = (math.fsum(deviation**power for deviation in deviations) for power in (3, 2))
    acceleration = cubes / (6.0 * squares**1.5)
    low, high = (_corrected(side, bias, acceleration) for side in (-z, z))
    return Interval(*(_restored(_quantile(means, share), exponent, values) for share in (low, high)))


def _restored(mean: float, exponent: int, values: Sequence[float]) -> float:
    # Its rounding may not leave the range of floats.
    return math.ldexp(min(max(mean, min(values)), max(values)), exponent)


def _quantile(ascending: Sequence[float], share: float) -> float:
    place = share * (len(ascending) - 1)
    below = min(int(place), len(ascending) - 2)
    return ascending[below] + (place - below) * (ascending[below + 1] - ascending[below])


def _corrected(side: float, bias: float, acceleration: float) -> float:
    shifted = bias + side
    return _normal().cdf(bias + shifted / (1.0 - acceleration * shifted))


def _upper_normal(confidence: float) -> float:
    if not 0.5 <= confidence < 1.0:
        raise ValueError(f"a confidence is at least 0.5 and below 1: {confidence}")
    return _normal().inv_cdf((1.0 + confidence) / 2.0)


def _normal() -> NormalDist:
    # Only comparisons need it, and it costs each run milliseconds.
    from statistics import NormalDist

    return NormalDist()


Claim = Literal["at_least", "at_most"]
"""The direction of a claim about a quantile: its lower bound proves "at_least", its upper bound "at_most"."""


@dataclass(frozen=True, slots=True)
class QuantileBounds:
    """The lower and the upper bound of a quantile, each with the whole confidence; None: it has none.

    They assume nothing about the distribution (order statistics: Thompson 1936; David 1981). X_(1) <= ... <= X_(n) are
    the sorted values of n independent runs, and x is a q-quantile: at most a share q of the distribution lies below x,
    and at least a share q at or below it.

    - X_(r) <= x holds if at least r values are at or below x. Their number is binomial with a probability of at least
      q. So X_(r) <= x is at least as probable as r or more successes with the probability q.
    - x <= X_(r) holds if fewer than r values are below x. Their number is binomial with a probability of at most q. So
      x <= X_(r) is at least as probable as fewer than r successes with the probability q.

    Both are equalities if the distribution is continuous at x. Ties and atoms make the bounds more careful, never
    wrong.
    """

    lower: float | None
    upper: float | None


def lower_rank(n: int, q: float, confidence: float) -> int | None:
    """Return the largest r, from 1, with X_(r) <= q-quantile at the confidence; None if n values have none."""
    # The mirrored values have the quantile 1 - q, and the mirrored rank.
    mirrored = upper_rank(n, 1.0 - q, confidence)
    return None if mirrored is None else n + 1 - mirrored


def upper_rank(n: int, q: float, confidence: float) -> int | None:
    """Return the least r, from 1, with q-quantile <= X_(r) at the confidence; None if n values have none."""
    _check_quantile(q)
    # The least r for which r or more values below the quantile are no likelier than 1 - confidence.
    return passes_needed(n, q, confidence)


def quantile_bounds(values: Iterable[float], q: float, confidence: float, missing: int = 0) -> QuantileBounds:
    """Return both bounds of the q-quantile of the distribution that the values were drawn from.

    Args:
        values: one number of each run, in any order; none is NaN.
        q: the share of the distribution below the quantile, 0.05 for the 5 % quantile.
        confidence: the confidence of each bound.
        missing: the number of further runs without a value. They count against each bound: as the least values of all
            for the lower one, and as the greatest for the upper one.
    """
    ordered = sorted(values)
    n = len(ordered) + missing
    low = lower_rank(n, q, confidence)
    high = upper_rank(n, q, confidence)
    return QuantileBounds(
        lower=None if low is None or low <= missing else ordered[low - missing - 1],
        upper=None if high is None or high > len(ordered) else ordered[high - 1],
    )


def runs_needed_for_quantile(q: float, confidence: float, claim: Claim) -> int:
    """Return the least number of runs at which the bound of the q-quantile exists: it is then the worst run."""
    _check_quantile(q)
    return runs_needed(1.0 - q if claim == "at_least" else q, confidence)


def _check_quantile(q: float) -> None:
    if not 0.0 < q < 1.0:
        raise ValueError(f"a quantile lies between 0 and 1, and is neither: {q}")


_NEARLY_WHOLE: Final = 1e-9  # a boundary so close to a whole number of passes is that number
SequentialVerdict = Literal["accepted", "rejected"]


@dataclass(frozen=True, slots=True)
class Decision:
    """The verdict of a test and the number of results up to it; None: they decide nothing."""

    verdict: SequentialVerdict | None
    runs: int


@dataclass(frozen=True, slots=True)
class Expected:
    """The probabilities of the verdicts for a robot of a true rate, and its mean number of runs."""

    accepted: float
    rejected: float
    undecided: float
    mean_runs: float


@dataclass(frozen=True, slots=True)
class SequentialTest:
    """The truncated sequential probability ratio test of two pass rates, of at most so many runs. Raises ValueError.

    It looks at results in their order and stops at the first verdict (Wald, Annals of Mathematical Statistics 16,
    1945). It decides between two stated rates, `accept` against `reject`, and says nothing about rates between them.
    Both error rates are 1 - confidence: Wald's boundaries keep their sum within 2 (1 - confidence), and each within
    (1 - confidence) / confidence. Stopping at the last run adds no error, because the verdict is then open. `exact` has
    the exact figures.
    """

    reject: float
    accept: float
    confidence: float
    most: int

    def __post_init__(self) -> None:
        if not 0.0 < self.reject < self.accept < 1.0:
            raise ValueError(f"the rates {self.reject} and {self.accept} must grow and lie between 0 and 1")
        if not 0.5 < self.confidence < 1.0:
            raise ValueError(f"a confidence lies above 0.5 and below 1: {self.confidence}")
        if self.most < 1:
            raise ValueError(f"a test needs at least one run, not {self.most}")

    def boundaries(self, runs: int) -> tuple[int | None, int | None]:
        """Return the most passes that reject after so many runs, and the least that accept; None: none can."""
        # The logarithm of the likelihood ratio grows by `gain` with a pass and falls by `loss` with another result.
        gain = math.log(self.accept / self.reject)
        loss = math.log((1.0 - self.reject) / (1.0 - self.accept))
        limit = math.log(self.confidence / (1.0 - self.confidence))
        greatest = math.floor((runs * loss - limit) / (gain + loss) + _NEARLY_WHOLE)
        least = math.ceil((runs * loss + limit) / (gain + loss) - _NEARLY_WHOLE)
        return (None if greatest < 0 else greatest), (None if least > runs else least)

    def decision(self, results: Iterable[bool | None]) -> Decision:
        """Look at results in their order up to the first verdict, or to the last run.

        None is a run without a verdict: it counts as not passed for `accept`, and as passed against `reject`.
        """
        seen = SeenResults(self)
        for result in results:
            seen.add(result)
            if seen.verdict is not None or seen.runs == self.most:
                break
        return Decision(seen.verdict, seen.runs)

    def exact(self, true_rate: float) -> Expected:
        """Return the exact probabilities of the verdicts, over runs and passes. Raise ValueError for a bad rate."""
        if not 0.0 <= true_rate <= 1.0:
            raise ValueError(f"a rate lies between 0 and 1: {true_rate}")
        accepted = rejected = mean_runs = 0.0
        # passes -> probability that the test is still open with so many
        open_with = {0: 1.0}
        for runs in range(1, self.most + 1):
            mean_runs += math.fsum(open_with.values())
            after: dict[int, float] = {}
            # The passes ascend.
            for passes, probability in open_with.items():
                after[passes] = after.get(passes, 0.0) + probability * (1.0 - true_rate)
                after[passes + 1] = probability * true_rate
            greatest, least = self.boundaries(runs)
            if least is not None:
                accepted += math.fsum(after.pop(passes) for passes in list(after) if passes >= least)
            if greatest is not None:
                rejected += math.fsum(after.pop(passes) for passes in list(after) if passes <= greatest)
            open_with = after
        return Expected(accepted, rejected, math.fsum(open_with.values()), mean_runs)


class SeenResults:
    """The results that a test has seen, one after the other.

    `runs`: their number; `verdict`: the verdict of the test, after which it looks at nothing; None: it is open.
    """

    def __init__(self, test: SequentialTest) -> None:
        self.runs = 0
        self.verdict: SequentialVerdict | None = None
        self._test = test
        self._passes = self._not_failed = 0

    def add(self, result: bool | None) -> None:
        """Look at the next result; see `SequentialTest.decision`."""
        self.runs += 1
        self._passes += result is True
        self._not_failed += result is not False
        greatest, least = self._test.boundaries(self.runs)
        if least is not None and self._passes >= least:
            self.verdict = "accepted"
        elif greatest is not None and self._not_failed <= greatest:
            self.verdict = "rejected"

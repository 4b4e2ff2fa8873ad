"""Exact statements about a pass rate: tails of the binomial distribution, bounds of the rate, and numbers of runs.

The bounds are those of Clopper and Pearson (Biometrika 26, 1934), each on one side and with the whole confidence: in at
most a share of 1 - confidence of all gates does the lower bound lie above the true rate, or the upper bound below it.
`proves` and `refutes` decide by the tails; the bounds are the rates at which these two change.

All functions raise ValueError for a count, rate or confidence outside its range. A confidence is at least 50 %: below
it, the same runs could prove and refute a rate.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from sim_action.core.records import dataclass

MAX_RUNS: Final = 10_000
"""The largest number of runs that `runs_for_power` considers."""

_NEGLIGIBLE: Final = 1e-20
"""The share of a sum below which its falling terms are left out."""

_ROUNDING: Final = 1e-12
"""A tail within this relative distance of 1 - confidence equals it: 1/8 at 87.5 %, whatever the rounding errors."""


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
    least = _first(0, runs + 1, lambda passes: proves(passes, runs, rate, confidence))
    return None if least > runs else least


def passes_refuting(runs: int, rate: float, confidence: float) -> int | None:
    """Return the largest number of passes that refutes the rate, or None if so few runs cannot."""
    _check(runs, rate=rate, confidence=confidence)
    least = _first(0, runs, lambda passes: not refutes(passes, runs, rate, confidence))
    return least - 1 if least else None


def runs_needed(rate: float, confidence: float, failures: int = 0) -> int:
    """Return the least number of runs that proves the rate although so many fail; the rate is neither 0 nor 1."""
    if not 0.0 < rate < 1.0 or failures < 0:
        raise ValueError(f"no number of runs proves the rate {rate} with {failures} failures")
    enough = failures + 1
    while not proves(enough - failures, enough, rate, confidence):
        enough *= 2
    return _first(failures + 1, enough, lambda runs: proves(runs - failures, runs, rate, confidence))


def chances(true_rate: float, runs: int, rate: float, confidence: float) -> Chances:
    """Return the verdicts that a robot of a true rate gets from a gate of so many runs."""
    _check(runs, rate=true_rate)
    least, most = passes_needed(runs, rate, confidence), passes_refuting(runs, rate, confidence)
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


def _first(low: int, high: int, holds: Callable[[int], bool]) -> int:
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

"""The truncated sequential probability ratio test of two pass rates (Wald, Annals of Mathematical Statistics 16, 1945).

It looks at results in their order and stops at the first verdict. It decides between two stated rates, `accept` against
`reject`, and says nothing about rates between them. Both error rates are 1 - confidence: Wald's boundaries keep their
sum within 2 (1 - confidence), and each within (1 - confidence) / confidence. Stopping at the last run adds no error,
because the verdict is then open. `SequentialTest.exact` has the exact figures.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final, Literal

from sim_action.core.records import dataclass

_ROUNDING: Final = 1e-9  # a boundary so close to a whole number of passes is that number
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
    """A test of the pass rate `accept` against `reject`, of at most so many runs. Raises ValueError."""

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
        greatest = math.floor((runs * loss - limit) / (gain + loss) + _ROUNDING)
        least = math.ceil((runs * loss + limit) / (gain + loss) - _ROUNDING)
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

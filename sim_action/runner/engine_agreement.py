"""The agreement of engines on a scenario: the distance between their robots at equal times, and their verdicts.

The comparisons are added to the expectations of the last outcome that has a verdict.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from sim_action.core import units
from sim_action.results.artifacts import stored_file
from sim_action.results.outcome import ExpectationOutcome, Outcome, status_of
from sim_action.scenario.model import Agreement, LoadedScenario
from sim_action.state.trace import FloatArray, Trace
from sim_action.state.trace_storage import TraceError, load_trace
from sim_action.state.verdict import Judged, Verdict, VerdictStatus

_KEY: Final = "agreement"
# In s of sim time: equal moments differ by rounding only.
_SAME_TIME_S: Final = 1e-9
_WORDS: Final[dict[VerdictStatus, str]] = {
    "passed": "passes",
    "not_exercised": "is not exercised",
    "failed": "fails",
}
"""The statuses of a verdict as verbs, the best first."""


def with_agreement(loaded: LoadedScenario, outcomes: tuple[Outcome, ...], folder: Path) -> tuple[Outcome, ...]:
    """Return the outcomes of one scenario in several engines; the last one with a verdict gets the comparisons.

    `folder`: the folder of the results; traces are named relative to it.
    """
    if len(outcomes) == 1:
        return (_alone(outcomes[0]),) if loaded.scenario.agreement else outcomes
    judged = [outcome for outcome in outcomes if outcome.has_verdict]
    if not judged or any(outcome.status == "skipped" for outcome in outcomes):
        return outcomes
    last = judged[-1]
    others = [outcome for outcome in outcomes if outcome is not last]
    expectations = tuple(
        expectation for other in others for expectation in _Comparison(loaded, other, last, folder).expectations()
    )
    all_expectations = (*last.expectations, *expectations)
    told = last.model_copy(update={"expectations": all_expectations, "status": status_of(all_expectations)})
    return tuple(told if outcome is last else outcome for outcome in outcomes)


def _alone(outcome: Outcome) -> Outcome:
    """Return the outcome with a note: agreement needs several engines, but the command line selects one."""
    note = "agreement was not judged: the command line selects one engine"
    return outcome.model_copy(update={"notes": (*outcome.notes, note)})


@dataclass(frozen=True, slots=True)
class _Apart:
    """The differences of two engines in one quantity, (T,) over (T,) s of sim time.

    Attributes:
        what: the name of the quantity, such as "position".
        measurement: the name of the difference, without the engine's name.
    """

    what: str
    measurement: str
    unit: str
    limit: float | None
    time: FloatArray
    difference: FloatArray


@dataclass(frozen=True, slots=True)
class _Comparison:
    """A comparison of one outcome, `last`, with that of another engine."""

    loaded: LoadedScenario
    other: Outcome
    last: Outcome
    folder: Path

    def expectations(self) -> Iterator[ExpectationOutcome]:
        """Yield the comparisons of verdicts and of positions."""
        yield self._expectation(f"the same verdicts as {self._engine}", self._verdicts())
        apart = tuple(self._apart())
        for difference in apart:
            yield self._expectation(self._name(difference), self._verdict(difference))
        if not apart and self._asked and self.other.has_verdict:
            message = f"never checked: the run has no moment in common with that of {self._engine}; look at both traces"
            verdict = Verdict(False, message=message, judged=Judged())
            yield self._expectation(f"the same position as {self._engine}", verdict)

    @property
    def _asked(self) -> Agreement | None:
        return self.loaded.scenario.agreement

    @property
    def _engine(self) -> str:
        """The engine of the other outcome, also if that ended before it could name it."""
        return self.other.engine or self.other.name.rpartition("[")[2].rstrip("]")

    def _name(self, apart: _Apart) -> str:
        """Return the name: "the same ..." with a limit; else a measurement, because nothing was judged."""
        if apart.limit is not None:
            return f"the same {apart.what} as {self._engine}"
        return f"{apart.measurement} {self._engine}"

    def _expectation(self, name: str, verdict: Verdict) -> ExpectationOutcome:
        return ExpectationOutcome(
            name=name,
            assertion=_KEY,
            severity="warning" if self._asked is None else "error",
            location=self.loaded.document.location((_KEY,)),
            verdict=verdict,
            unexercised=self.loaded.scenario.unexercised or "error",
        )

    def _verdicts(self) -> Verdict:
        different = list(self._different_verdicts())
        message = "; ".join(different) or f"judged as in {self._engine}"
        return Verdict(not different, None, None, None, "", None, message)

    def _different_verdicts(self) -> Iterator[str]:
        if not self.other.has_verdict:
            yield f"{self._engine} gave no verdict"
            return
        for ours, theirs in zip(self.last.expectations, self.other.expectations, strict=True):
            found = [(ours.verdict.status, self.last.engine), (theirs.verdict.status, self.other.engine)]
            better, worse = sorted(found, key=lambda each: tuple(_WORDS).index(each[0]))
            if better[0] != worse[0]:
                yield f"'{ours.name}' {_WORDS[better[0]]} in {better[1]} and {_WORDS[worse[0]]} in {worse[1]}"

    def _apart(self) -> Iterator[_Apart]:
        ours, theirs = self._trace(self.last), self._trace(self.other)
        if not ours or not theirs:
            return
        ours, theirs = at_the_same_times(ours, theirs)
        # A script can write anything into its trace.
        if not len(ours) or not np.isfinite((ours.state[:, 1:8], theirs.state[:, 1:8])).all():
            return
        position = np.sqrt(np.square(ours.base_position_xyz - theirs.base_position_xyz).sum(axis=1))
        limits = (None, None) if self._asked is None else (self._asked.position, self._asked.yaw)
        yield _Apart("position", "distance to", "m", limits[0], ours.time, position)
        yield _Apart("yaw", "difference in yaw to", "rad", limits[1], ours.time, ours.yaw_error_to(theirs.yaw))

    def _trace(self, outcome: Outcome) -> Trace | None:
        path = stored_file(self.folder, outcome.trace) if outcome.trace else None
        try:
            return None if path is None else load_trace(path)
        except TraceError:
            return None

    def _verdict(self, apart: _Apart) -> Verdict:
        """Return the verdict at the moment of the largest difference."""
        worst = int(apart.difference.argmax())
        measured, time = float(apart.difference[worst]), float(apart.time[worst])
        margin = None if apart.limit is None else apart.limit - measured
        judged = Judged(len(apart.time), float(apart.time[0]), float(apart.time[-1]))
        message = f"{apart.what} differs from {self._engine} by at most {units.display(measured, apart.unit)}"
        message += f", at {time:.2f} s"
        if apart.limit is not None:
            message += f"; allowed: {units.display(apart.limit, apart.unit)}"
        held = margin is None or margin >= 0
        return Verdict(held, measured, apart.limit, margin, apart.unit, time, message, judged=judged)


def at_the_same_times(first: Trace, second: Trace) -> tuple[Trace, Trace]:
    """Return the moments that both traces have; both start at 0, and one may end earlier."""
    indices = np.searchsorted(second.time, first.time - _SAME_TIME_S)
    inside = np.minimum(indices, len(second) - 1)
    same = np.abs(second.time[inside] - first.time) <= _SAME_TIME_S
    return first.rows(np.flatnonzero(same)), second.rows(inside[same])

"""The option `run --repeat N`: it compares all runs of one scenario, and finds the first difference.

Two runs are equal if all states are equal, bit by bit, and all verdicts are equal.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from sim_action.core.errors import ExitCode
from sim_action.core.records import dataclass
from sim_action.results.artifacts import stored_file
from sim_action.results.outcome import Failure, Outcome, Repeats
from sim_action.scenario.model import LoadedScenario
from sim_action.state.reproducibility import Divergence, first_divergence
from sim_action.state.trace import Trace
from sim_action.state.trace_storage import TraceError, load_trace
from sim_action.state.verdict import Verdict

_CAUSES: Final = (
    "look in its code for the wall clock, for a random generator without a fixed seed, for the order of a set or of "
    "hashes and ids, for threads and processes that it does not wait for, and for files that an earlier run has left"
)
_NO_CODE: Final = (
    "the scenario runs none of your code, so this is a bug of sim-action: please report it, with the engine and CPU"
)


def merge_repeats(loaded: LoadedScenario, outcomes: Sequence[Outcome], folder: Path) -> Outcome:
    """Return one outcome for all runs of a scenario, in their order; a flaky scenario has no verdict.

    `folder`: the folder of the results; traces are named relative to it; of equal runs, one trace is kept.
    """
    if len(outcomes) == 1:
        return outcomes[0]
    # An interruption or an internal error says nothing about the repeatability of the scenario.
    ours = next((one for one in outcomes if one.exit_code in (ExitCode.INTERRUPTED, ExitCode.INTERNAL)), None)
    runs = [_Run(number, one) for number, one in enumerate(outcomes, start=1) if one.status != "skipped"]
    if ours is not None or not runs:
        told, kept = ours or outcomes[0], [ours or outcomes[0]]
    else:
        told, kept = _told(loaded, runs, folder)
    _remove(folder, [one for one in outcomes if all(one is not other for other in kept)])
    if len(runs) < len(outcomes) and told.status == "passed":
        note = f"run {len(runs)} of {len(outcomes)} times: another scenario did not pass (--fail-fast)"
        return told.model_copy(update={"status": "skipped", "expectations": (), "notes": (note,)})
    return told


@dataclass(frozen=True, slots=True)
class _Run:
    """One of the runs, counted from 1."""

    number: int
    outcome: Outcome

    @property
    def key(self) -> Hashable:
        """A value that is equal for identical runs; messages are left out: they may hold addresses or times of day."""
        outcome = self.outcome
        reasons = tuple((failure.kind, failure.title, failure.location) for failure in outcome.failures)
        verdicts = tuple(expected.model_dump_json() for expected in outcome.expectations)
        return (outcome.status, outcome.digest, reasons, verdicts)

    @property
    def ending(self) -> str:
        """The result in words, such as "run 3 failed (travelled 1.2 m of 1.5 m)"."""
        return f"run {self.number} {self.outcome.ending}"


def _told(loaded: LoadedScenario, runs: Sequence[_Run], folder: Path) -> tuple[Outcome, list[Outcome]]:
    """Return the outcome for all runs, and the runs whose traces are kept."""
    alike: dict[Hashable, list[_Run]] = {}
    for run in runs:
        alike.setdefault(run.key, []).append(run)
    most, *others = sorted(alike.values(), key=lambda group: (-len(group), group[0].number))
    digests = {run.outcome.digest for run in runs} - {None}
    other = min((group[0] for group in others), key=lambda run: run.number, default=None)
    replay = None if other is None else other.outcome.replay
    about = {
        "repeats": Repeats(count=len(runs), agreed=len(most), digests=len(digests), replay=replay)
        if len(runs) > 1
        else None,
        "wall_time": sum(run.outcome.wall_time for run in runs),
    }
    first = most[0]
    if other is None:
        return first.outcome.model_copy(update=about), [first.outcome]
    parted = _parting(first, other, folder)
    message = "; ".join(
        (
            f"{len(most) if len(most) > 1 else 'none'} of {len(runs)} runs agree",
            *_differences(first, other, parted),
            _CAUSES if loaded.scenario.runs_user_code else _NO_CODE,
        )
    )
    failure = Failure(kind="flaky", title="flaky", message=message, time=parted.time if parted else None)
    note = f"the trace of run {first.number} is stored here, the trace of run {other.number} in {other.outcome.trace}"
    flaky = {"status": "flaky", "failures": (failure,), "expectations": (), "notes": (*first.outcome.notes, note)}
    return first.outcome.model_copy(update=about | flaky), [first.outcome, other.outcome]


def _parting(first: _Run, other: _Run, folder: Path) -> Divergence | None:
    """Return the first difference, or None if the traces show none."""
    ours, theirs = _trace(first.outcome, folder), _trace(other.outcome, folder)
    with suppress(ValueError):
        return None if ours is None or theirs is None else first_divergence(ours, theirs)
    return None


def _differences(first: _Run, other: _Run, parted: Divergence | None) -> Iterator[str]:
    """Yield the differences between two runs."""
    if parted is not None:
        yield f"run {other.number} differs from run {first.number} {_where(parted)}"
    elif first.outcome.trace and other.outcome.trace and first.outcome.digest != other.outcome.digest:
        yield (
            f"run {other.number} differs from run {first.number} in messages that nodes sent, or between two moments "
            "of its trace"
        )
    if first.outcome.digest == other.outcome.digest or first.outcome.status != other.outcome.status:
        yield from _endings(first, other)


def _endings(first: _Run, other: _Run) -> Iterator[str]:
    if first.outcome.status != other.outcome.status or first.outcome.failures:
        yield f"{first.ending}, {other.ending}"
        return
    for ours, theirs in zip(first.outcome.expectations, other.outcome.expectations, strict=True):
        if ours != theirs:
            yield (
                f"the robot moved identically, but '{ours.name}' judged it differently: run {first.number} "
                f"{_judged(ours.verdict)}, run {other.number} {_judged(theirs.verdict)}"
            )
            return


def _judged(verdict: Verdict) -> str:
    measured = "" if verdict.measured is None else f" (measured {verdict.measured!r} {verdict.unit}".rstrip() + ")"
    return f"{verdict.status.replace('_', ' ')}: {verdict.message}{measured}"


def _where(found: Divergence) -> str:
    """Return the place of a difference, such as "at 0.304 s, in x of base_position_xyz: 0.25 and not 0.26"."""
    ours, theirs = found.values
    if not found.column:
        return f"at {found.time:.6g} s, where one run ended: they ended at {theirs:.6g} s and {ours:.6g} s"
    return f"at {found.time:.6g} s, in {found.column}: {theirs!r} and not {ours!r}"


def _trace(outcome: Outcome, folder: Path) -> Trace | None:
    path = stored_file(folder, outcome.trace) if outcome.trace else None
    with suppress(TraceError):
        return None if path is None else load_trace(path)
    return None


def _remove(folder: Path, outcomes: Iterable[Outcome]) -> None:
    """Remove the stored files of runs that were only needed for the comparison."""
    stored = (name for outcome in outcomes for name in (outcome.trace, outcome.replay, *outcome.recordings))
    for path in (stored_file(folder, name) for name in stored if name):
        if path is not None:
            with suppress(OSError):
                path.unlink()

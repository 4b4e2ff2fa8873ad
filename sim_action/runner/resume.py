"""The option `run --resume`: it takes over the outcomes of an earlier call that this call would get again.

The journal of the earlier call may come from anywhere. An outcome is taken over only if it is final, if its key is that
of the planned run, and if the files that it names exist under the names that this call would give them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from sim_action.core.errors import UsageError
from sim_action.core.records import dataclass, field, replace
from sim_action.results.artifacts import RunFiles, stored_file
from sim_action.results.journal import JOURNAL_FILE, Recorded, read_journal
from sim_action.results.journal_records import Planned, Record
from sim_action.results.outcome import Outcome, Status
from sim_action.results.results_json import is_inconsistent
from sim_action.runner.outcome_assembly import OutcomeAssembly
from sim_action.runner.run_keys import RunKeys
from sim_action.scenario.model import LoadedScenario

_ALL_CHANGED: Final = (
    "no verdict of the earlier run is taken over: since then, files, options, environment variables, software or the "
    "current folder have changed"
)
_FINAL: Final[frozenset[Status]] = frozenset({"passed", "failed", "not_exercised", "flaky"})


@dataclass(frozen=True, slots=True)
class TakenOver:
    """The outcomes that a call takes over.

    Attributes:
        records: final outcomes, and outcomes of single repetitions, with their places in this call.
        files: the names of their files, relative to the output folder.
        remarks: for the user, the reason why nothing or not everything is taken over.
    """

    records: tuple[Record, ...] = ()
    files: frozenset[str] = frozenset()
    remarks: tuple[str, ...] = ()

    @property
    def finals(self) -> int:
        """The number of final outcomes."""
        return sum(record.event == "finished" for record in self.records)

    def runs(self, repeat: int) -> int:
        """Return the number of runs that need no process; `repeat`: the number of runs for each final outcome."""
        return sum(repeat if record.event == "finished" else 1 for record in self.records)

    @property
    def not_passed(self) -> bool:
        """True if an outcome has not passed."""
        return any(record.outcome is not None and record.outcome.status != "passed" for record in self.records)


def take_over(
    folder: Path,
    planned: Sequence[Planned],
    runs: Sequence[LoadedScenario],
    assembly: OutcomeAssembly,
    *,
    files: Sequence[RunFiles],
    keys: RunKeys,
) -> TakenOver:
    """Return the outcomes of the earlier call in the output folder that this call can take over.

    Args:
        folder: the output folder, locked by this call.
        planned: the outcomes of this call.
        runs: the runs of this call, each once.
        assembly: knows the places of the runs.
        files: the files of all runs of this call: of all first repetitions, of all second ones, and so on.
        keys: gives the keys of the runs.
    """
    if not (folder / JOURNAL_FILE).is_file():
        return TakenOver(remarks=(f"there is no earlier run to resume: {folder} has no {JOURNAL_FILE}",))
    try:
        recorded = read_journal(folder)
    except UsageError as error:
        return TakenOver(remarks=(f"there is no earlier run to resume: {error}",))
    search = _Search(folder, planned, runs, assembly, files, keys, _by_key(recorded))
    records = [record for places in assembly.scenarios for record in search.records(places)]
    remarks = tuple(dict.fromkeys(search.reasons))
    if not records and search.earlier and not remarks:
        remarks = (_ALL_CHANGED,)
    return TakenOver(tuple(records), frozenset(search.kept), remarks)


_Key = tuple[str, int | None]
"""The key of a run, and the number of the repetition; None for a final outcome."""


def _by_key(recorded: Recorded) -> dict[_Key, Record]:
    return {
        (record.key, record.turn if record.event == "run" else None): record
        for record in recorded.records
        if record.key is not None and record.event in ("run", "finished")
    }


@dataclass()
class _Search:
    """Searches the records of the earlier call.

    Attributes:
        kept: the names of the files of outcomes that were found.
        reasons: the reasons why the files of a workspace are not known.
    """

    folder: Path
    planned: Sequence[Planned]
    runs: Sequence[LoadedScenario]
    assembly: OutcomeAssembly
    files: Sequence[RunFiles]
    keys: RunKeys
    earlier: Mapping[_Key, Record]
    kept: set[str] = field(default_factory=set)
    reasons: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._indices = {place: index for index, place in enumerate(self.assembly.places)}

    def records(self, places: range) -> Iterator[Record]:
        """Yield the records for one scenario: all of its final outcomes, or else outcomes of single repetitions."""
        runs = [self.runs[self._indices[place]] for place in places]
        keys = [self.keys.of(run) for run in runs]
        if None in keys and (reason := self.keys.unknown(runs[0])):
            self.reasons.append(f"verdicts of user code are not taken over: {reason}")
        finals = [self._final(place, key) for place, key in zip(places, keys, strict=True)]
        # The outcome of one engine may tell of the others.
        if all(finals):
            yield from filter(None, finals)
            for place in places:
                self._keep(place, range(1, self.assembly.repeat + 1))
        elif not self.assembly.is_compared(places[0]) and self.assembly.repeat > 1:
            for turn in range(1, self.assembly.repeat + 1):
                if record := self._of_turn(places[0], turn, keys[0]):
                    yield record
                    self._keep(places[0], [turn])

    def _final(self, place: int, key: str | None) -> Record | None:
        record = self.earlier.get((key, None)) if key is not None else None
        if record is None or record.outcome is None or not self._is_of(place, record.outcome):
            return None
        turns = range(1, self.assembly.repeat + 1)
        if not any(self._names(record.outcome, self._files(place, turn)) for turn in turns):
            return None
        traces = [self._files(place, turn).trace for turn in turns]
        # The traces of two runs that differ show the difference.
        if record.outcome.status == "flaky" and sum(map(self._exists, traces)) < 2:
            return None
        return replace(record, place=place)

    def _of_turn(self, place: int, turn: int, key: str | None) -> Record | None:
        record = self.earlier.get((key, turn)) if key is not None else None
        if record is None or record.outcome is None or not self._is_of(place, record.outcome):
            return None
        if record.outcome.status == "flaky" or not self._names(record.outcome, self._files(place, turn)):
            return None
        return replace(record, place=place)

    def _is_of(self, place: int, outcome: Outcome) -> bool:
        is_final = outcome.status in _FINAL and not is_inconsistent(outcome)
        return is_final and Planned.of(outcome) == self.planned[place]

    def _files(self, place: int, turn: int) -> RunFiles:
        return self.files[(turn - 1) * len(self.runs) + self._indices[place]]

    def _names(self, outcome: Outcome, files: RunFiles) -> bool:
        named = [outcome.trace, *([outcome.replay] if outcome.replay else []), *outcome.recordings]
        return named == [self._name(path) for path in files] and all(map(self._exists, files))

    def _exists(self, path: Path) -> bool:
        found = stored_file(self.folder, self._name(path))
        return found is not None and found.stat().st_size > 0

    def _keep(self, place: int, turns: Sequence[int]) -> None:
        self.kept.update(self._name(path) for turn in turns for path in self._files(place, turn))

    def _name(self, path: Path) -> str:
        return path.relative_to(self.folder).as_posix()

"""The events of a call, and the journal `results.jsonl`: each outcome, written as soon as it is known.

    Started, Progressed ..., RunEnded     one run of one scenario, in a child process
    Finished                              an outcome of the results is final

A scenario has several runs with `--repeat`, and several outcomes with several engines. `Finished` comes after the last
run that its outcome depends on. If it depends on one run alone, it comes before the `RunEnded` of that run: a verdict
is in the journal before anything reports it.

The first line is the header: the planned outcomes, and the files that the call may write. Each other line is a record:
a start, the outcome of one of several runs, a final outcome, or the end of the call. `results.json` and all reports are
assembled from these records, at the end of the call or later by `sim-action report`.

A record is handed to the operating system at once, so that a killed process loses none. It is on the disk a tenth of a
second later. A journal that is read may come from anywhere, so its content is validated.
"""

from __future__ import annotations

import os
import platform
import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from datetime import UTC, datetime
from functools import cache, partial
from itertools import islice
from pathlib import Path
from typing import Annotated, BinaryIO, ClassVar, Final, Literal, Self

from pydantic import AwareDatetime, ConfigDict, Field, TypeAdapter, ValidationError

from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.field_types import FrozenModel
from sim_action.core.files import open_regular, whole_file, write_all
from sim_action.core.provenance import platform_name
from sim_action.core.records import dataclass, replace
from sim_action.core.version import __version__
from sim_action.core.wording import escaped_line, system_reason
from sim_action.results.gates import over_variations
from sim_action.results.journal_seal import Seal
from sim_action.results.outcome import Failure, NotNegative, Outcome
from sim_action.results.results_json import MAX_OUTCOMES, Commit, Results, Shard, is_inconsistent
from sim_action.scenario.sharing import share_parts
from sim_action.scenario.source import Variation
from sim_action.scenario.variations.gate import PlannedGate


@dataclass(frozen=True, slots=True)
class Started:
    """A run has started."""

    place: int  # the index of its outcome in the results
    turn: int  # the number of the repetition, counted from 1
    name: str  # the name of the scenario


@dataclass(frozen=True, slots=True)
class Progressed:
    """A run has reached a sim time in s; the other attributes are as in `Started`."""

    place: int
    turn: int
    name: str
    sim_time: float
    real_time_factor: float


@dataclass(frozen=True, slots=True)
class RunEnded:
    """A run has ended; the other attributes are as in `Started`."""

    place: int
    turn: int
    outcome: Outcome  # the outcome of this run alone
    key: str | None = None  # the digest of everything that the outcome may depend on; None: it is not known
    is_one_of_several: bool = False  # True if the final outcome depends on other runs, too
    taken_over: bool = False  # True if an earlier call has run it, see `run --resume`


@dataclass(frozen=True, slots=True)
class Finished:
    """An outcome is final; `place`: its index in the results. The other attributes are as in `RunEnded`."""

    place: int
    outcome: Outcome
    key: str | None = None
    taken_over: bool = False


Event = Started | Progressed | RunEnded | Finished
Listener = Callable[[Event], None]


Place = Annotated[int, Field(ge=0)]
Kind = Literal["started", "run", "finished", "ended"]


@dataclass(frozen=True, slots=True)
class Planned:
    """One planned outcome; the attributes are as in `Outcome`. A call keeps all: they are smaller than models."""

    name: str
    file: str
    line: Annotated[int, Field(ge=1)] | None = None
    number: Annotated[int, Field(ge=1)] | None = None
    group: str | None = None
    variation: Variation = ()
    gate: str | None = None
    __pydantic_config__: ClassVar[ConfigDict] = FrozenModel.model_config

    @classmethod
    def of(cls, outcome: Outcome) -> Self:
        """Return the plan of an outcome."""
        return cls(*(getattr(outcome, field.name) for field in fields(cls)))

    def unfinished(self, message: str) -> Outcome:
        """Return the outcome of a scenario that has not finished."""
        failure = Failure(kind="interrupted", title="not finished", message=message)
        plan = {field.name: getattr(self, field.name) for field in fields(self)}
        return Outcome(**plan, status="error", failures=(failure,))


class Header(FrozenModel):
    """The first line of a journal."""

    journal: Literal[1]  # the version of the format
    sim_action: str
    python: str
    platform: str
    started_at: AwareDatetime | None = None  # started_at, commit, shard, selected: as in `Results`
    commit: Commit | None = None
    shard: Shard | None = None
    selected: bool = False
    # the files that the call may write, relative to the journal; the next call removes them
    files: tuple[str, ...] = ()
    gates: tuple[PlannedGate, ...] = ()  # the gates of the planned outcomes
    # the planned outcomes, in the order of the results
    planned: Annotated[tuple[Planned, ...], Field(max_length=MAX_OUTCOMES)] = ()

    @classmethod
    def of_call(
        cls,
        planned: Iterable[Planned],
        files: Iterable[str],
        shard: Shard | None = None,
        *,
        selected: bool = False,
        gates: Iterable[PlannedGate] = (),
    ) -> Self:
        """Return the header of a call by this version on this machine."""
        # The commit that GitHub, GitLab or Jenkins names; None without one.
        names = ("GITHUB_SHA", "CI_COMMIT_SHA", "GIT_COMMIT")
        named = (os.environ.get(name, "").lower() for name in names)
        return cls(
            journal=1,
            sim_action=__version__,
            python=platform.python_version(),
            platform=platform_name(),
            started_at=datetime.now(UTC).replace(microsecond=0),
            commit=next((commit for commit in named if re.fullmatch("[0-9a-f]{7,64}", commit)), None),
            shard=shard,
            selected=selected,
            files=tuple(files),
            gates=tuple(gates),
            planned=tuple(planned),
        )


@dataclass(frozen=True, slots=True)
class Record:
    """A line of the journal. A call keeps several for each run, so they are smaller than models."""

    at: NotNegative  # the wall time in s since the start of the call
    event: Kind  # the kind of the record; "ended": the call has ended, and has no `place`
    place: Place | None = None  # the index of the planned outcome
    # the number of the repetition, counted from 1; None for a final outcome
    turn: Annotated[int, Field(ge=1)] | None = None
    key: str | None = None  # the digest of everything that the outcome may depend on; None: it is not known
    taken_over: bool = False  # True for an outcome of an earlier call, see `run --resume`
    outcome: Outcome | None = None
    seal: str | None = None  # the keyed digest of a line with a key, see `Seal`

    __pydantic_config__: ClassVar[ConfigDict] = FrozenModel.model_config

    @property
    def is_interrupted(self) -> bool:
        """Return True for the outcome of an interrupted scenario. It is not written: it is no result."""
        return self.outcome is not None and self.outcome.exit_code is ExitCode.INTERRUPTED


JOURNAL_FILE: Final = "results.jsonl"
_MAX_HEADER_BYTES: Final = 64_000_000
_SYNC_PERIOD_S: Final = 0.1
MAX_LINE_BYTES: Final = 64_000_000
MAX_RECORDS: Final = 4 * MAX_OUTCOMES
# The content and the length of a file are enough.
_to_disk: Final[Callable[[int], None]] = getattr(os, "fdatasync", os.fsync)
_NO_LINK: Final = getattr(os, "O_NOFOLLOW", 0)


class Recorded:
    """The content of a journal.

    Attributes:
        header: the first line.
        records: all other lines.
        finished: the place of each final outcome -> its record.
        unsealed: the number of records that lost their keys, see `read_journal`.
    """

    def __init__(self, header: Header) -> None:
        self.header = header
        self.records: list[Record] = []
        self.finished: dict[int, Record] = {}
        self.unsealed = 0
        self._last: Outcome | None = None

    def add(self, record: Record) -> None:
        """Add a record. Raise ValueError if it does not fit the header."""
        if record.event != "ended" and (record.place is None or record.place >= len(self.header.planned)):
            raise ValueError("it has no place in the plan")
        if record.event in ("run", "finished"):
            planned = self.header.planned[record.place or 0]
            if record.outcome is None or (record.outcome.name, record.outcome.file) != (planned.name, planned.file):
                raise ValueError("it has no outcome of the planned scenario")
        self.records.append(record)
        if record.outcome is not None:
            if self._last is not None:
                share_parts(record.outcome, self._last)
            self._last = record.outcome
        if record.event == "finished" and record.place is not None:
            self.finished[record.place] = record

    def results(self) -> Results:
        """Return the results: every planned outcome, as not finished if it is not final."""
        # The verdicts of runs for each place that has started and may not be final.
        verdicts: dict[int, list[str]] = {}
        for record in self.records:
            if record.place is None or record.place in self.finished:
                continue
            words = verdicts.setdefault(record.place, [])
            if record.event == "run" and record.outcome is not None:
                words.append(f"run {record.turn} {record.outcome.ending}")
        outcomes = [self._outcome(place, planned, verdicts) for place, planned in enumerate(self.header.planned)]
        return self._results(outcomes, is_part=self.header.shard is not None or self.header.selected)

    def results_so_far(self) -> Results:
        """Return the results of a call that goes on: the final outcomes, and the gates whose runs are all final."""
        outcomes = (record.outcome for _, record in sorted(self.finished.items()))
        return self._results([outcome for outcome in outcomes if outcome is not None], is_part=True)

    def _results(self, outcomes: Sequence[Outcome], *, is_part: bool) -> Results:
        header = self.header
        return Results(
            sim_action=header.sim_action,
            python=header.python,
            platform=header.platform,
            started_at=header.started_at,
            commit=header.commit,
            wall_time=max((record.at for record in self.records), default=0.0),
            shard=header.shard,
            selected=header.selected,
            gates=header.gates,
            outcomes=over_variations(outcomes, header.gates, is_part=is_part),
        )

    def _outcome(self, place: int, planned: Planned, verdicts: Mapping[int, Sequence[str]]) -> Outcome:
        if place in self.finished and (outcome := self.finished[place].outcome) is not None:
            return outcome
        started = "ended" if place in verdicts else "started"
        message = f"sim-action ended before this scenario {started}"
        return planned.unfinished("; ".join((message, *verdicts.get(place, ()))))


class Journal:
    """A listener that writes the journal of a call, and keeps its records.

    If the journal cannot be written, the call goes on with the records in memory, and `warn` is called once with the
    reason of the system. Each later record is a new attempt to write the whole journal.
    """

    def __init__(
        self,
        folder: Path,
        header: Header,
        warn: Callable[[str], None],
        started: float,
        taken_over: Iterable[Record] = (),
        *,
        make_room: Callable[[OSError, Iterable[str]], bool] = lambda *_: False,
    ) -> None:
        """Begin the journal in a folder.

        Args:
            folder: the output folder.
            header: the plan of the call.
            warn: receives the reason if the journal cannot be written.
            started: the start of the call on `time.monotonic()`.
            taken_over: records of outcomes of an earlier call, with their places in this one.
            make_room: makes room on a full disk; see `Room.make`.
        """
        self._path = folder.absolute() / JOURNAL_FILE
        self._warn, self._make_room = warn, make_room
        self._has_warned = False
        self._started = started
        self._synced = float("-inf")
        self._is_synced = False
        self._descriptor: int | None = None
        self._size = 0
        self._recorded = Recorded(header)
        for record in taken_over:
            self._recorded.add(replace(record, at=0.0, taken_over=True, seal=None))
        self._seal = Seal.of_user()
        self._attempt(self._write_whole)

    def __call__(self, event: Event) -> None:
        """Record an event."""
        match event:
            # Outcomes that were taken over are in the journal from its beginning.
            case Finished(taken_over=False):
                self._record("finished", event.place, key=event.key, outcome=event.outcome)
            case RunEnded(taken_over=False):
                if event.is_one_of_several:
                    self._record("run", event.place, event.turn, key=event.key, outcome=event.outcome)
            case Started(place, turn, _):
                self._record("started", place, turn)
                self._sync_if_due()
            case Progressed():
                self._sync_if_due()

    def _sync_if_due(self) -> None:
        if not self._is_synced and time.monotonic() - self._synced >= _SYNC_PERIOD_S:
            self._attempt(self._sync)

    def close(self) -> Results:
        """End the journal, and return the results of the call."""
        self._record("ended")
        self._attempt(self._sync)
        self._leave()
        return self._recorded.results()

    def _record(
        self,
        event: Kind,
        place: int | None = None,
        turn: int | None = None,
        *,
        key: str | None = None,
        outcome: Outcome | None = None,
    ) -> None:
        at = round(max(0.0, time.monotonic() - self._started), 3)
        record = Record(at=at, event=event, place=place, turn=turn, key=key, outcome=outcome)
        self._recorded.add(record)
        if not record.is_interrupted:
            self._attempt(partial(self._append, record))

    def _attempt(self, step: Callable[[], None]) -> None:
        """Do a step; after an error of the system, the next step writes the whole journal again."""
        while True:
            try:
                step()
            except OSError as error:
                self._leave()
                if self._make_room(error, self._recorded.header.files):
                    step = self._write_whole
                    continue
                if not self._has_warned:
                    self._has_warned = True
                    reason = system_reason(error)
                    problem = f"the journal {self._path.name} cannot be written: {reason}"
                    self._warn(f"{problem}; verdicts are kept in memory")
            return

    def _append(self, record: Record) -> None:
        """Write a record. Raise OSError."""
        if self._descriptor is None or not self._is_unchanged(self._descriptor):
            self._leave()
            self._write_whole()
            return
        line = self._line(record)
        write_all(self._descriptor, line)
        self._size += len(line)
        self._is_synced &= record.event == "started"

    def _is_unchanged(self, descriptor: int) -> bool:
        """Return True if the open file is still at its path, with its size. User code may change, move or remove it."""
        opened = os.fstat(descriptor)
        try:
            status = self._path.lstat()
        except OSError:
            return False
        return opened.st_size == self._size and status.st_ino == opened.st_ino

    def _write_whole(self) -> None:
        """Write the header and all records to a new file. Raise OSError."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(self._path) as file:
            self._size = file.write(self._recorded.header.model_dump_json(exclude_defaults=True).encode() + b"\n")
            for record in self._recorded.records:
                if not record.is_interrupted:
                    self._size += file.write(self._line(record))
        self._descriptor = os.open(self._path, os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0) | _NO_LINK)
        self._is_synced = False

    def _line(self, record: Record) -> bytes:
        line = _records().dump_json(record, exclude_defaults=True) + b"\n"
        return self._seal.on(line) if self._seal is not None and record.key is not None else line

    def _sync(self) -> None:
        """Wait until everything that was written is on the disk. Raise OSError."""
        if self._descriptor is not None:
            _to_disk(self._descriptor)
            self._is_synced = True
            self._synced = time.monotonic()

    def _leave(self) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def read_journal(folder: Path, *, sealed: bool = False) -> Recorded:
    """Read the journal of an output folder. Raise UsageError.

    Lines that are not valid are left out: a killed process may leave the last line unfinished. A final outcome whose
    status contradicts its failures or expectations is not valid. With `sealed`, records without the seal of this user
    lose their keys, and are counted.
    """
    seal = Seal.of_user() if sealed else None
    path = folder / JOURNAL_FILE
    try:
        with open_regular(path, follow_link=False) as file:
            recorded = Recorded(Header.model_validate_json(file.readline(_MAX_HEADER_BYTES)))
            for line in islice(iter(partial(file.readline, MAX_LINE_BYTES), b""), MAX_RECORDS):
                with suppress(ValueError):
                    record = parsed_record(line)
                    if sealed and record.key is not None and not (seal is not None and seal.fits(line)):
                        record = replace(record, key=None)
                        recorded.unsealed += 1
                    recorded.add(record)
    except OSError as error:
        reason = system_reason(error)
    except ValidationError as error:
        reason = header_problem(error)
    else:
        return recorded
    raise UsageError(escaped_line(f"{path} is not a valid journal: {reason}"))


def manifest(folder: Path) -> tuple[str, ...]:
    """Return the names of files that the earlier call may have written; they may come from anywhere."""
    try:
        with open_regular(folder / JOURNAL_FILE, follow_link=False) as file:
            return Header.model_validate_json(file.readline(_MAX_HEADER_BYTES)).files
    except (OSError, ValidationError):
        return ()


def header_problem(error: ValidationError) -> str:
    """Return the reason why the first line is no header."""
    return f"it does not begin with a header of format version 1: {error.errors(include_url=False)[0]['msg']}"


def parsed_record(line: bytes) -> Record:
    """Return a record. Raise ValueError if it is not valid."""
    record = _records().validate_json(line)
    if record.event == "finished" and record.outcome is not None and is_inconsistent(record.outcome):
        raise ValueError("its status contradicts its failures or expectations")
    return record


@cache
def _records() -> TypeAdapter[Record]:
    return TypeAdapter(Record)


_MAX_BYTES_OF_LOOK: Final = 16_000_000  # one look at a large journal is an answer to a request, so it must end soon
# Another call may get the same inode; the end of the read bytes differs, because its lines have times.
_COMPARED_BYTES: Final = 512


class JournalFollower:
    """The journal of a folder, which may begin later, grow, be removed, and be replaced by another call's journal.

    Attributes:
        recorded: what was read; None: there is no valid journal.
        problem: the reason why the journal cannot be read; empty if it can, and if there is none.
        call: the number of journals that were found until now.
        has_more: True if the last look has left something unread.
        written_at: the time of the last change in s since the epoch.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder.absolute() / JOURNAL_FILE
        self.recorded: Recorded | None = None
        self.problem = ""
        self.call = 0
        self.has_more = False
        self.written_at = 0.0
        self._file: tuple[int, int] | None = None
        self._offset = 0
        self._end = b""

    @property
    def is_over(self) -> bool:
        """True if the call has ended."""
        return self.recorded is not None and any(record.event == "ended" for record in self.recorded.records[-1:])

    @property
    def elapsed(self) -> float:
        """The wall time in s since the start of the call; of one that has ended, until its end."""
        if self.recorded is None:
            return 0.0
        last = max((record.at for record in self.recorded.records), default=0.0)
        return last if self.is_over else last + max(0.0, time.time() - self.written_at)

    def look(self) -> None:
        """Read the new lines, up to a size."""
        self.has_more, self.problem = False, ""
        try:
            with open_regular(self._path, follow_link=False) as file:
                self._continue(file)
        except FileNotFoundError:
            self._forget()
        except OSError as error:
            self._forget()
            self.problem = escaped_line(f"{JOURNAL_FILE} cannot be read: {system_reason(error)}")
        except ValidationError as error:
            self._forget()
            self.problem = escaped_line(f"{JOURNAL_FILE} is not a valid journal: {header_problem(error)}")

    def _forget(self) -> None:
        self.recorded, self._file, self._offset, self._end = None, None, 0, b""

    def _continue(self, file: BinaryIO) -> None:
        """Read further lines. Raise OSError, and ValidationError if the first line is no header."""
        status = os.fstat(file.fileno())
        file_id = (status.st_dev, status.st_ino)
        self.written_at = status.st_mtime
        file.seek(self._offset - len(self._end))
        if file_id != self._file or file.read(len(self._end)) != self._end:
            self._forget()
            self._file = file_id
            file.seek(0)
        limit = self._offset + _MAX_BYTES_OF_LOOK
        while self._offset < limit:
            line = file.readline(MAX_LINE_BYTES)
            if not line.endswith(b"\n") and len(line) < MAX_LINE_BYTES:
                # The end of the file, or a line of which the rest will follow.
                return
            if self.recorded is None:
                self.recorded = Recorded(Header.model_validate_json(line))
                self.call += 1
            elif len(self.recorded.records) < MAX_RECORDS:
                with suppress(ValueError):
                    self.recorded.add(parsed_record(line))
            self._offset += len(line)
            self._end = (self._end + line[-_COMPARED_BYTES:])[-_COMPARED_BYTES:]
        self.has_more = True

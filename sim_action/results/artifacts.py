"""The files of runs next to `results.json`: paths of traces, replays and recordings, and copying them for a merge."""

from __future__ import annotations

import os
import re
import shutil
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, Final, Literal, Self

from sim_action.core.files import open_regular, whole_file
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line, system_reason
from sim_action.recording.export import EXPORTS
from sim_action.results.outcome import Outcome

REPORT_FILE: Final = "report.html"
TRACE_FOLDER: Final = "traces"
REPLAY_FOLDER: Final = "replays"
RECORDING_FOLDER: Final = "recordings"
RUN_FILE_FOLDERS: Final = (TRACE_FOLDER, REPLAY_FOLDER, RECORDING_FOLDER)
"""The folders next to `results.json` that hold the files of runs."""


def trace_paths(names: Iterable[str], folder: Path) -> list[Path]:
    """Return a path for each name: valid on every file system and unique even where the case is ignored."""
    return [_trace_path(stem, folder) for stem in file_stems(names)]


def file_stems(names: Iterable[str]) -> Iterator[str]:
    """Yield the name without an ending for the files of each run, as `trace_paths` has it."""
    taken: set[str] = set()
    # The last number tried for a name, so that many equal names do not take quadratic time.
    numbers: dict[str, int] = {}
    for name in names:
        plain = _plain(name)
        unique, number = plain, numbers.get(plain.lower(), 1)
        while unique.lower() in taken:
            number += 1
            unique = f"{plain}-{number}"
        numbers[plain.lower()] = number
        taken.add(unique.lower())
        yield unique


def _trace_path(stem: str, folder: Path) -> Path:
    return folder / TRACE_FOLDER / f"{stem}.npz"


def _plain(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-.")[:80] or "scenario"


@dataclass(frozen=True, slots=True)
class RunFiles:
    """The files of one run; `replay` is None if none is written."""

    trace: Path
    replay: Path | None
    recordings: tuple[Path, ...]

    @classmethod
    def of(cls, stem: str, folder: Path, *, replays: bool, formats: Iterable[str]) -> Self:
        """Return the files with a name of `file_stems`."""
        trace = _trace_path(stem, folder)
        recordings = tuple(recording_path(trace, name) for name in formats)
        return cls(trace, replay_path(trace) if replays else None, recordings)

    def __iter__(self) -> Iterator[Path]:
        yield self.trace
        if self.replay is not None:
            yield self.replay
        yield from self.recordings


def run_files(names: Iterable[str], folder: Path, *, replays: bool, formats: Sequence[str]) -> list[RunFiles]:
    """Return the files of runs; `names`: the name of the scenario of each run."""
    return [RunFiles.of(stem, folder, replays=replays, formats=formats) for stem in file_stems(names)]


def namesake_number(name: str, stored: str) -> int:
    """Return the number of a scenario among all with its name: `replays/a-2.json.gz` belongs to the second `a`."""
    number = Path(stored).name.removesuffix(".json.gz").removeprefix(f"{_plain(name)}-")
    return int(number) if re.fullmatch("[1-9][0-9]{0,5}", number) else 1


def replay_path(trace: Path) -> Path:
    """Return the path of the replay for the path of the trace."""
    return trace.parent.parent / REPLAY_FOLDER / f"{trace.stem}.json.gz"


def recording_path(trace: Path, ending: str) -> Path:
    """Return the path of a recording for the path of the trace; `ending` is the format, such as "mcap"."""
    return trace.parent.parent / RECORDING_FOLDER / f"{trace.stem}.{ending}"


def stored_file(folder: Path, trace: str) -> Path | None:
    """Return the path of a regular file in `folder` that its results name, reached without a link; else None."""
    try:
        # Reports look for thousands of files, for which pathlib takes several times as long.
        root = os.path.realpath(folder)
        path = os.path.normpath(os.path.join(root, trace))  # noqa: PTH118 - as just said
        is_inside = path.startswith(os.path.join(root, ""))  # noqa: PTH118 - as just said
        is_stored = is_inside and os.path.realpath(path) == path and stat.S_ISREG(os.lstat(path).st_mode)
    except (OSError, ValueError, RuntimeError):  # a name that is too long or contains NUL, or a loop of links
        return None
    return Path(path) if is_stored else None


def copy_stored(source: Path, target: Path) -> None:
    """Copy a stored file completely or not at all; an existing target, even a link, is replaced. Raises OSError."""
    with open_regular(source, follow_link=False) as stored, whole_file(target) as copy:
        shutil.copyfileobj(stored, copy)


def copy_or_reason(source: Path, target: Path) -> str:
    """Copy a stored file as `copy_stored` does, and return the reason if that fails; empty if the copy exists."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        copy_stored(source, target)
    except OSError as error:
        return escaped_line(system_reason(error))
    return ""


_NONE: Final[Mapping[str, str]] = {}


def with_existing_files(outcome: Outcome, folder: Path, removed: Mapping[str, str] = _NONE) -> Outcome:
    """Return the outcome without names of files that were removed; each is a note. `removed`: made room."""
    named = [("trace", outcome.trace), ("replay", outcome.replay)]
    named += [(f"{_file_format(name)} recording", name) for name in outcome.recordings]
    lost = {
        name: f"{kind}: it was removed {f'to make room: {removed[name]}' if name in removed else 'after the run'}"
        for kind, name in named
        if name and not _exists(folder, name)
    }
    if not lost:
        return outcome
    return outcome.model_copy(
        update={
            "trace": None if outcome.trace in lost else outcome.trace,
            "replay": None if outcome.replay in lost else outcome.replay,
            "recordings": tuple(name for name in outcome.recordings if name not in lost),
            "notes": (*outcome.notes, *lost.values()),
        }
    )


def _exists(folder: Path, name: str) -> bool:
    """Return True if a name that sim-action has given belongs to a regular file."""
    try:
        return stat.S_ISREG(os.lstat(os.path.join(folder, name)).st_mode)  # noqa: PTH118 - quicker than pathlib
    except (OSError, ValueError):
        return False


FileKind = Literal["trace", "replay", "recording"]


@dataclass(frozen=True, slots=True)
class StoredFile:
    """A file of a run that an outcome names."""

    kind: FileKind
    name: str  # the relative path in the outcome
    source: Path | None  # the path of the file; None if it is missing, or not a file that sim-action writes

    def target(self, trace: Path) -> Path:
        """Return the path for the copy, given the path for the trace of the same run."""
        if self.kind == "recording":
            return recording_path(trace, _file_format(self.name))
        return trace if self.kind == "trace" else replay_path(trace)


def stored_files_of(outcome: Outcome, folder: Path | None) -> list[StoredFile]:
    """Return the files that an outcome names; `folder`: the folder of its results file; None if there is none."""
    return [StoredFile(kind, name, _source(kind, name, folder)) for kind, name in _named(outcome)]


def with_copied_files(outcome: Outcome, files: Sequence[StoredFile], trace: Path | None, folder: Path) -> Outcome:
    """Copy the files of an outcome into `folder` and return the outcome with their new names.

    `trace` is the new path of the trace; None if nothing is to be copied. A file that cannot be copied is a note. The
    files of a repetition stay where they are.
    """
    names: dict[str, Any] = {"trace": None, "replay": None, "recordings": ()}
    notes = list(outcome.notes)
    for file in files:
        if file.source is None or trace is None:
            notes.append(escaped_line(f"its {file.kind} {file.name} was not found next to the results of its shard"))
            continue
        target = file.target(trace)
        if reason := copy_or_reason(file.source, target):
            notes.append(f"{file.kind}: {reason}")
            continue
        name = target.relative_to(folder).as_posix()
        if file.kind == "recording":
            names["recordings"] += (name,)
        else:
            names[file.kind] = name
    repeats = outcome.repeats and outcome.repeats.model_copy(update={"replay": None})
    return outcome.model_copy(update={**names, "repeats": repeats, "notes": tuple(notes)})


def _named(outcome: Outcome) -> Iterator[tuple[FileKind, str]]:
    if outcome.trace:
        yield "trace", outcome.trace
    if outcome.replay:
        yield "replay", outcome.replay
    # There is one recording for each format.
    yield from (("recording", name) for name in {_file_format(name): name for name in outcome.recordings}.values())


def _source(kind: FileKind, name: str, folder: Path | None) -> Path | None:
    if folder is None or (kind == "recording" and _file_format(name) not in EXPORTS):
        return None
    return stored_file(folder, name)


def _file_format(name: str) -> str:
    return PurePosixPath(name).suffix.removeprefix(".")

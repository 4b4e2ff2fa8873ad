"""Where traces and replays are stored beside their results, and how they come from there to somewhere else."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Final, Literal

from sim_action.core.errors import UsageError
from sim_action.core.files import open_regular, whole_file
from sim_action.core.messages import escaped_line
from sim_action.recording.export import EXPORTS
from sim_action.results.outcome import Outcome

TRACE_FOLDER: Final = "traces"
REPLAY_FOLDER: Final = "replays"
RECORDING_FOLDER: Final = "recordings"
EVIDENCE_FOLDERS: Final = (TRACE_FOLDER, REPLAY_FOLDER, RECORDING_FOLDER)
"""What runs leave beside their results is in these."""


def trace_paths(names: Sequence[str], folder: Path) -> list[Path]:
    """A file for each name, safe on every file system, no two alike whatever the case."""
    taken: set[str] = set()
    # Where to go on looking for the next that is free: many may have the same name.
    numbers: dict[str, int] = {}
    paths = []
    for name in names:
        plain = _plain(name)
        unique, number = plain, numbers.get(plain.lower(), 1)
        while unique.lower() in taken:
            number += 1
            unique = f"{plain}-{number}"
        numbers[plain.lower()] = number
        taken.add(unique.lower())
        paths.append(folder / TRACE_FOLDER / f"{unique}.npz")
    return paths


def _plain(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-.")[:80] or "scenario"


def number_among_namesakes(name: str, stored: str) -> int:
    """Which one of a name it is, from 1 on, by its replay: `replays/a-2.json.gz` is of the second `a`."""
    number = Path(stored).name.removesuffix(".json.gz").removeprefix(f"{_plain(name)}-")
    return int(number) if re.fullmatch("[1-9][0-9]{0,5}", number) else 1


def replay_path(trace: Path) -> Path:
    """Where the replay of a run is stored whose trace is at a path."""
    return trace.parent.parent / REPLAY_FOLDER / f"{trace.stem}.json.gz"


def recording_path(trace: Path, ending: str) -> Path:
    """Where a recording of a run is stored whose trace is at a path; `ending`: of its name, such as "mcap"."""
    return trace.parent.parent / RECORDING_FOLDER / f"{trace.stem}.{ending}"


def stored_file(folder: Path, trace: str) -> Path | None:
    """The file of a run that results in `folder` name; None unless it is one, below the folder and behind no link."""
    try:
        root = folder.resolve()
        path = Path(os.path.normpath(root / trace))
        is_stored = path.is_relative_to(root) and path.resolve() == path and path.is_file()
    except (OSError, ValueError, RuntimeError):  # too long, a NUL in it, links in a circle
        return None
    return path if is_stored else None


def copy_stored(source: Path, target: Path) -> None:
    """Copies a stored file, all of it or nothing; raises OSError. What the target's name stands for is replaced."""
    with open_regular(source, follow_link=False) as stored, whole_file(target) as copy:
        shutil.copyfileobj(stored, copy)


Kind = Literal["trace", "replay", "recording"]


@dataclass(frozen=True, slots=True)
class Evidence:
    """One file of a run.

    Attributes:
        name: as the outcome has it.
        source: where it is; None: not beside the results, or nothing of ours.
    """

    kind: Kind
    name: str
    source: Path | None

    def target(self, trace: Path) -> Path:
        """Where it goes, if the trace of the same run goes to a path."""
        if self.kind == "recording":
            return recording_path(trace, _file_format(self.name))
        return trace if self.kind == "trace" else replay_path(trace)


def evidence_of(outcome: Outcome, folder: Path | None) -> list[Evidence]:
    """What an outcome names, that is of results in a folder; None: it is of none."""
    return [Evidence(kind, name, _source(kind, name, folder)) for kind, name in _named(outcome)]


def moved(outcome: Outcome, files: Sequence[Evidence], trace: Path | None, folder: Path) -> Outcome:
    """The outcome with its files in `folder`, its trace at a path there; None: there is no place for it.

    Raises UsageError.
    """
    names: dict[str, Any] = {"trace": None, "replay": None, "recordings": ()}
    notes = list(outcome.notes)
    for file in files:
        if file.source is None or trace is None:
            notes.append(escaped_line(f"its {file.kind} {file.name} is not beside the results of its shard"))
            continue
        target = file.target(trace)
        _copy_file(file.kind, file.source, target)
        name = target.relative_to(folder).as_posix()
        if file.kind == "recording":
            names["recordings"] += (name,)
        else:
            names[file.kind] = name
    return outcome.model_copy(update={**names, "notes": tuple(notes)})


def _named(outcome: Outcome) -> Iterator[tuple[Kind, str]]:
    if outcome.trace:
        yield "trace", outcome.trace
    if outcome.replay:
        yield "replay", outcome.replay
    # Of each format there is one.
    yield from (("recording", name) for name in {_file_format(name): name for name in outcome.recordings}.values())


def _source(kind: Kind, name: str, folder: Path | None) -> Path | None:
    """What a stranger's results name is no recording by that alone."""
    if folder is None or (kind == "recording" and _file_format(name) not in EXPORTS):
        return None
    return stored_file(folder, name)


def _file_format(name: str) -> str:
    return PurePosixPath(name).suffix.removeprefix(".")


def _copy_file(kind: Kind, source: Path, target: Path) -> None:
    try:
        target.parent.mkdir(exist_ok=True)
        copy_stored(source, target)
    except OSError as error:
        raise UsageError(escaped_line(f"the {kind} {source} cannot be copied to {target}: {error.strerror}")) from None

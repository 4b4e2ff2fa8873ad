"""The files that an outcome names, and how they come from beside one results file to beside another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Literal

from sim_action.core.errors import UsageError
from sim_action.core.messages import escaped_line
from sim_action.recording.export import EXPORTS
from sim_action.results.outcome import Outcome
from sim_action.results.trace_files import copy_stored, recording_path, replay_path, stored_file

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
            return recording_path(trace, _format(self.name))
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
        _copy(file.kind, file.source, target)
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
    yield from (("recording", name) for name in {_format(name): name for name in outcome.recordings}.values())


def _source(kind: Kind, name: str, folder: Path | None) -> Path | None:
    """What a stranger's results name is no recording by that alone."""
    if folder is None or (kind == "recording" and _format(name) not in EXPORTS):
        return None
    return stored_file(folder, name)


def _format(name: str) -> str:
    return PurePosixPath(name).suffix.removeprefix(".")


def _copy(kind: Kind, source: Path, target: Path) -> None:
    try:
        target.parent.mkdir(exist_ok=True)
        copy_stored(source, target)
    except OSError as error:
        raise UsageError(escaped_line(f"the {kind} {source} cannot be copied to {target}: {error.strerror}")) from None

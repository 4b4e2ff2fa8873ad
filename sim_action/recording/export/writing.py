"""Writes the recordings of a run, each whole or not at all."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from sim_action.core.files import whole_file
from sim_action.core.messages import escaped_line
from sim_action.recording.export import EXPORTS
from sim_action.recording.export.recorded_run import RecordedRun


def write_recordings(run: RecordedRun, paths: Iterable[Path]) -> Iterator[str]:
    """Writes the files, whose endings are their formats; yields what to say of those that cannot be written."""
    for path in paths:
        name = path.suffix.removeprefix(".")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as file:
                EXPORTS.load(name).write(run, file)
        except Exception as error:  # noqa: BLE001 - a run has its verdict, whether it is recorded or not
            yield f"it is not recorded as {name}: {escaped_line(f'{type(error).__name__}: {error}')}"

"""Recordings that a run leaves for other tools, one format a file: `run --record mcap`.

They are made in the scenario's own process, of what was kept of the run, once it is over. What a format needs beside
sim-action itself is asked for before anything runs. (Logs that scenarios replay are read by `recordings`.)
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, ClassVar, Final, Protocol

from sim_action.core.errors import UsageError
from sim_action.core.files import whole_file
from sim_action.core.messages import did_you_mean, escaped_line
from sim_action.core.registry import Table

if TYPE_CHECKING:
    from sim_action.recording.export.recorded_run import RecordedRun


class Export(Protocol):
    """What the table's entries are.

    Attributes:
        extra: of sim-action, that installs what it needs; empty if it needs nothing more.
        packages: the modules that it imports when it writes.
    """

    extra: ClassVar[str]
    packages: ClassVar[tuple[str, ...]]

    @staticmethod
    def write(run: RecordedRun, file: BinaryIO) -> None:
        """Writes a run."""


EXPORTS: Final = Table[type[Export]](
    "recording",
    {
        "mcap": "sim_action.recording.export.mcap_log:McapLog",
        "csv": "sim_action.recording.export.csv_tum:CsvTable",
        "tum": "sim_action.recording.export.csv_tum:TumTrajectory",
        "gif": "sim_action.recording.export.video:GifFilm",
        "mp4": "sim_action.recording.export.video:Mp4Film",
    },
)
"""The ending of a recording's file -> what writes it."""


def wanted_formats(typed: Iterable[str]) -> tuple[str, ...]:
    """The formats that are meant, each once; names may be joined by commas. Raises UsageError."""
    names = [name.strip() for text in typed for name in text.split(",")]
    wanted = tuple(dict.fromkeys(filter(None, names)))
    for name in wanted:
        if name not in EXPORTS:
            raise UsageError(escaped_line(f"there is no recording '{name}'{did_you_mean(name, EXPORTS)}"))
        _refuse_without_packages(name, EXPORTS.load(name))
    return wanted


def _refuse_without_packages(name: str, export: type[Export]) -> None:
    wanted = dict.fromkeys(package.partition(".")[0] for package in export.packages)
    missing = [package for package in wanted if find_spec(package) is None]
    if missing:
        extra = export.extra
        raise UsageError(
            f"to record {name}, what is missing here has to be installed ({', '.join(missing)}): "
            f"pip install '.[{extra}]', or in a workflow the input 'extras: {extra}'"
        )


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

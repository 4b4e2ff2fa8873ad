"""Exports of a run to the formats of other tools: `run --record mcap`.

A recording is written in the process of the scenario after the run. The packages that a format needs are checked
before anything runs. (Logs that scenarios replay are read by `commands.logs`.)
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, ClassVar, Final, Protocol

from sim_action.core.errors import UsageError
from sim_action.core.files import whole_file
from sim_action.core.registry import Table
from sim_action.core.wording import did_you_mean, escaped_line, system_reason

if TYPE_CHECKING:
    from sim_action.recording.export.recorded_run import RecordedRun


class Export(Protocol):
    """The writer of one format."""

    extra: ClassVar[str]  # the extra of sim-action that installs the packages; empty if none are needed
    packages: ClassVar[tuple[str, ...]]  # the modules that `write` imports

    @staticmethod
    def write(run: RecordedRun, file: BinaryIO) -> None:
        """Write a run to a file."""


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
"""The suffix of the file -> the writer of the format."""


def wanted_formats(typed: Iterable[str]) -> tuple[str, ...]:
    """Return the requested formats, each once; names may be separated by commas. Raises UsageError."""
    names = [name.strip() for text in typed for name in text.split(",")]
    formats = tuple(dict.fromkeys(filter(None, names)))
    for name in formats:
        if name not in EXPORTS:
            raise UsageError(escaped_line(f"--record: unknown format '{name}'{did_you_mean(name, EXPORTS)}"))
        export = EXPORTS.load(name)
        modules = dict.fromkeys(package.partition(".")[0] for package in export.packages)
        missing = [package for package in modules if find_spec(package) is None]
        if missing:
            extra = export.extra
            raise UsageError(
                f"--record {name} needs a package that is not installed ({', '.join(missing)}): "
                f"run pip install 'sim-action[{extra}]', or set the input 'extras: {extra}' in a workflow"
            )
    return formats


def write_recordings(run: RecordedRun, paths: Iterable[Path]) -> Iterator[str]:
    """Write the files, whose suffixes are their formats; yield a note for each that cannot be written."""
    for path in paths:
        name = path.suffix.removeprefix(".")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as file:
                EXPORTS.load(name).write(run, file)
        except Exception as error:  # noqa: BLE001 - a run has its verdict, whether it is recorded or not
            reason = system_reason(error) if isinstance(error, OSError) else f"{type(error).__name__}: {error}"
            yield f"recording as {name}: {escaped_line(reason)}"

"""Recognise files that sim-action has written, by their content: only these, and empty files, are overwritten."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from sim_action.core.errors import UsageError
from sim_action.core.files import open_regular
from sim_action.core.wording import escaped_line
from sim_action.recording.export import EXPORTS
from sim_action.results.artifacts import RECORDING_FOLDER, REPLAY_FOLDER, REPORT_FILE, TRACE_FOLDER
from sim_action.results.journal import JOURNAL_FILE, manifest
from sim_action.results.results_json import RESULTS_FILE

JUNIT_FILE: Final = "junit.xml"  # the default name of the JUnit XML

SUFFIXES: Final = {
    TRACE_FOLDER: (".npz",),
    REPLAY_FOLDER: (".json.gz",),
    RECORDING_FOLDER: tuple(f".{name}" for name in EXPORTS),
}
"""Folder of the files of runs -> the suffixes of the files that sim-action writes there."""

GENERATOR: Final = '<meta name="generator" content="sim-action">'  # the mark of a report in its head
COMPARED: Final = "compared with the previous run"  # the words at the beginning of a comparison as Markdown
_MAX_START_BYTES: Final = 8192

JUNIT_NAME: Final = "sim-action"
"""The name of the root of our JUnit XML, which makes it different from that of other tools."""


def is_own_junit(start: bytes) -> bool:
    """Return True if a file with this beginning is JUnit XML of sim-action, of any version."""
    parser: Any = ET.XMLPullParser(("start",))
    # The last two: an unknown encoding. A mistake behind the first element does not matter.
    with suppress(ET.ParseError, LookupError, ValueError):
        parser.feed(start)
    with suppress(ET.ParseError):
        for _, root in parser.read_events():
            return (root.tag, root.get("name")) == ("testsuites", JUNIT_NAME)
    return False


def is_comparison(start: bytes) -> bool:
    """Return True if a file with this beginning is the Markdown of `compare`."""
    return start.startswith(b"## ") and COMPARED.encode() in start


def is_proof(start: bytes) -> bool:
    """Return True if a file with this beginning is the JSON of `prove`."""
    return start.startswith(b"{") and b'"sim_action"' in start and b'"scenarios"' in start


_KINDS: Final[dict[str, Callable[[bytes], bool]]] = {
    RESULTS_FILE: lambda start: start.startswith(b"{") and b'"sim_action"' in start,
    JOURNAL_FILE: lambda start: start.startswith(b"{") and b'"journal"' in start and b'"sim_action"' in start,
    REPORT_FILE: lambda start: GENERATOR.encode() in start,
    JUNIT_FILE: is_own_junit,
}
"""Name of a file in the output folder -> function that recognises it by its first bytes."""


def is_foreign(path: Path, is_ours: Callable[[bytes], bool]) -> bool:
    """Return True if a file has content that is not ours. Raise OSError, and UsageError for a link."""
    if path.is_symlink():
        raise UsageError(escaped_line(f"'{path}' is a link, and results are not written through links; remove it"))
    try:
        with open_regular(path, follow_link=False) as file:
            start = file.read(_MAX_START_BYTES)
    except (FileNotFoundError, NotADirectoryError):
        return False
    return bool(start) and not is_ours(start)


def refuse_foreign_files(folder: Path) -> None:
    """Raise UsageError if a call with this output folder would overwrite a file of the user."""
    earlier = manifest(folder)
    for name, is_ours in _KINDS.items():
        if name not in earlier and is_foreign(folder / name, is_ours):
            raise _refusal(folder, name)
    if not earlier and not (folder / RESULTS_FILE).is_file():
        for name, suffixes in SUFFIXES.items():
            place = folder / name
            for path in sorted(place.iterdir()) if place.is_dir() else ():
                if path.name.endswith(suffixes):
                    raise _refusal(folder, f"{name}/{path.name}")


def _refusal(folder: Path, name: str) -> UsageError:
    return UsageError(
        escaped_line(
            f"--output-dir {folder} has a file '{name}' that sim-action did not write, and it would be overwritten; "
            "choose another folder, such as sim-results"
        )
    )

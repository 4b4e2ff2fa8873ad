"""Where traces and replays are stored beside their results, and how they come from there to somewhere else."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from sim_action.core.files import open_regular, whole_file

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

"""Processes that were born of a call, known by its folder in their environment."""

from __future__ import annotations

from pathlib import Path

from tests.patience import wait_until


def processes_of(folder: Path) -> list[int]:
    """Those that have ROS_MARK=folder in their environment."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                if f"ROS_MARK={folder}".encode() in (entry / "environ").read_bytes().split(b"\0"):
                    found.append(int(entry.name))
            except OSError:
                continue
    return found


def wait_for(count: int, folder: Path) -> None:
    """Until there are so many at a time: programs that are asked something come and go."""
    wait_until(lambda: len(processes_of(folder)) == count)

"""The figures of the last saved comparison.

`python -m tools.bench.by_hand --save` writes them; the documents show them.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

from sim_action import __version__
from tools.bench.by_hand.comparisons import PYTHON_VARIABLE, Settings
from tools.bench.by_hand.processes import Orientation
from tools.bench.table import Ratio

FILE: Final = Path(__file__).parent / "measured.json"

_PACKAGES: Final = ("pybullet", "mujoco-core", "pytest", "pytest-xdist", "numpy")


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the table.

    Attributes:
        ours, theirs: medians of CPU time in s.
        goal: the bound of their ratio.
        wall: the ratio of the medians of wall time; None: not measured.
        rounds: measured runs of each side.
        date: day of the measurement, UTC.
        machine: processor, cores, system and load average at the end.
        versions: versions of packages.
    """

    name: str
    ours: float
    theirs: float
    goal: float
    wall: float | None
    rounds: int
    date: str
    machine: str
    versions: str

    @property
    def ratio(self) -> float:
        """CPU of ours over theirs."""
        return self.ours / self.theirs


def load(path: Path = FILE) -> list[Row]:
    """Return the saved rows, in the order of their measurement."""
    return [Row(**row) for row in json.loads(path.read_text(encoding="utf-8"))] if path.exists() else []


def save(lines: Iterable[object], settings: Settings, path: Path = FILE) -> None:
    """Save the ratios among the lines of a table. A row that was not measured this time keeps its earlier figures."""
    lines = list(lines)
    walls = {line.name: line.ours_wall / line.theirs_wall for line in lines if isinstance(line, Orientation)}
    here = (settings.rounds, f"{datetime.now(UTC):%Y-%m-%d}", _machine(), _versions())
    measured = {
        line.name: Row(line.name, line.ours, line.theirs, line.target, walls.get(line.name), *here)
        for line in lines
        if isinstance(line, Ratio)
    }
    rows = {row.name: row for row in load(path)} | measured
    path.write_text(json.dumps([asdict(row) for row in rows.values()], indent=1) + "\n", encoding="utf-8")


def _machine() -> str:
    model = platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line.split(":", 1)[1] for line in cpuinfo.read_text().splitlines() if line.startswith("model name")]
        model = names[0].strip() if names else model
    load_average = f", load average {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{model}, {os.cpu_count()} cores, {platform.system()}{load_average}"


def _versions() -> str:
    found = [f"sim-action {__version__}", f"Python {platform.python_version()}"]
    for package in _PACKAGES:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            continue
    if python := os.environ.get(PYTHON_VARIABLE):
        program = "from importlib.metadata import version as v; print(v('scenario-execution'))"
        asked = subprocess.run([python, "-c", program], check=False, capture_output=True, text=True)
        found += [f"scenario-execution {asked.stdout.strip()}"] if asked.returncode == 0 else []
    return ", ".join(found)

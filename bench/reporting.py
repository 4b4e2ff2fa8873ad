"""What report.html costs and weighs: of one run of 30 s, and of a hundred of 10 s, which a browser opens."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final, NamedTuple

from sim_action.reports import ReportOptions
from sim_action.reports.html import page
from sim_action.results.file import Results

ROOT: Final = Path(__file__).parent.parent
ROUNDS: Final = 7
MANY: Final = 100
SCENARIO: Final = """\
name: burger turns and drives
robot: {{model: turtlebot3_burger}}
world: {{objects: [{{name: wall, box: [0.1, 2, 0.5], pose: {{x: -3}}}}]}}
commands: {{rate: 10 Hz, twist: [{{linear: 0.5, angular: 0.2}}]}}
expect: [no_collision, {{upright: {{max_tilt: 20 deg}}}}]
time_limit: {seconds} s
"""


class ReportCost(NamedTuple):
    """Of reports: s to write one of one run and s of the run's own loop; bytes of both; s until the second is open."""

    written: float
    run: float
    size: int
    size_of_many: int
    opened: float | None


def report_cost() -> ReportCost:
    """The least of several rounds; `opened` is None where there is no browser or no Node.js."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        results = _run(folder, 30)
        text = page(results, _options(folder)).text()
        written = min(_seconds(results, folder) for _ in range(ROUNDS))
        [outcome] = results.outcomes
        assert outcome.sim_time
        assert outcome.real_time_factor
        loop = outcome.sim_time / outcome.real_time_factor
        return ReportCost(written, loop, len(text.encode()), *_of_many(folder))


def _of_many(folder: Path) -> tuple[int, float | None]:
    """Bytes of the report of a hundred runs, and s until a browser shows its first."""
    [outcome] = _run(folder, 10).outcomes
    results = Results.read(folder / "sim-results/results.json")
    many = tuple(outcome.model_copy(update={"name": f"run {number}"}) for number in range(MANY))
    text = page(results.model_copy(update={"outcomes": many}), _options(folder)).text()
    file = folder / "many.html"
    file.write_text(text, encoding="utf-8")
    browser, node = shutil.which("chromium") or shutil.which("google-chrome"), shutil.which("node")
    if browser is None or node is None:
        return len(text.encode()), None
    command = [node, str(ROOT / "web/tests/opening.mjs"), str(file), browser]
    told = subprocess.run(command, check=True, capture_output=True, text=True)
    return len(text.encode()), float(told.stdout) / 1000


def _run(folder: Path, seconds: int) -> Results:
    (folder / "a.sim.yml").write_text(SCENARIO.format(seconds=seconds), encoding="utf-8")
    command = [sys.executable, "-m", "sim_action", "run", "a.sim.yml"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, env={"PYTHONPATH": str(ROOT)})
    return Results.read(folder / "sim-results/results.json")


def _options(folder: Path) -> ReportOptions:
    results = folder / "sim-results"
    return ReportOptions(results, results / "junit.xml", junit_strict=False, environment={}, workspace=folder)


def _seconds(results: Results, folder: Path) -> float:
    started = time.process_time()
    page(results, _options(folder)).text()
    return time.process_time() - started

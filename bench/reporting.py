"""The cost of report.html: its size, the time to write it, and the time until a browser shows it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final, NamedTuple

from bench.table import NotMeasuredError
from sim_action.reports import ReportOptions
from sim_action.reports.html.report import page
from sim_action.results.results_json import Results

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
    """Costs of two reports: of one run of 30 s and of 100 runs of 10 s.

    Attributes:
        written: s to write the report of one run.
        run: s of that run's own loop.
        size: bytes of the report of one run.
        size_of_many: bytes of the report of 100 runs.
    """

    written: float
    run: float
    size: int
    size_of_many: int


def report_cost() -> ReportCost:
    """Measure both reports; times are the least of several rounds."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        results = _run(folder, 30)
        text = page(results, _options(folder)).text()
        written = min(_seconds(results, folder) for _ in range(ROUNDS))
        [outcome] = results.outcomes
        assert outcome.sim_time
        assert outcome.real_time_factor
        loop = outcome.sim_time / outcome.real_time_factor
        return ReportCost(written, loop, len(text.encode()), len(_report_of_many(folder).encode()))


def opening_cost() -> float:
    """Return s until a headless browser shows the first of 100 runs. Raises NotMeasuredError."""
    command = opening_command()
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "many.html"
        file.write_text(_report_of_many(Path(name)), encoding="utf-8")
        browser = command.pop()
        printed = subprocess.run([*command, str(file), browser], check=True, capture_output=True, text=True)
    return float(printed.stdout) / 1000


def opening_command(web: Path = ROOT / "web") -> list[str]:
    """Return Node.js, the script that opens a page, and the browser. Raises NotMeasuredError naming what is missing."""
    node = shutil.which("node", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}")
    if node is None:
        raise NotMeasuredError("Node.js is not installed")
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise NotMeasuredError("neither chromium nor google-chrome is installed")
    if not (web / "node_modules/playwright-core").is_dir():
        raise NotMeasuredError(f"the Node package playwright-core is missing; install it with: npm ci --prefix {web}")
    return [node, str(web / "tests/opening.mjs"), browser]


def _report_of_many(folder: Path) -> str:
    [outcome] = _run(folder, 10).outcomes
    results = Results.read(folder / "sim-results/results.json")
    many = tuple(outcome.model_copy(update={"name": f"run {number}"}) for number in range(MANY))
    return page(results.model_copy(update={"outcomes": many}), _options(folder)).text()


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

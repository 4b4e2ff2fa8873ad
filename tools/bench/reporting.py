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

from sim_action.reports import ReportOptions
from sim_action.reports.html.report import page
from sim_action.results.results_json import Results
from tools.bench.table import NotMeasuredError

ROOT: Final = Path(__file__).resolve().parents[2]
ROUNDS: Final = 7
MANY: Final = 66
SCENARIO: Final = """\
name: {name}
robot: {{model: turtlebot3_burger}}
world: {{objects: [{{name: wall, box: [0.1, 2, 0.5], pose: {{x: -3}}}}]}}
commands: {{rate: 10 Hz, twist: [{{linear: 0.5, angular: 0.2}}]}}
expect: [no_collision, {{upright: {{max_tilt: 20 deg}}}}]
time_limit: {seconds} s
"""


class ReportCost(NamedTuple):
    """The cost of one report.

    Attributes:
        written: s of processor time to write it.
        runs: s of the loops of all its runs.
        size: its bytes.
    """

    written: float
    runs: float
    size: int


def report_cost(count: int, seconds: int) -> ReportCost:
    """Measure the report of some runs; `seconds` of sim time each. The time is the least of several rounds."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        results = _run(folder, count, seconds)
        text = _text(results, folder)
        written = min(_seconds(results, folder) for _ in range(ROUNDS))
        loops = [
            one.sim_time / one.real_time_factor for one in results.outcomes if one.sim_time and one.real_time_factor
        ]
        assert len(loops) == count
        return ReportCost(written, sum(loops), len(text.encode()))


def opening_cost() -> float:
    """Return s until a headless browser shows the table of many runs. Raises NotMeasuredError."""
    command = opening_command()
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "many.html"
        file.write_text(_text(_run(Path(name), MANY, 10), Path(name)), encoding="utf-8")
        browser = command.pop()
        printed = subprocess.run([*command, str(file), browser], check=True, capture_output=True, text=True)
    return float(printed.stdout) / 1000


def opening_command(viewer: Path = ROOT / "tools/viewer") -> list[str]:
    """Return Node.js, the script that opens a page, and the browser. Raises NotMeasuredError naming what is missing."""
    node = shutil.which("node", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}")
    if node is None:
        raise NotMeasuredError("Node.js is not installed")
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise NotMeasuredError("neither chromium nor google-chrome is installed")
    if not (viewer / "node_modules/playwright-core").is_dir():
        raise NotMeasuredError(
            f"the Node package playwright-core is missing; install it with: npm ci --prefix {viewer}"
        )
    return [node, str(viewer / "tests/opening.mjs"), browser]


def _text(results: Results, folder: Path) -> str:
    text = page(results, _options(folder)).text()
    # A replay that is left out costs nothing.
    assert text.count('id="replay-') == len(results.outcomes)
    return text


def _run(folder: Path, count: int, seconds: int) -> Results:
    for number in range(count):
        text = SCENARIO.format(name=f"run {number}", seconds=seconds)
        (folder / f"{number}.sim.yml").write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "sim_action", "run", "."]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, env={"PYTHONPATH": str(ROOT)})
    return Results.read(folder / "sim-results/results.json")


def _options(folder: Path) -> ReportOptions:
    results = folder / "sim-results"
    return ReportOptions(results, results / "junit.xml", junit_strict=False, environment={}, workspace=folder)


def _seconds(results: Results, folder: Path) -> float:
    started = time.process_time()
    page(results, _options(folder)).text()
    return time.process_time() - started

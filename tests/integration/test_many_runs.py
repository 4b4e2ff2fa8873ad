"""Calls with many runs: the caller keeps little of each."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from sim_action.engines import installed
from sim_action.results.results_json import Results

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems tell no peak of memory in this way")
ROOT: Final = Path(__file__).parents[2]
FEW: Final = 20
MOST_KB_FOR_A_RUN: Final = 45
"""Of the caller: 7 kB for its plan and outcome, the rest for its place in `report.html`, which has 2,000 at most. 31 to
36 kB were measured."""

MOST_MB: Final = 200  # of the caller, with 10,000 runs and all reports

CALLER: Final = """
import re, sys
from pathlib import Path
from sim_action.cli.main import call, leave
code = call(sys.argv[1:])
Path("peak").write_text(re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())[1])
leave(code)
"""

SCENARIO: Final = """\
name: drive
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, twist: [{{linear: 1.0}}]}}
expect: [{{travel: {{at_least: 1 mm}}}}, {{upright: {{max_tilt: 10 deg}}}}]
duration: 0.2 s
time_limit: 0.2 s
backend: {engine}
variations: {{robot.pose.yaw: {{uniform: [-1 deg, 1 deg], samples: {samples}}}}}
"""


def peak_kb(folder: Path, samples: int) -> int:
    """The largest memory of the caller, in kB."""
    folder.mkdir()
    engine = "mujoco" if "mujoco" in installed() else installed()[0]
    (folder / "drive.sim.yml").write_text(SCENARIO.format(engine=engine, samples=samples))
    environment = {name: value for name, value in os.environ.items() if not name.startswith("GITHUB_")}
    subprocess.run(
        [sys.executable, "-c", CALLER, "run", "drive.sim.yml", "--quiet"],
        cwd=folder,
        env={**environment, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(folder.parent / "cache")},
        capture_output=True,
        check=True,
    )
    outcomes = Results.read(folder / "sim-results/results.json").outcomes if samples < 1_000 else ()
    assert [outcome.status for outcome in outcomes] in ([], ["passed"] * samples)
    return int((folder / "peak").read_text())


@pytest.mark.soak
@pytest.mark.parametrize("samples", [200, 10_000])
def test_a_call_keeps_little_of_each_run(tmp_path: Path, samples: int) -> None:
    few, many = peak_kb(tmp_path / "few", FEW), peak_kb(tmp_path / "many", samples)
    assert many - few < MOST_KB_FOR_A_RUN * (samples - FEW)
    assert many * 1_024 < MOST_MB * 1_000_000

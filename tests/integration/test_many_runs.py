"""Calls with many runs: the caller keeps little of each."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

import pytest

from sim_action.engines import installed
from sim_action.results.results_json import Results
from tests.integration.conftest import peak_kb

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems tell no peak of memory in this way")
FEW: Final = 20
MOST_KB_FOR_A_RUN: Final = 45
"""Of the caller: 7 kB for its plan and outcome, the rest for its place in `report.html`, which has 2,000 at most. 31 to
36 kB were measured."""

MOST_MB: Final = 200  # of the caller, with 10,000 runs and all reports
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


def peak_of(folder: Path, samples: int) -> int:
    """The largest memory of the caller, in kB."""
    folder.mkdir()
    engine = "mujoco" if "mujoco" in installed() else installed()[0]
    (folder / "drive.sim.yml").write_text(SCENARIO.format(engine=engine, samples=samples))
    code, peak = peak_kb(folder, "run", "drive.sim.yml", "--quiet")
    outcomes = Results.read(folder / "sim-results/results.json").outcomes if samples < 1_000 else ()
    assert (code, [outcome.status for outcome in outcomes]) in ((0, []), (0, ["passed"] * samples))
    return peak


@pytest.mark.soak
@pytest.mark.parametrize("samples", [200, 10_000])
def test_a_call_keeps_little_of_each_run(tmp_path: Path, samples: int) -> None:
    few, many = peak_of(tmp_path / "few", FEW), peak_of(tmp_path / "many", samples)
    assert many - few < MOST_KB_FOR_A_RUN * (samples - FEW)
    assert many * 1_024 < MOST_MB * 1_000_000

"""Temporal logic, combinations and classes of the user's, from the command line on a real engine."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import junitparser
import pytest

from sim_action.engines import installed
from tests.integration.conftest import sim_action

SCENARIO = """\
name: burger
robot: {{model: turtlebot3_burger}}
commands: {{twist: [{{linear: 0.2}}]}}
expect:
  - {expectation}
time_limit: 4 s
"""


def outcome(folder: Path, expectation: str, *arguments: str) -> dict[str, Any]:
    (folder / "s.sim.yml").write_text(SCENARIO.format(expectation=expectation))
    sim_action(folder, "run", *arguments, "s.sim.yml")
    (found,) = json.loads((folder / "sim-results/results.json").read_text())["outcomes"]
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize("engine", installed())
@pytest.mark.parametrize(
    ("formula", "expected", "time"),
    [
        # With 1 m/s^2 to 0.2 m/s: 0.02 m of way are lost, so 0.3 m are travelled at 1.6 s.
        ("eventually (travel >= 30 cm)", ("passed", "goals met"), 1.6),
        ("always (travel < 30 cm)", ("failed", "expectation failed"), 1.6),
        ("not (eventually (travel >= 30 cm))", ("failed", "expectation failed"), 1.6),
        ("always (travel > 10 cm implies eventually[0 s, 1 s] travel > 45 cm)", ("failed", "expectation failed"), 1.6),
        ("always (travel > 10 cm implies eventually[0 s, 2 s] travel > 45 cm)", ("passed", "time limit"), 4.0),
        ("travel < 20 cm until[0 s, 2 s] x > 19 cm", ("passed", "goals met"), 1.05),
        ("always (eventually (speed > 0.1 m/s))", ("passed", "time limit"), 4.0),
    ],
)
def test_a_run_ends_when_its_formula_is_decided(
    formula: str, expected: tuple[str, str], time: float, engine: str, tmp_path: Path
) -> None:
    found = outcome(tmp_path, f"stl: {formula}", "--backend", engine)
    assert (found["status"], found["end"]) == expected
    assert found["sim_time"] == pytest.approx(time, abs=0.03)


def test_its_robustness_is_the_margin_in_every_report(tmp_path: Path) -> None:
    found = outcome(tmp_path, "stl: always (speed < 0.5 m/s)")
    (expectation,) = found["expectations"]
    assert expectation["verdict"]["margin"] == pytest.approx(0.3, abs=0.01)
    assert expectation["verdict"]["unit"] == "m/s"
    names = [
        case.name for suite in junitparser.JUnitXml.fromfile(str(tmp_path / "sim-results/junit.xml")) for case in suite
    ]
    assert any(name.endswith(": stl always (speed < 0.5 m/s)") for name in names)


def test_a_summary_shows_its_text_and_no_tags(tmp_path: Path) -> None:
    (tmp_path / "s.sim.yml").write_text(SCENARIO.format(expectation="stl: always (speed < 0.1 and x > -1)"))
    sim_action(tmp_path, "run", "s.sim.yml", GITHUB_STEP_SUMMARY=str(tmp_path / "summary.md"), GITHUB_ACTIONS="true")
    summary = (tmp_path / "summary.md").read_text()
    assert "speed &lt; 0.1" in summary
    assert "speed < 0.1" not in summary


GOOD = """\
from sim_action import Verdict
print("was here")

class Far:
    kind = "goal"

    def __init__(self, metres):
        self.metres = metres

    def judge(self, trace):
        x = trace.base_position_xyz[:, 0]
        return Verdict(x.max() >= self.metres, x.max(), self.metres, x.max() - self.metres, "m", trace.time[x.argmax()])
"""


def test_a_class_of_the_users_is_a_goal(tmp_path: Path) -> None:
    (tmp_path / "far.py").write_text(GOOD)
    found = outcome(tmp_path, "assertion: {class: far.py:Far, with: {metres: 0.3}}")
    assert (found["status"], found["end"]) == ("passed", "goals met")
    assert found["sim_time"] == pytest.approx(1.6, abs=0.03)
    inside = outcome(tmp_path, "not: {assertion: {class: far.py:Far, with: {metres: 0.3}}}")
    assert (inside["status"], inside["end"]) == ("failed", "expectation failed")
    assert inside["sim_time"] == found["sim_time"]


def test_what_it_raises_is_an_error_at_its_line(tmp_path: Path) -> None:
    (tmp_path / "far.py").write_text(GOOD.replace("trace.base_position_xyz", "trace.base_position"))
    found = outcome(tmp_path, "assertion: {class: far.py:Far, with: {metres: 0.3}}")
    (failure,) = found["failures"]
    assert (found["status"], failure["kind"]) == ("error", "script")
    assert "Far.judge() raised AttributeError" in failure["message"]
    assert failure["location"]["file"].endswith("far.py")
    assert failure["location"]["line"] == 11


def test_validating_does_not_run_it_and_scripts_that_are_refused_are_not(tmp_path: Path) -> None:
    (tmp_path / "far.py").write_text(GOOD + "\nopen('ran', 'w')\n")
    (tmp_path / "s.sim.yml").write_text(SCENARIO.format(expectation="any_of: [{assertion: far.py:Far}]"))
    assert sim_action(tmp_path, "validate", "s.sim.yml").returncode == 0
    refused = sim_action(tmp_path, "run", "--allow-scripts", "false", "s.sim.yml")
    assert refused.returncode == 2
    assert "expect.0.any_of.0.assertion: scripts are not allowed" in refused.stdout + refused.stderr
    assert not (tmp_path / "ran").exists()

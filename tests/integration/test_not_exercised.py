"""An expectation that is never judged: exit code, reports, and the ways to accept it."""

from __future__ import annotations

from pathlib import Path

import junitparser
import pytest

from tests.integration.conftest import outcomes, sim_action

# The first reading comes at 1 s, after the window of the expectation has closed.
UNREAD = """\
name: range in front
robot: {model: turtlebot3_burger}
sensors: [{lidar: {rays: 10, range: 3.5 m}, name: scan, link: base_scan, rate: 1 Hz}]
expect:
  - sensor: {name: scan, reading: ranges, which: min, at_least: 0.2}
    name: free in front
    after: 0.2 s
    before: 0.6 s
  - upright
"""
TIMES = "time_limit: 1 s\n"


def test_every_report_shows_that_it_was_not_exercised(tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text(UNREAD + TIMES)
    output = tmp_path / "outputs.txt"
    run = sim_action(tmp_path, "run", "--verbose", GITHUB_ACTIONS="true", GITHUB_OUTPUT=str(output))
    assert run.returncode == 1, run.stdout + run.stderr
    assert "1 not exercised" in run.stdout
    assert "::error file=a.sim.yml,line=5" in run.stdout
    assert "not-exercised<<" in output.read_text()
    (suite,) = junitparser.JUnitXml.fromfile(str(tmp_path / "sim-results/junit.xml"))
    assert (suite.tests, suite.failures, suite.errors) == (2, 0, 1)
    ((error,),) = (case.result for case in suite if case.result)
    assert (type(error), error.type) == (junitparser.Error, "not_exercised")
    (outcome,) = outcomes(tmp_path)
    assert outcome["status"] == "not_exercised"
    unread, upright = (expected["verdict"]["judged"] for expected in outcome["expectations"])
    assert unread == {"moments": 0, "first": None, "last": None}
    assert upright["moments"] >= 240
    assert f"judged at {upright['moments']} moments, 0.00 s to 1.00 s" in run.stdout
    assert "Not exercised: something was never checked" in (tmp_path / "sim-results/report.html").read_text()


@pytest.mark.parametrize(
    ("own", "project", "options", "code"),
    [
        ("unexercised: warn\n", "", (), 0),
        ("", 'unexercised = "warn"', (), 0),
        ("unexercised: error\n", 'unexercised = "warn"', ("--unexercised", "warn"), 1),
    ],
)
def test_it_can_be_accepted_knowingly(
    own: str, project: str, options: tuple[str, ...], code: int, tmp_path: Path
) -> None:
    (tmp_path / ".git").mkdir()
    (tmp_path / "a.sim.yml").write_text(UNREAD + own + TIMES)
    if project:
        (tmp_path / "pyproject.toml").write_text(f"[tool.sim-action]\n{project}\n")
    run = sim_action(tmp_path, "run", *options)
    assert run.returncode == code, run.stdout + run.stderr
    assert ("1 passed, 1 warning" if code == 0 else "1 not exercised") in run.stdout


# The robot never drives as far as the premise asks.
WARNS = """\
name: warns
robot: {model: turtlebot3_burger}
commands: {twist: [{linear: 0.5, for: 1 s}]}
expect:
  - stl: "always (x > 5 m implies yaw < 1 rad)"
    name: straight
time_limit: 1 s
"""
RULE = "premise-never-held"


def test_a_strict_run_fails_by_the_rule_of_a_warning(tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text(WARNS)
    run = sim_action(tmp_path, "run", "--strict", GITHUB_ACTIONS="true")
    assert run.returncode == 1, run.stdout + run.stderr
    assert f"::error file=a.sim.yml,line=5,col=5,title=warns%3A {RULE}::" in run.stdout
    (suite,) = junitparser.JUnitXml.fromfile(str(tmp_path / "sim-results/junit.xml"))
    assert (suite.tests, suite.failures, suite.errors) == (2, 1, 0)
    ((failure,),) = (case.result for case in suite if case.result)
    assert (type(failure), failure.type) == (junitparser.Failure, RULE)
    (outcome,) = outcomes(tmp_path)
    assert (outcome["status"], outcome["strict"], outcome["warnings"][0]["rule"]) == ("failed", True, RULE)


def test_a_strict_check_fails_by_what_is_known_before_the_run(tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text(WARNS.replace("for: 1 s", "for: 1000 s"))
    assert sim_action(tmp_path, "validate").returncode == 0
    run = sim_action(tmp_path, "validate", "--strict")
    assert (run.returncode, "error:" in run.stdout, "[segment-beyond-run]" in run.stdout) == (1, True, True)

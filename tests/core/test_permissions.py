from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario
from sim_action.core.permissions import Permissions, scripts_refused
from sim_action.scenario.loading import load_scenario

SCRIPTED = """\
name: n
robot: {model: turtlebot3_burger}
commands:
  - twist: [{linear: 1.0}]
  - script: controller.py
expect: [no_collision]
time_limit: 1 s
"""


@pytest.mark.parametrize("event", ["push", "pull_request", "schedule", ""])
def test_scripts_run_where_only_the_rights_of_their_author_are_at_stake(event: str) -> None:
    assert scripts_refused("auto", {"GITHUB_EVENT_NAME": event}) is None


@pytest.mark.parametrize("event", ["pull_request_target", "workflow_run"])
def test_scripts_are_refused_where_the_rights_of_the_base_branch_are(event: str) -> None:
    refusal = scripts_refused("auto", {"GITHUB_EVENT_NAME": event})
    assert refusal is not None
    assert event in refusal
    assert "allow-scripts" in refusal


def test_on_ones_own_machine_scripts_run() -> None:
    assert scripts_refused("auto", {}) is None


def test_the_caller_decides() -> None:
    assert scripts_refused("true", {"GITHUB_EVENT_NAME": "pull_request_target"}) is None
    assert scripts_refused("false", {"GITHUB_EVENT_NAME": "push"}) is not None


def test_a_refused_script_is_an_error_on_its_line(tmp_path: Path) -> None:
    (tmp_path / "controller.py").write_text("def control(observation): ...\n")
    path = tmp_path / "scripted.sim.yml"
    path.write_text(SCRIPTED)
    assert load_scenario(path).scenario.runs_user_code
    with pytest.raises(InvalidScenario) as caught:
        load_scenario(path, Permissions(scripts_refused="no scripts here"))
    [problem] = caught.value.problems
    assert problem.location.line == 5
    assert problem.message == "commands.1.script: no scripts here"


def test_scenarios_without_scripts_run_all_the_same(tmp_path: Path) -> None:
    path = tmp_path / "driven.sim.yml"
    path.write_text(SCRIPTED.replace("  - script: controller.py\n", ""))
    load_scenario(path, Permissions(scripts_refused="no scripts here"))

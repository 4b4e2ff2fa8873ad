"""xacro as a scenario has it: evaluated where it runs, read as text everywhere else."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario, RefusedModel
from sim_action.core.workspace import Permissions, Workspace
from sim_action.robot.loading import check_text, load_model
from sim_action.robot.spec import Robot
from sim_action.scenario.loading import load_scenario

MODEL = """\
<robot name="bot" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="mass" default="2"/>
  <link name="base">
    <inertial>
      <mass value="$(arg mass)"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="${2 / 2}"/>
    </inertial>
  </link>
</robot>
"""
SCENARIO = """\
name: n
robot: {model: bot.urdf.xacro}
expect: [{joint: {name: elbow, at_most: 1}}]
time_limit: 1 s
"""


def robot(folder: Path, text: str = MODEL, **keys: object) -> Robot:
    (folder / "bot.urdf.xacro").write_text(text)
    return Robot.model_validate({"model": "bot.urdf.xacro", **keys})


def refusal(folder: Path, text: str, **keys: object) -> str:
    with pytest.raises(RefusedModel) as refused:
        load_model(robot(folder, text, **keys), Workspace(folder, folder))
    return str(refused.value)


def test_arguments_make_the_model(tmp_path: Path) -> None:
    assert load_model(robot(tmp_path), Workspace(tmp_path, tmp_path)).mass == 2
    assert load_model(robot(tmp_path, args={"mass": 5}), Workspace(tmp_path, tmp_path)).mass == 5


@pytest.mark.parametrize(
    ("old", "new", "line", "rule"),
    [
        ("${2 / 2}", "${whatever}", 6, "bad-xacro"),
        ("${2 / 2}", "${1 / 0}", 6, "bad-xacro"),
        ("${2 / 2}", "${-2}", 6, "impossible-inertia"),
        ('value="$(arg mass)"', "", 5, "missing-part"),
        ('default="2"/>', 'default="2"/><xacro:include filename="absent.xacro"/>', 2, "missing-include"),
        ('default="2"/>', 'default="2"/><xacro:include filename="$(find absent)/a.xacro"/>', 2, "missing-package"),
    ],
)
def test_what_is_wrong_is_told_on_the_line_of_the_xacro_file(
    old: str, new: str, line: int, rule: str, tmp_path: Path
) -> None:
    assert old in MODEL
    message = refusal(tmp_path, MODEL.replace(old, new))
    assert message.startswith(f"{tmp_path}/bot.urdf.xacro:{line}:")
    assert message.endswith(f"[{rule}]")
    assert message.count("bot.urdf.xacro:") == 1


def test_arguments_that_there_are_not(tmp_path: Path) -> None:
    assert refusal(tmp_path, MODEL, args={"mas": 1}).endswith("[unknown-argument]")


def test_nothing_is_evaluated_when_it_is_read_as_text(tmp_path: Path) -> None:
    text = MODEL.replace("${2 / 2}", "${1 / 0}")
    notes = check_text(robot(tmp_path, text), Workspace(tmp_path, tmp_path))
    assert any("evaluated only when the scenario runs" in note for note in notes)


def test_a_scenario_says_what_was_left_unchecked_and_checks_it_where_it_runs(tmp_path: Path) -> None:
    robot(tmp_path)
    path = tmp_path / "s.sim.yml"
    path.write_text(SCENARIO)
    loaded = load_scenario(path)
    assert loaded.scenario.runs_user_code
    assert "what is said of links and joints: " in loaded.unchecked[0]
    assert len(loaded.unchecked) == 1
    with pytest.raises(InvalidScenario, match="no moving joint 'elbow'"):
        load_scenario(path, evaluate=True)


def test_xacro_counts_as_a_script(tmp_path: Path) -> None:
    robot(tmp_path)
    path = tmp_path / "s.sim.yml"
    path.write_text(SCENARIO)
    with pytest.raises(InvalidScenario, match=r"s\.sim\.yml:2:9: robot\.model: no scripts here"):
        load_scenario(path, Permissions(scripts_refused="no scripts here"))

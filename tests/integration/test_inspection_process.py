"""What is evaluated for a look at a model: in a process of its own, which is ended with all that it has begun."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import pytest

from sim_action.app.inspect import inspect_apart
from sim_action.core.errors import ModelError
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_spec import Robot
from sim_action.scenario.model import MEMORY
from tests.integration.conftest import sim_action

MODEL: Final = """\
<robot name="bot" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="p" value="{value}"/>
  <link name="base">
    <inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><geometry><sphere radius="${{p}}"/></geometry></collision>
  </link>
</robot>
"""

MJCF: Final = """\
<mujoco><worldbody><body name="base"><geom size="0.1" mass="2"/>
  <replicate count="{count}" offset="1 0 0"><replicate count="200" offset="0 1 0">
    <geom size="0.1" mass="0"/>
  </replicate></replicate></body></worldbody></mujoco>
"""


def mass(folder: Path, name: str, text: str, seconds: float = 60, memory: int = MEMORY) -> float:
    """The mass that a look of a limited time finds."""
    (folder / name).write_text(text)
    return inspect_apart(Robot(model=name), Workspace(folder, folder), seconds, memory).mass


@pytest.mark.parametrize(
    ("value", "seconds", "message"),
    [
        ("${9**9**9}", 1, "^bot.xacro: the evaluation was stopped after 1 s; check the file for an endless recursion$"),
        ("${len('a' * 10**10)}", 60, "bot.xacro:5: out of memory"),
    ],
)
def test_an_evaluation_that_takes_too_much_is_ended(value: str, seconds: int, message: str, tmp_path: Path) -> None:
    assert mass(tmp_path, "bot.xacro", MODEL.format(value="${1 / 2}"), memory=1 << 29) == 2.0
    with pytest.raises(ModelError, match=message):
        mass(tmp_path, "bot.xacro", MODEL.format(value=value), seconds, memory=1 << 29)


def test_mjcf_is_limited_too(tmp_path: Path) -> None:
    """MuJoCo needs more than a minute for 200 x 200 shapes."""
    assert mass(tmp_path, "bot.xml", MJCF.format(count=1)) == 2.0
    message = "^bot.xml: reading it was stopped after 1 s; simplify the model, or reduce the counts of <replicate>$"
    with pytest.raises(ModelError, match=message):
        mass(tmp_path, "bot.xml", MJCF.format(count=200), 1)


@pytest.mark.parametrize(("value", "line", "rule"), [("${1 / 0}", 5, "bad-xacro"), ("${-1}", 5, "bad-shape")])
def test_the_command_says_what_is_wrong_and_where(value: str, line: int, rule: str, tmp_path: Path) -> None:
    (tmp_path / "bot.xacro").write_text(MODEL.format(value=value))
    inspected = sim_action(tmp_path, "inspect", "bot.xacro")
    assert (inspected.returncode, inspected.stdout) == (2, "")
    assert inspected.stderr.startswith(f"sim-action: bot.xacro:{line}: ")
    assert inspected.stderr.endswith(f"[{rule}]\n")

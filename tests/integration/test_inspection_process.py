"""What is evaluated for a look at a model: in a process of its own, which is ended with all that it has begun."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

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

# The bound of time is one that a test can wait for, where it is waited for.
CALLER: Final = """
import sys
from pathlib import Path
from sim_action.core.errors import ModelError
from sim_action.app.inspect import inspect_apart
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_spec import Robot

here = Path.cwd()
try:
    seconds = float(sys.argv[1])
    memory = int(sys.argv[3])
    print(inspect_apart(Robot(model=sys.argv[2]), Workspace(here, here), seconds=seconds, memory=memory).mass)
except ModelError as error:
    sys.exit(str(error))
"""


MJCF: Final = """\
<mujoco><worldbody><body name="base"><geom size="0.1" mass="2"/>
  <replicate count="{count}" offset="1 0 0"><replicate count="200" offset="0 1 0">
    <geom size="0.1" mass="0"/>
  </replicate></replicate></body></worldbody></mujoco>
"""


def looked(folder: Path, value: str, seconds: float = 60) -> subprocess.CompletedProcess[str]:
    return inspected(folder, "bot.xacro", MODEL.format(value=value), seconds, memory=1 << 29)


def inspected(
    folder: Path, name: str, text: str, seconds: float, memory: int = MEMORY
) -> subprocess.CompletedProcess[str]:
    (folder / name).write_text(text)
    call = [sys.executable, "-c", CALLER, str(seconds), name, str(memory)]
    return subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)


def test_what_is_evaluated_in_time_is_told(tmp_path: Path) -> None:
    found = looked(tmp_path, "${1 / 2}")
    assert (found.returncode, found.stdout, found.stderr) == (0, "2.0\n", "")


def test_what_is_never_done_is_ended(tmp_path: Path) -> None:
    found = looked(tmp_path, "${9**9**9}", seconds=1)
    assert found.returncode == 1
    assert found.stderr == "bot.xacro: the evaluation was stopped after 1 s; check the file for an endless recursion\n"


def test_what_takes_too_much_memory_is_told(tmp_path: Path) -> None:
    found = looked(tmp_path, "${len('a' * 10**10)}")
    assert found.returncode == 1
    assert "bot.xacro:5: out of memory" in found.stderr


def test_mjcf_is_limited_too(tmp_path: Path) -> None:
    """MuJoCo needs more than a minute for 200 x 200 shapes."""
    found = inspected(tmp_path, "bot.xml", MJCF.format(count=1), 60)
    assert (found.returncode, found.stdout, found.stderr) == (0, "2.0\n", "")
    found = inspected(tmp_path, "bot.xml", MJCF.format(count=200), 1)
    message = "bot.xml: reading it was stopped after 1 s; simplify the model, or reduce the counts of <replicate>\n"
    assert (found.returncode, found.stderr) == (1, message)


@pytest.mark.parametrize(("value", "line", "rule"), [("${1 / 0}", 5, "bad-xacro"), ("${-1}", 5, "bad-shape")])
def test_the_command_says_what_is_wrong_and_where(value: str, line: int, rule: str, tmp_path: Path) -> None:
    (tmp_path / "bot.xacro").write_text(MODEL.format(value=value))
    inspected = sim_action(tmp_path, "inspect", "bot.xacro")
    assert (inspected.returncode, inspected.stdout) == (2, "")
    assert inspected.stderr.startswith(f"sim-action: bot.xacro:{line}: ")
    assert inspected.stderr.endswith(f"[{rule}]\n")

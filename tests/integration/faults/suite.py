"""The suites that run under faults: six short scenarios of all kinds, and three that pass."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from tests.mesh_files import stl

_BOX: Final = """\
<robot name="box">
  <link name="base">
    <inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    <collision><geometry><mesh filename="box.stl"/></geometry></collision>
  </link>
</robot>
"""
_SCRIPT: Final = """\
import time

from sim_action import Twist


def control(observation):
    # A controller may read the clock, and must not depend on it.
    time.time()
    return Twist.planar(0.5)
"""
_SCENARIO: Final = """\
name: {name}
robot: {{model: {model}}}
physics: {{settle: 0}}
{commands}
expect: [{expected}]
time_limit: 0.4 s
"""
_DRIVES: Final = "commands: {twist: [{linear: 0.5}]}"
_UPRIGHT: Final = "upright: {max_tilt: 10 deg}"

SUFFIX: Final = ".sim.yml"
"""The file of a scenario has its name and this; a file that cannot be read is reported by its own name."""

MESH: Final = "mesh"  # the name of the scenario with a mesh

_SCENARIOS: Final = {
    "drives": ("turtlebot3_burger", _DRIVES, "travel: {at_least: 0.05 m}"),
    "stays short": ("turtlebot3_burger", _DRIVES, "travel: {at_least: 5 m}"),
    "script": ("turtlebot3_burger", "commands: {script: drive.py}", "travel: {at_least: 0.05 m}"),
    MESH: ("box.urdf", "", _UPRIGHT),
    "stands": ("turtlebot3_burger", "", _UPRIGHT),
    "too fast": ("turtlebot3_burger", _DRIVES, "max_speed: {linear: 0.1}"),
}
# A script has an interpreter of its own, which takes as long as all others together.
_LEFT_OUT: Final = ("stays short", "too fast", "script")

NAMES: Final = {"mixed": tuple(_SCENARIOS), "passing": tuple(name for name in _SCENARIOS if name not in _LEFT_OUT)}
"""Name of a suite -> the names of its scenarios. The exit code of the second shows each verdict that is lost."""


def write_suite(folder: Path, suite: str) -> None:
    """Write the files of a suite into a new folder."""
    folder.mkdir(parents=True)
    (folder / "box.stl").write_bytes(stl())
    (folder / "box.urdf").write_text(_BOX)
    (folder / "drive.py").write_text(_SCRIPT)
    for name in NAMES[suite]:
        model, commands, expected = _SCENARIOS[name]
        text = _SCENARIO.format(name=name, model=model, commands=commands, expected=expected)
        (folder / f"{name}{SUFFIX}").write_text(text)

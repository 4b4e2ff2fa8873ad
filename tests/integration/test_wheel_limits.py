"""Robots on real engines whose wheels are asked for more than their joints can."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from sim_action.engines import installed
from sim_action.simulation.loop import SimulationRun
from sim_action.simulation.start_checks import BOLTED
from tests.simulated import simulated

DRIVES: Final = Path(__file__).parents[2] / "examples/drives"
FASTEST: Final = 5.0  # in rad/s, of every wheel; their radius is 0.1 m

SIDES: Final = (
    "left: [front_left_wheel_joint, rear_left_wheel_joint], right: [front_right_wheel_joint, rear_right_wheel_joint]"
)
SCENARIO: Final = """\
name: n
robot: {{model: robot.urdf{drive}}}
commands: [{{twist: [{{linear: {linear}, angular: {angular}}}]}}]
expect: [{{travel: {{at_least: 1 mm}}}}]
duration: 4 s
time_limit: 4 s
backend: {engine}
"""
ROVER: Final = {name: f", drive: {{{name}: {{{SIDES}}}}}" for name in ("diff", "skid", "mecanum")}


def run(folder: Path, engine: str, drive: str, linear: float, angular: float) -> SimulationRun:
    source = "rover.urdf" if drive in ROVER else "car.urdf"
    limited = re.sub(r'velocity="50"', f'velocity="{FASTEST}"', (DRIVES / source).read_text())
    (folder / "robot.urdf").write_text(limited)
    text = SCENARIO.format(drive=ROVER.get(drive, ""), linear=linear, angular=angular, engine=engine)
    return simulated(folder, text)


@pytest.mark.parametrize("engine", installed())
@pytest.mark.parametrize("drive", [*ROVER, "ackermann"])
def test_a_twist_beyond_the_limits_is_the_fastest_within_them_on_the_same_curve(
    engine: str, drive: str, tmp_path: Path
) -> None:
    fast = run(tmp_path, engine, drive, 3.0, 1.0)
    # Those that each of them drives.
    wheels = [index for index, name in enumerate(fast.trace.joint_names) if name.startswith("rear")]
    assert np.abs(fast.trace.joint_velocity[:, wheels]).max() == pytest.approx(FASTEST, rel=0.05)
    (note,) = (note for note in fast.notes if "a twist asked joint" in note)
    limited = re.search(r"for ([\d.]+) deg/s, but its limit in the model is ([\d.]+) deg/s", note)
    assert limited is not None
    share = float(limited[2]) / float(limited[1])
    within = run(tmp_path, engine, drive, 3.0 * share * 0.999, 1.0 * share * 0.999)
    assert not any("a twist asked joint" in note for note in within.notes)
    assert fast.trace.base_position_xyz[-1] == pytest.approx(within.trace.base_position_xyz[-1], abs=0.02)
    assert fast.trace.yaw[-1] == pytest.approx(within.trace.yaw[-1], abs=0.01)


@pytest.mark.parametrize("engine", installed())
def test_a_twist_for_a_robot_that_is_bolted_down_is_noted(engine: str, tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_bytes((DRIVES / "rover.urdf").read_bytes())
    text = SCENARIO.format(drive=", base: fixed", linear=0.1, angular=0, engine=engine)
    text = text.replace("[{travel: {at_least: 1 mm}}]", "[upright]").replace("4 s", "0.2 s") + "allow: [fixed-base]\n"
    assert BOLTED in simulated(tmp_path, text).notes
    assert BOLTED not in simulated(tmp_path, text.replace("base: fixed", "base: free")).notes

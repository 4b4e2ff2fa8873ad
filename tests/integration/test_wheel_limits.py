"""Joints and wheels that are asked for more than the model says that they can, on every engine."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from sim_action.engines import installed
from sim_action.simulation.loop import SimulationRun
from sim_action.simulation.start_checks import BOLTED
from tests.integration.engines import inertia
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


WHEEL: Final = f"""\
<robot name="wheel">
  <link name="base"><inertial><mass value="1"/>{inertia(1)}</inertial></link>
  <joint name="axle" type="continuous"><parent link="base"/><child link="rim"/><axis xyz="0 0 1"/>
    <limit effort="2" velocity="3"/></joint>
  <link name="rim"><inertial><mass value="1"/>{inertia(0.5)}</inertial></link>
</robot>
"""
TURNS: Final = """\
name: n
robot: {{model: wheel.urdf, base: fixed}}
physics: {{settle: 0}}
commands: {{script: ctl.py}}
expect: [{{joint: {{name: axle, reading: velocity, at_most: 100}}}}]
time_limit: 1 s
backend: {engine}
"""


def turned(folder: Path, engine: str, targets: str) -> SimulationRun:
    (folder / "wheel.urdf").write_text(WHEEL)
    script = f"from sim_action import JointTargets\ndef control(seen): return JointTargets({targets})\n"
    (folder / "ctl.py").write_text(script)
    return simulated(folder, TURNS.format(engine=engine))


@pytest.mark.parametrize("engine", installed())
def test_an_effort_beyond_the_limit_turns_a_wheel_as_the_limit_does(engine: str, tmp_path: Path) -> None:
    most, beyond = (turned(tmp_path, engine, f"effort={{'axle': {effort}}}") for effort in (2, 50))
    # 2 N m turn 0.5 kg m^2 by 4 rad/s in each second.
    assert beyond.trace.joint_velocity[-1, 0] == pytest.approx(4.0, rel=0.01)
    assert beyond.digest == most.digest
    assert any("commanded 50 N m for joint 'axle'; it was clipped to 2 N m" in note for note in beyond.notes)
    assert not any("commanded " in note for note in most.notes)


@pytest.mark.parametrize("engine", installed())
def test_a_velocity_beyond_the_limit_is_the_limit(engine: str, tmp_path: Path) -> None:
    trace = turned(tmp_path, engine, "velocity={'axle': 50}, max_effort={'axle': 1e6}").trace
    halfway = trace.joint_velocity[len(trace) // 2, 0]
    # Half a second takes it to 2 rad/s, by its own 2 N m and no more.
    assert halfway == pytest.approx(2.0, rel=0.02)
    assert trace.joint_velocity[-1, 0] == pytest.approx(3.0, rel=0.01)


@pytest.mark.parametrize("engine", installed())
@pytest.mark.parametrize("column", ["velocity", "effort"])
def test_a_log_saturates_as_a_script_does(engine: str, column: str, tmp_path: Path) -> None:
    scripted = turned(tmp_path, engine, f"{column}={{'axle': 50}}")
    (tmp_path / "log.csv").write_text(f"time,{column}.axle\n0,50\n")
    replayed = simulated(tmp_path, TURNS.format(engine=engine).replace("script: ctl.py", "replay: log.csv"))
    assert replayed.digest == scripted.digest
    (note,) = (note for note in scripted.notes if "commanded " in note)
    assert note.replace("ctl.py", "log.csv") in replayed.notes

"""Motors of a script give what the model says that they can, on every engine."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import pytest

from sim_action.engines import installed
from sim_action.simulation.loop import SimulationRun
from tests.integration.engines import inertia
from tests.simulated import simulated

WHEEL: Final = f"""\
<robot name="wheel">
  <link name="base"><inertial><mass value="1"/>{inertia(1)}</inertial></link>
  <joint name="axle" type="continuous"><parent link="base"/><child link="rim"/><axis xyz="0 0 1"/>
    <limit effort="2" velocity="3"/></joint>
  <link name="rim"><inertial><mass value="1"/>{inertia(0.5)}</inertial></link>
</robot>
"""
SCENARIO: Final = """\
name: n
robot: {{model: wheel.urdf, base: fixed}}
physics: {{settle: 0}}
commands: {{script: ctl.py}}
expect: [{{joint: {{name: axle, reading: velocity, at_most: 100}}}}]
time_limit: 1 s
backend: {engine}
"""


def run(folder: Path, engine: str, targets: str) -> SimulationRun:
    (folder / "wheel.urdf").write_text(WHEEL)
    script = f"from sim_action import JointTargets\ndef control(seen): return JointTargets({targets})\n"
    (folder / "ctl.py").write_text(script)
    return simulated(folder, SCENARIO.format(engine=engine))


@pytest.mark.parametrize("engine", installed())
def test_an_effort_beyond_the_limit_turns_a_wheel_as_the_limit_does(engine: str, tmp_path: Path) -> None:
    most, beyond = (run(tmp_path, engine, f"effort={{'axle': {effort}}}") for effort in (2, 50))
    # 2 N m turn 0.5 kg m^2 by 4 rad/s in each second.
    assert beyond.trace.joint_velocity[-1, 0] == pytest.approx(4.0, rel=0.01)
    assert beyond.digest == most.digest
    assert any("commanded 50 N m for joint 'axle'; it was clipped to 2 N m" in note for note in beyond.notes)
    assert not any("commanded " in note for note in most.notes)


@pytest.mark.parametrize("engine", installed())
def test_a_velocity_beyond_the_limit_is_the_limit(engine: str, tmp_path: Path) -> None:
    trace = run(tmp_path, engine, "velocity={'axle': 50}, max_effort={'axle': 1e6}").trace
    halfway = trace.joint_velocity[len(trace) // 2, 0]
    # Half a second takes it to 2 rad/s, by its own 2 N m and no more.
    assert halfway == pytest.approx(2.0, rel=0.02)
    assert trace.joint_velocity[-1, 0] == pytest.approx(3.0, rel=0.01)


@pytest.mark.parametrize("engine", installed())
@pytest.mark.parametrize("column", ["velocity", "effort"])
def test_a_log_saturates_as_a_script_does(engine: str, column: str, tmp_path: Path) -> None:
    scripted = run(tmp_path, engine, f"{column}={{'axle': 50}}")
    (tmp_path / "log.csv").write_text(f"time,{column}.axle\n0,50\n")
    replayed = simulated(tmp_path, SCENARIO.format(engine=engine).replace("script: ctl.py", "replay: log.csv"))
    assert replayed.digest == scripted.digest
    (note,) = (note for note in scripted.notes if "commanded " in note)
    assert note.replace("ctl.py", "log.csv") in replayed.notes

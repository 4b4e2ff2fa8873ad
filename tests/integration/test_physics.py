"""The burger with the plugin of Gazebo, in the tutorial, at rest and while it settles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sim_action import robot as models
from sim_action.engines import ENGINES, chosen
from sim_action.engines.engine import Engine
from sim_action.simulation.loop import SimulationRun
from tests.simulated import run_of, simulated


def run_burger(folder: Path, seconds: float, pose: dict[str, float], **keys: Any) -> SimulationRun:
    robot = {"model": "turtlebot3_burger", "pose": pose}
    ends = {"expect": ["upright"], "duration": seconds, "time_limit": seconds}
    return simulated(folder, {"name": "burger", "robot": robot, **ends, **keys})


def drive(folder: Path, twist: dict[str, float], seconds: float, **keys: Any) -> SimulationRun:
    return run_burger(folder, seconds, {}, commands={"rate": 10, "twist": [twist]}, **keys)


def plugged_burger(folder: Path, legacy: str) -> str:
    """The burger with the diff drive plugin of ROS 1, which says `legacy`; its file below the folder."""
    text = Path(models.__file__).with_name("built_in").joinpath("turtlebot3_burger.urdf").read_text(encoding="utf-8")
    joints = "<leftJoint>wheel_left_joint</leftJoint><rightJoint>wheel_right_joint</rightJoint>"
    plugin = f'<gazebo><plugin filename="libgazebo_ros_diff_drive.so">{joints}{legacy}</plugin></gazebo>'
    (folder / "burger.urdf").write_text(text.replace("</robot>", f"{plugin}</robot>"))
    return "burger.urdf"


@pytest.mark.parametrize(("legacy", "way"), [("<legacyMode>false</legacyMode>", 1), ("", -1)])
def test_a_curve_bends_the_way_that_gazebos_plugin_turns(legacy: str, way: int, tmp_path: Path) -> None:
    robot = {"model": plugged_burger(tmp_path, legacy)}
    run = drive(tmp_path, {"linear": 0.2, "angular": 0.5}, 3, robot=robot)
    x, y, _ = run.trace.base_position_xyz[-1]
    # Of a circle of 0.4 m, 1.5 rad less what it takes to speed up.
    assert x == pytest.approx(0.4, abs=0.03)
    assert way * y == pytest.approx(0.37, abs=0.05)
    assert any("sides swapped" in note for note in run.notes) == (way < 0)


def test_the_tutorials_scenario_reaches_its_goal_when_the_ramp_says() -> None:
    # 0.5 m while it ramps to 1 m/s within 1 s, 1 m in the second after that.
    run = run_of(Path(__file__).parents[2] / "examples/turtlebot3/straight_line.sim.yml")
    (verdict,) = run.verdicts
    assert verdict.passed
    assert verdict.time == pytest.approx(2.00, abs=0.02)


def test_the_burger_stands_still_without_commands(tmp_path: Path) -> None:
    run = drive(tmp_path, {"linear": 0.0}, 10)
    assert run.travelled < 0.002
    assert not any("not at rest" in note for note in run.notes)


def test_a_robot_that_sinks_while_it_settles_is_told_of(tmp_path: Path) -> None:
    # On one leg, beside its centre of mass.
    inertia = '<inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
    leg = '<collision><origin xyz="0.1 0 0"/><geometry><box size="0.02 0.02 0.5"/></geometry></collision>'
    (tmp_path / "leg.urdf").write_text(f'<robot name="r"><link name="base">{inertia}{leg}</link></robot>')
    run = simulated(tmp_path, "name: leg\nrobot: {model: leg.urdf}\nexpect: [upright]\ntime_limit: 1 s\n")
    assert any(
        note.startswith("while the robot settled, before t = 0, its base link 'base' tilted by") for note in run.notes
    )


@pytest.mark.parametrize(
    ("physics", "steps"),
    [
        ({"settle": 0}, 0),
        ({"settle": 0.04}, 10),
        ({"settle": 0.25}, 60),
        ({"rate": 4, "settle": 0.5}, 2),
        ({"rate": 1, "settle": 2}, 2),
    ],
)
def test_settling_lasts_as_long_as_its_limit(
    physics: dict[str, float], steps: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = []

    def counted(backend: Engine, first_step: int, targets: list[object]) -> None:
        taken.append(len(targets) if first_step < 0 else 0)
        advance(backend, first_step, targets)

    engine: Any = ENGINES[chosen("auto")].load()
    advance = engine.advance
    monkeypatch.setattr(engine, "advance", counted)
    run = run_burger(tmp_path, 1, {"z": 500}, physics=physics)
    assert sum(taken) == steps
    assert any("not at rest" in note for note in run.notes) == (steps > 0)


# MuJoCo's contacts are softer: there, it takes longer.
@pytest.mark.pybullet
def test_a_robot_that_came_to_rest_in_a_short_time_is_not_noted(tmp_path: Path) -> None:
    assert run_burger(tmp_path, 1, {"x": 1}, physics={"settle": 0.04}).notes == ()

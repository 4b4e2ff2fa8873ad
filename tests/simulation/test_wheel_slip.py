"""How far wheels roll, move and slide, for motions whose answer is known."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action import robot as models
from sim_action.core import geometry
from sim_action.core.workspace import Workspace
from sim_action.drives import Drive, recognise
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.simulation.accuracy import wheel_slip
from sim_action.simulation.wheel_slip import WheelSlip
from sim_action.state.trace import Trace
from sim_action.world import Physics, World
from sim_action.world.scene import Scene

RATE = 240.0
RADIUS, SEPARATION = 0.033, 0.160


def burger(folder: Path, friction: str = "0.1", right: str = "") -> RobotModel:
    """The built-in robot with this friction of its wheels in tags of Gazebo."""
    text = Path(models.__file__).with_name("built_in").joinpath("turtlebot3_burger.urdf").read_text(encoding="utf-8")
    both = (("left", friction), ("right", right or friction))
    tags = "".join(f'<gazebo reference="wheel_{side}_link"><mu1>{mu}</mu1></gazebo>' for side, mu in both)
    path = folder / "burger.urdf"
    path.write_text(text.replace("</robot>", f"{tags}</robot>"), encoding="utf-8")
    return read_urdf(path)


def watch(model: RobotModel, drive: Drive | None = None, base: str | None = None) -> WheelSlip | None:
    robot = Robot.model_construct(model="burger.urdf", base=base)  # type: ignore[arg-type] # text is one of the literals
    folder = Path(model.source).parent
    scene = Scene(robot, model, World(), Physics(rate=RATE), Workspace(folder, folder))
    return wheel_slip(scene, drive or recognise(model))


def told(slip: WheelSlip) -> tuple[str, list[float]]:
    """The note, and the lengths in it in m."""
    (note,) = slip.notes()
    return note, [float(way) for way in re.findall(r"([\d.e-]+) m\b", note)]


def moving(model: RobotModel, speed: float, turn: float, left: float, right: float) -> Trace:
    """A second with these speeds of the base in m/s and rad/s, and of the rims in m/s."""
    rows = []
    for step in range(1, round(RATE) + 1):
        yaw = turn * step / RATE
        twist = (speed * math.cos(yaw), speed * math.sin(yaw), 0.0, 0.0, 0.0, turn)
        pose = (0.0, 0.0, 0.01, *geometry.quaternion_from_rpy(0.0, 0.0, yaw))
        rows.append([step / RATE, *pose, *twist, 0.0, 0.0, left / RADIUS, right / RADIUS, 0.0, 0.0])
    names = tuple(joint.name for joint in model.moving_joints)
    assert names == ("wheel_left_joint", "wheel_right_joint")
    return Trace(names, np.array(rows))


@given(speed=st.floats(-1, 1), turn=st.floats(-3, 3))
def test_wheels_that_roll_do_not_slide(tmp_path_factory: pytest.TempPathFactory, speed: float, turn: float) -> None:
    model = burger(tmp_path_factory.getbasetemp())
    slip = watch(model)
    assert slip is not None
    left, right = speed - turn * SEPARATION / 2, speed + turn * SEPARATION / 2
    slip.add(moving(model, speed, turn, left, right))
    note, ways = told(slip)
    rolled = (abs(left) + abs(right)) / 2
    if rolled < 2e-3:
        return
    assert note.startswith("wheels did not slip: ")
    assert ways[:2] == pytest.approx([rolled, rolled], rel=0.01)
    assert ways[2] < 0.001 * rolled + 1e-9


def test_wheels_that_spin_slide(tmp_path: Path) -> None:
    model = burger(tmp_path)
    slip = watch(model)
    assert slip is not None
    trace = moving(model, 0.3, 0.0, 0.5, 0.5)
    slip.add(trace.rows(slice(100)))
    slip.add(trace.rows(slice(100, None)))
    note, ways = told(slip)
    assert ways == pytest.approx([0.5, 0.3, 0.2])
    assert note == (
        "wheels slipped: rims rolled 0.5 m, the wheels moved 0.3 m and slid 0.2 m over the ground "
        "(mean of the wheels); the model gives wheels a friction of 0.1"
    )


def test_a_robot_that_stays_is_told_what_will_happen(tmp_path: Path) -> None:
    slip = watch(burger(tmp_path))
    assert slip is not None
    assert list(slip.notes()) == [
        "the model gives wheels a friction of 0.1: they will slip if the robot accelerates or turns fast"
    ]


def test_the_lowest_friction_counts(tmp_path: Path) -> None:
    slip = watch(burger(tmp_path, "0.8", "0.15"))
    assert slip is not None
    assert "a friction of 0.15" in told(slip)[0]


def test_other_robots_have_no_such_note(tmp_path: Path) -> None:
    assert watch(burger(tmp_path, "0.2")) is None
    assert watch(burger(tmp_path), base="fixed") is None
    model = burger(tmp_path)
    scene = Scene(Robot(model="burger.urdf"), model, World(), Physics(), Workspace(tmp_path, tmp_path))
    assert wheel_slip(scene, None) is None

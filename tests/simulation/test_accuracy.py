"""The notes on masses and depths, from contacts that an engine reports."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action import robot as models
from sim_action.core import geometry
from sim_action.core.records import replace
from sim_action.core.workspace import Workspace
from sim_action.drives import Drive, recognise
from sim_action.robot.model.robot_model import Link, RobotModel, Surface
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.simulation.accuracy import AccuracyWatch, WheelSlip, links_with_springs, wheel_slip
from sim_action.state.observation import Clash, Overlap
from sim_action.state.trace import Trace
from sim_action.world import Body, Physics, World
from sim_action.world.scene import Scene
from tests.traces import trace

FOLDER = Path("/folder")
SOFT = Link("bumper", 0.0, surface=Surface(stiffness=1e4))
MODEL = RobotModel("it", "robot.urdf", (Link("base", 40.0), Link("wheel", 10.0), SOFT), (), "")
WORLD = World(
    objects=(
        Body(name="crate", box=(1.0, 1.0, 1.0), mass=0.6),
        Body(name="can", box=(1.0, 1.0, 1.0), mass=0.4),
        Body(name="safe", box=(1.0, 1.0, 1.0), mass=61.0),
        Body(name="wall", box=(1.0, 1.0, 1.0)),
    )
)


def notes(*touches: Overlap | Clash, base: Literal["free", "fixed"] = "free") -> list[str]:
    """The notes of a run in which another robot, `arm`, is as the robot under test."""
    robot = Robot.model_construct(model="robot.urdf", base=base)
    scene = Scene(robot, MODEL, WORLD, Physics(), Workspace(FOLDER, FOLDER), acted_on=True)
    watch = AccuracyWatch(replace(scene, actors={"arm": scene}), springs=links_with_springs(MODEL))
    for touch in touches:
        watch.judged(trace([1.5]), [touch])
    return list(watch.notes(1.5))


@pytest.mark.parametrize(
    ("touch", "told"),
    [
        (Overlap("base", "can", 0.0), "link 'base' and body 'can' touched, and one has 125 times the mass"),
        (Clash("safe", "crate", -0.001), "body 'safe' and body 'crate' touched, and one has 102 times the mass"),
        (Clash("crate", "safe", 0.0), "body 'crate' and body 'safe' touched, and one has 102 times the mass"),
    ],
)
def test_masses_that_differ_by_more_than_a_hundred_times_are_noted_once(touch: Overlap | Clash, told: str) -> None:
    (note,) = notes(touch, touch)
    assert told in note


def test_unequal_masses_are_noted_once_per_pair_of_bodies() -> None:
    """The robot is one body: each of its links presses with its mass."""
    (note,) = notes(Overlap("base", "can", 0.0), Overlap("wheel", "can", 0.0), Overlap("bumper", "can", 0.0))
    assert note.startswith("link 'base' and body 'can' touched")
    assert len(notes(Clash("safe", "crate", 0.0), Clash("crate", "safe", 0.0))) == 1
    assert len(notes(Clash("safe", "crate", 0.0), Clash("can", "safe", 0.0), Overlap("wheel", "can", 0.0))) == 3
    # A fixed base has no mass.
    for touch in (Overlap("base", "can", 0.0), Clash("can", "arm", 0.0)):
        assert [len(notes(touch)), len(notes(touch, base="fixed"))] == [1, 0]


@pytest.mark.parametrize(
    "touch",
    [
        Overlap("base", "crate", 0.0),
        Overlap("base", "wall", 0.0),
        Overlap("wheel", "ground", 0.004),
        Clash("safe", "ground", 0.0),
        Clash("crate", "can", 0.005),
    ],
)
def test_other_contacts_are_not_noted(touch: Overlap | Clash) -> None:
    assert notes(touch) == []


def test_the_greatest_depth_of_what_gives_way_is_noted() -> None:
    wheel = Overlap("wheel", "ground", 0.0061)
    (note,) = notes(wheel, Clash("crate", "can", 0.02), wheel)
    assert note.startswith("body 'crate' and body 'can' overlapped by 0.02 m at 1.50 s: ")
    (note,) = notes(wheel)
    assert note.startswith("link 'wheel' and the ground overlapped by 0.0061 m at 1.50 s: ")
    # That of a stated spring is not.
    assert notes(Overlap("bumper", "wall", 0.03), Overlap("bumper", "ground", 0.02)) == []
    (note,) = notes(Overlap("bumper", "wall", 0.03), Overlap("base", "wall", 0.006))
    assert note.startswith("link 'base' and body 'wall' overlapped by 0.006 m")
    # That of pairs that cannot give way is not.
    inside = [Overlap("base", "wall", 0.1), Overlap("base", "ground", 0.1)]
    assert notes(*inside, base="fixed") == []
    assert len(notes(*inside)) == 1
    assert len(notes(Overlap("wheel", "wall", 0.1), base="fixed")) == 1
    assert len(notes(Overlap("base", "crate", 0.1), base="fixed")) == 1


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
    # The lowest friction counts.
    slip = watch(burger(tmp_path, "0.8", "0.15"))
    assert slip is not None
    assert "a friction of 0.15" in told(slip)[0]
    # Other robots have no such note.
    assert watch(burger(tmp_path, "0.2")) is None
    assert watch(burger(tmp_path), base="fixed") is None
    model = burger(tmp_path)
    scene = Scene(Robot(model="burger.urdf"), model, World(), Physics(), Workspace(tmp_path, tmp_path))
    assert wheel_slip(scene, None) is None

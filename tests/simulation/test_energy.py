"""The mechanical energy of a robot, against formulas for the double pendulum, a slider and a spinning body."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.field_types import Placement
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.simulation.energy import EnergyWatch, Mechanics
from sim_action.state.trace import Trace
from sim_action.world import Body, Physics, World
from sim_action.world.scene import Scene

G = 9.80665
angles = st.floats(-7, 7)
speeds = st.floats(-5, 5)


def inertial(mass: float, at: str, moments: str, rpy: str = "0 0 0") -> str:
    xx, yy, zz = moments.split()
    inertia = f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/>'
    return f'<inertial><origin xyz="{at}" rpy="{rpy}"/><mass value="{mass}"/>{inertia}</inertial>'


def hinge(name: str, ends: str, origin: str, inside: str = "", kind: str = "continuous") -> str:
    parent, child = ends.split(">")
    told = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{origin}"/><axis xyz="0 1 0"/>'
    return f'<joint name="{name}" type="{kind}">{told}{inside}</joint>'


BASE = f'<link name="base">{inertial(3, "0 0 0", "1 1 1")}</link>'
PENDULUM = (
    f'<robot name="it">{BASE}<link name="a">{inertial(1, "0 0 -0.4", "0.2 0.2 0.3")}</link>'
    f'<link name="b">{inertial(2, "0 0 -0.7", "0.2 0.1 0.2")}</link>'
    f"{hinge('one', 'base>a', '0 0 0')}{hinge('two', 'a>b', '0 0 -1')}</robot>"
)
LIMIT = '<limit lower="-9" upper="9" effort="1" velocity="1"/>'
SLIDER = (
    f'<robot name="it">{BASE}<link name="a">{inertial(1, "0 0 0.2", "0.1 0.1 0.1")}</link>'
    f"{hinge('one', 'base>a', '0 0 0', LIMIT, 'prismatic')}</robot>"
)
SPINNER = (
    f'<robot name="it"><link name="base">{inertial(2, "0.1 0 0", "0.3 0.4 0.5", "0 0 1.5707963267948966")}</link>'
    "</robot>"
)


def model(folder: Path, text: str) -> RobotModel:
    path = folder / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    return read_urdf(path)


def moment(time: float, base: Sequence[float], *joints: float) -> list[float]:
    """A row of a trace: base pose and twist, then positions, velocities and efforts of joints."""
    return [time, *base, *joints]


STILL = (0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 1.0, *[0.0] * 6)


def energy(robot: RobotModel, *rows: list[float]) -> tuple[float, float]:
    mechanics = Mechanics(robot, (0.0, 0.0, -G))
    names = tuple(joint.name for joint in robot.moving_joints)
    kinetic, potential = mechanics.energy(mechanics.frames(Trace(names, np.array(rows))))
    return float(kinetic[-1]), float(potential[-1])


@given(angles, angles, speeds, speeds)
def test_a_double_pendulum(tmp_path_factory: pytest.TempPathFactory, a: float, b: float, da: float, db: float) -> None:
    robot = model(tmp_path_factory.getbasetemp(), PENDULUM)
    kinetic, potential = energy(robot, moment(0, STILL, a, b, da, db, 0, 0))
    lower = np.array([da * math.cos(a), da * math.sin(a)])
    lower += 0.7 * (da + db) * np.array([math.cos(a + b), math.sin(a + b)])
    wanted = (0.4 * da) ** 2 / 2 + 0.2 * da**2 / 2 + float(lower @ lower) + 0.1 * (da + db) ** 2 / 2
    assert kinetic == pytest.approx(wanted, abs=1e-9)
    height = -0.4 * math.cos(a) + 2 * (-math.cos(a) - 0.7 * math.cos(a + b))
    assert potential == pytest.approx(G * (6 * 5 + height), abs=1e-9)


@given(angles, speeds, st.lists(speeds, min_size=6, max_size=6), angles)
def test_a_slider_on_a_moving_base(
    tmp_path_factory: pytest.TempPathFactory, at: float, speed: float, twist: list[float], yaw: float
) -> None:
    robot = model(tmp_path_factory.getbasetemp(), SLIDER)
    turn = geometry.quaternion_from_rpy(0.0, 0.0, yaw)
    kinetic, _ = energy(robot, moment(0, (0.0, 0.0, 5.0, *turn, *twist), at, speed, 0))
    linear, angular = np.array(twist[:3]), np.array(twist[3:])
    axis = np.array(geometry.rotate(turn, (0.0, 1.0, 0.0)))
    arm = axis * at + np.array([0.0, 0.0, 0.2])
    velocity = linear + np.cross(angular, arm) + axis * speed
    wanted = 3 * linear @ linear / 2 + angular @ angular / 2 + velocity @ velocity / 2 + 0.1 * angular @ angular / 2
    assert kinetic == pytest.approx(float(wanted), abs=1e-9)


def test_a_body_whose_principal_axes_are_turned(tmp_path: Path) -> None:
    kinetic, _ = energy(model(tmp_path, SPINNER), moment(0, (0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0)))
    # A quarter turn about z makes the moment about x that of y.
    assert kinetic == pytest.approx(0.4 * 2**2 / 2)


def watch(folder: Path, text: str, *, acted_on: bool = False, **more: object) -> EnergyWatch | None:
    robot = Robot(model="robot.urdf", base="fixed", pose=Placement(z=5))
    world = World(**more)  # type: ignore[arg-type] # keys of World
    return EnergyWatch.of(
        Scene(robot, model(folder, text), world, Physics(), Workspace(folder, folder), acted_on=acted_on)
    )


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("</joint>", '<dynamics damping="0.1"/></joint>'),
        ("</joint>", '<dynamics friction="0.1"/></joint>'),
        ("</joint></robot>", '<mimic joint="one"/></joint></robot>'),
    ],
)
def test_a_robot_with_losses_is_not_watched(old: str, new: str, tmp_path: Path) -> None:
    assert watch(tmp_path, PENDULUM) is not None
    assert watch(tmp_path, PENDULUM.replace(old, new)) is None


def test_a_robot_that_something_drives_or_touches_is_not_watched(tmp_path: Path) -> None:
    assert watch(tmp_path, PENDULUM, acted_on=True) is None
    shaped = PENDULUM.replace("</link>", '<collision><geometry><sphere radius="0.1"/></geometry></collision></link>')
    assert watch(tmp_path, shaped) is not None
    assert watch(tmp_path, shaped, objects=(Body(name="b", box=(1.0, 1.0, 1.0)),)) is None


def swing(folder: Path, text: str = PENDULUM, *, loses: float, effort: float = 0.0, height: float = 5.0) -> str | None:
    """The note for a double pendulum that swings down, and whose speed is too low at the end."""
    watched = watch(folder, text)
    assert watched is not None
    rows = []
    for number in range(241):
        angle = number / 240
        fallen = G * 3.8 * (1 - math.cos(angle)) * (1 - loses)
        speed = math.sqrt(2 * fallen / (0.16 + 0.2 + 2 * 1.7**2 + 0.1))
        base = (0.0, 0.0, height, 0.0, 1.0, 0.0, 0.0, *[0.0] * 6)
        rows.append(moment(number / 240, base, angle, 0, speed, 0, effort, 0))
    for part in (rows[:100], rows[100:]):
        watched.add(Trace(("one", "two"), np.array(part)))
    return watched.note()


def test_a_loss_of_energy_is_noted(tmp_path: Path) -> None:
    assert swing(tmp_path, loses=0.0) is None
    assert swing(tmp_path, loses=0.04) is None
    note = swing(tmp_path, loses=0.1)
    assert note is not None
    assert "energy changed by -" in note
    assert "until 1.00 s" in note
    # Motors that work and robots that touch the ground are not judged.
    assert swing(tmp_path, loses=0.1, effort=10.0) is None
    shaped = PENDULUM.replace("</link>", '<collision><geometry><sphere radius="0.1"/></geometry></collision></link>')
    assert swing(tmp_path, shaped, loses=0.1) is not None
    assert swing(tmp_path, shaped, loses=0.1, height=0.05) is None


@pytest.mark.parametrize("heights", [(-3, 3), (3, -3)])
def test_each_shape_of_a_link_can_touch_the_ground(heights: tuple[int, int], tmp_path: Path) -> None:
    balls = "".join(
        f'<collision><origin xyz="0 0 {z}"/><geometry><sphere radius="0.1"/></geometry></collision>' for z in heights
    )
    shaped = PENDULUM.replace("</link>", f"{balls}</link>")
    assert swing(tmp_path, shaped, loses=0.1, height=50) is not None
    assert swing(tmp_path, shaped, loses=0.1, height=2) is None

"""What the backend promises, against analytic results and other ways to measure the same."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from sim_action.core.field_types import Placement
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from sim_action.state.trace_channels import Channels
from sim_action.world import GRAVITY, Body, Ground, Physics, Sphere, World
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.engines.pybullet.engine import PyBulletEngine

pytestmark = pytest.mark.pybullet

BALL = """
<robot name="ball"><link name="ball">
  <inertial><mass value="1"/><inertia ixx="0.004" iyy="0.004" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><sphere radius="0.1"/></geometry></collision>
</link></robot>
"""

PENDULUM = """
<robot name="pendulum">
  <link name="base"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="hinge" type="{type}"><parent link="base"/><child link="bob"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="50" velocity="20"/></joint>
  <link name="bob"><inertial><origin xyz="0 0 -1"/><mass value="1"/>
  <inertia ixx="1e-6" iyy="1e-6" izz="1e-6" ixy="0" ixz="0" iyz="0"/></inertial></link>
</robot>
"""


@contextmanager
def scene(
    folder: Path, urdf: str, robot: Robot, world: World | None = None, rate: float = 240.0, *, contacts: bool = False
) -> Iterator[PyBulletEngine]:
    path = folder / "robot.urdf"
    path.write_text(urdf)
    everything = Scene(robot, read_urdf(path), world or World(), Physics(rate=rate), Workspace(folder, folder))
    from sim_action.engines.pybullet.engine import PyBulletEngine

    backend = PyBulletEngine(everything, Channels(contacts=contacts))
    try:
        yield backend
    finally:
        backend.close()


def advance(backend: PyBulletEngine, first_step: int, steps: int, targets: list[JointTargets] | None = None) -> Trace:
    given: list[JointTargets | None] = [*(targets or [])]
    backend.advance(first_step, given + [None] * (steps - len(given)))
    return backend.collect()


def at(z: float | None = None, **pose: float) -> Robot:
    return Robot(model="robot.urdf", pose=Placement(z=z, **pose))


def test_a_sphere_rolls_without_loss(tmp_path: Path) -> None:
    ground = World(ground=Ground(friction=1.0))
    with scene(tmp_path, BALL, at(), ground) as backend:
        import pybullet

        pybullet.resetBaseVelocity(backend._robot, [1, 0, 0], [0, 10, 0], backend._client)
        trace = advance(backend, 0, 480)
    assert trace.base_position_xyz[-1, 0] == pytest.approx(2.0, rel=0.002)


def test_an_effort_is_held_over_steps(tmp_path: Path) -> None:
    robot = Robot(model="robot.urdf", base="fixed", pose=Placement(z=3))
    effort = 0.4 * GRAVITY
    with scene(tmp_path, PENDULUM.format(type="continuous"), robot, rate=1000) as backend:
        trace = advance(backend, 0, 5_000, [JointTargets(effort={"hinge": effort})])
    # It turns back where the work of the effort is the potential energy: m g l (1 - cos angle) = effort angle.
    turning_point = trace.joint_position[:, 0].max()
    assert GRAVITY * (1 - math.cos(turning_point)) == pytest.approx(effort * turning_point, rel=0.01)
    assert trace.joint_position[:, 0].min() == pytest.approx(0, abs=0.01)
    assert trace.joint_effort[:, 0].tolist() == [effort] * 5_000


def test_position_and_velocity_targets_are_reached(tmp_path: Path) -> None:
    robot = Robot(model="robot.urdf", base="fixed", pose=Placement(z=3))
    with scene(tmp_path, PENDULUM.format(type="revolute"), robot) as backend:
        trace = advance(backend, 0, 480, [JointTargets(position={"hinge": 1.2})])
        assert trace.joint_position[-1, 0] == pytest.approx(1.2, abs=0.02)
        trace = advance(backend, 480, 120, [JointTargets(velocity={"hinge": -1.0})])
        assert trace.joint_velocity[-1, 0] == pytest.approx(-1.0, abs=0.01)


def test_objects_stand_fall_and_stay(tmp_path: Path) -> None:
    crate = Body(name="crate", box=(0.2, 0.2, 0.4), mass=1.0, pose=Placement(x=2))
    shelf = Body(name="shelf", sphere=Sphere(radius=0.1), pose=Placement(x=3, z=2))
    with scene(tmp_path, BALL, at(), World(objects=(crate, shelf))) as backend:
        import pybullet

        advance(backend, 0, 240)
        heights = [
            pybullet.getBasePositionAndOrientation(body, backend._client)[0][2]
            for body, name in backend._body_names.items()
            if name != "ground"
        ]
    assert heights == pytest.approx([0.2, 2.0], abs=1e-3)


BLOCK = """
<robot name="block"><link name="block">
  <inertial><mass value="10"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.4 0.4 0.1"/></geometry></collision>
</link>{more}</robot>
"""


@pytest.mark.parametrize(("mu", "friction"), [("0.2", 0.2), ("0.8", 0.8), ("1e5", 1.0)])
def test_a_block_slides_as_far_as_the_friction_of_its_model_lets_it(mu: str, friction: float, tmp_path: Path) -> None:
    urdf = BLOCK.format(more=f'<gazebo reference="block"><mu1>{mu}</mu1><mu2>{mu}</mu2></gazebo>')
    with scene(tmp_path, urdf, at(), World(ground=Ground(friction=0.5)), rate=1000) as backend:
        import pybullet

        advance(backend, 0, 100)
        pybullet.resetBaseVelocity(backend._robot, [2, 0, 0], [0, 0, 0], backend._client)
        trace = advance(backend, 100, 3000)
    way = trace.base_position_xyz[-1, 0] - trace.base_position_xyz[0, 0]
    assert way == pytest.approx(2**2 / (2 * 0.5 * friction * GRAVITY), rel=0.01)


def test_a_link_that_is_not_the_base_slides_as_its_friction_lets_it(tmp_path: Path) -> None:
    carrier = """<link name="carrier"><inertial><mass value="0.1"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="j" type="fixed"><parent link="carrier"/><child link="block"/></joint>
      <gazebo reference="block"><mu1>0.2</mu1></gazebo>"""
    with scene(tmp_path, BLOCK.format(more=carrier), at(), World(ground=Ground(friction=0.5)), rate=1000) as backend:
        import pybullet

        advance(backend, 0, 100)
        pybullet.resetBaseVelocity(backend._robot, [2, 0, 0], [0, 0, 0], backend._client)
        trace = advance(backend, 100, 3000)
    way = trace.base_position_xyz[-1, 0] - trace.base_position_xyz[0, 0]
    assert way == pytest.approx(2**2 / (2 * 0.5 * 0.2 * GRAVITY), rel=0.01)


def test_a_ball_on_a_spring_sinks_as_deep_as_it_gives_way(tmp_path: Path) -> None:
    spring = '<gazebo reference="ball"><kp>1000</kp><kd>50</kd></gazebo>'
    with scene(tmp_path, BALL.replace("</robot>", f"{spring}</robot>"), at()) as backend:
        trace = advance(backend, 0, 960)
    assert trace.base_position_xyz[-1, 2] - 0.1 == pytest.approx(-1 * GRAVITY / 1000, rel=0.01)


def test_a_floating_joint_from_an_empty_root_says_that_the_robot_is_free(tmp_path: Path) -> None:
    floating = '<link name="odom"/><joint name="f" type="floating"><parent link="odom"/><child link="ball"/></joint>'
    with scene(tmp_path, BALL.replace("</robot>", f"{floating}</robot>"), at(z=10)) as backend:
        trace = advance(backend, 0, 240)
    assert trace.base_linear_xyz[-1, 2] == pytest.approx(-GRAVITY, rel=1e-9)


def test_a_bolted_base_touches_what_moves_and_not_what_is_fixed(tmp_path: Path) -> None:
    wall = Body(name="wall", box=(1, 1, 1), pose=Placement(z=0.5))
    crate = Body(name="crate", box=(0.2, 0.2, 0.2), mass=1, pose=Placement(z=1.3))
    bolted = Robot(model="robot.urdf", base="fixed", pose=Placement(z=1.05))
    with scene(tmp_path, BALL, bolted, World(objects=(wall, crate)), contacts=True) as backend:
        backend.advance(0, [None] * 240)
        assert {contact.body for contact in backend.collect().contacts} == {"crate"}


def test_a_connection_that_was_made_ahead_is_like_any_other_and_is_used_once(tmp_path: Path) -> None:
    from sim_action.engines.pybullet.engine import PyBulletEngine

    def fall() -> tuple[int, list[list[float]]]:
        world = World(objects=(Body(name="stone", sphere=Sphere(radius=0.1), mass=1, pose=Placement(x=0.15)),))
        with scene(tmp_path, BALL, Robot(model="robot.urdf", pose=Placement(z=0.5)), world) as backend:
            backend.advance(0, [None] * 240)
            return backend._client, backend.collect().state.tolist()

    PyBulletEngine.warm_up()
    PyBulletEngine.warm_up()
    with scene(tmp_path, BALL, Robot(model="robot.urdf")) as ahead:
        later, fallen = fall()
        assert later != ahead._client
    PyBulletEngine.warm_up()
    assert fall() == (ahead._client, fallen)

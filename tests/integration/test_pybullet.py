"""What the backend promises, against analytic results and other ways to measure the same."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from sim_action.backends.pybullet import GRAVITY, PyBulletBackend
from sim_action.command import JointTargets
from sim_action.models.urdf import read_urdf
from sim_action.scene import Scene
from sim_action.trace import Trace
from sim_action.workspace import Workspace
from sim_action.world import Body, Ground, Physics, Placement, Robot, Sphere, World

BALL = """
<robot name="ball"><link name="ball">
  <inertial><mass value="1"/><inertia ixx="0.004" iyy="0.004" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><sphere radius="0.1"/></geometry></collision>
</link></robot>
"""

# The centre of mass is neither at the link's origin nor turned like it.
LOPSIDED = """
<robot name="lopsided"><link name="base">
  <inertial><origin xyz="0.3 0.1 0.2" rpy="0.4 0.5 0.6"/><mass value="2"/>
  <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0.3 0.1 0.2"/><geometry><box size="0.2 0.2 0.2"/></geometry></collision>
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
) -> Iterator[PyBulletBackend]:
    path = folder / "robot.urdf"
    path.write_text(urdf)
    everything = Scene(robot, read_urdf(path), world or World(), Physics(rate=rate), Workspace(folder, folder))
    backend = PyBulletBackend(everything, contacts=contacts)
    try:
        yield backend
    finally:
        backend.close()


def advance(backend: PyBulletBackend, first_step: int, steps: int, targets: list[JointTargets] | None = None) -> Trace:
    given: list[JointTargets | None] = [*(targets or [])]
    backend.advance(first_step, given + [None] * (steps - len(given)))
    return backend.collect()


def at(z: float | None = None, **pose: float) -> Robot:
    return Robot(model="robot.urdf", pose=Placement(z=z, **pose))


def test_free_fall_follows_the_parabola_of_the_engines_integrator(tmp_path: Path) -> None:
    with scene(tmp_path, BALL, at(z=10)) as backend:
        trace = advance(backend, 0, 240)
    # Semi-implicit Euler: after n steps, g dt^2 n (n + 1) / 2.
    assert trace.base_position_xyz[-1, 2] == pytest.approx(10 - GRAVITY / 240**2 * 240 * 241 / 2, abs=1e-9)
    assert trace.base_linear_xyz[-1, 2] == pytest.approx(-GRAVITY, rel=1e-9)


def test_a_sphere_rolls_without_loss(tmp_path: Path) -> None:
    ground = World(ground=Ground(friction=1.0))
    with scene(tmp_path, BALL, at(), ground) as backend:
        import pybullet

        pybullet.resetBaseVelocity(backend._robot, [1, 0, 0], [0, 10, 0], backend._client)
        trace = advance(backend, 0, 480)
    assert trace.base_position_xyz[-1, 0] == pytest.approx(2.0, rel=0.002)


def test_poses_are_those_of_the_link_frame(tmp_path: Path) -> None:
    with scene(tmp_path, LOPSIDED, at(x=1, y=2, z=5, roll=0.1, pitch=0.2, yaw=0.3)) as backend:
        pose = backend.observe(0, contacts=False).pose
    assert pose.position_xyz == pytest.approx((1, 2, 5), abs=1e-9)
    assert pose.yaw == pytest.approx(0.3, abs=1e-9)


def test_twists_are_those_of_the_link_frames_origin(tmp_path: Path) -> None:
    with scene(tmp_path, LOPSIDED, at(z=5)) as backend:
        import pybullet

        pybullet.resetBaseVelocity(backend._robot, [0, 0, 0], [0.3, 0.5, 2], backend._client)
        trace = advance(backend, 0, 48)
    moved = np.diff(trace.base_position_xyz, axis=0) * 240
    assert np.abs(moved - trace.base_linear_xyz[1:]).max() < 0.02


def test_a_robot_without_a_z_stands_on_the_ground(tmp_path: Path) -> None:
    with scene(tmp_path, LOPSIDED, at()) as backend:
        assert backend.observe(0, contacts=False).pose.position_xyz[2] == pytest.approx(-0.1, abs=1e-6)


def test_a_pendulum_swings_with_its_analytic_period(tmp_path: Path) -> None:
    robot = Robot(model="robot.urdf", base="fixed", pose=Placement(z=3), joints={"hinge": 0.1})
    with scene(tmp_path, PENDULUM.format(type="continuous"), robot, rate=1000) as backend:
        trace = advance(backend, 0, 4000)
    angle = trace.joint_position[:, 0]
    crossings = trace.time[1:][(angle[:-1] < 0) & (angle[1:] >= 0)]
    period = 2 * math.pi * math.sqrt(1 / GRAVITY) * (1 + 0.1**2 / 16)
    assert np.diff(crossings) == pytest.approx(period, rel=0.002)
    assert angle.max() == pytest.approx(0.1, rel=0.01)


def test_a_joint_between_limits_is_held_until_it_is_told_otherwise(tmp_path: Path) -> None:
    robot = Robot(model="robot.urdf", base="fixed", pose=Placement(z=3), joints={"hinge": 1.0})
    with scene(tmp_path, PENDULUM.format(type="revolute"), robot) as backend:
        assert advance(backend, 0, 240).joint_position[-1, 0] == pytest.approx(1.0, abs=0.02)
        limp = JointTargets(effort={"hinge": 0.0})
        assert advance(backend, 240, 240, [limp]).joint_position[:, 0].min() < 0


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


def test_contacts_name_both_and_leave_the_ground_to_observations(tmp_path: Path) -> None:
    wall = Body(name="wall", box=(0.1, 1.0, 1.0), pose=Placement(x=0.5))
    with scene(tmp_path, BALL, at(), World(objects=(wall,)), contacts=True) as backend:
        import pybullet

        pybullet.resetBaseVelocity(backend._robot, [1, 0, 0], [0, 10, 0], backend._client)
        trace = advance(backend, 0, 240)
        now = backend.observe(240, contacts=True).contacts
    assert {(contact.link, contact.body) for contact in trace.contacts} == {("ball", "wall")}
    # 0.35 m to go at 1 m/s.
    assert trace.contacts[0].time == pytest.approx(0.35, abs=0.01)
    assert trace.contacts[0].position_xyz[0] == pytest.approx(0.45, abs=0.005)
    assert "ground" in {contact.body for contact in now}


def test_nothing_touches_before_it_touches(tmp_path: Path) -> None:
    # The engine reports points from 2 cm on; 1 cm is a near miss.
    wall = Body(name="wall", box=(0.1, 1.0, 1.0), pose=Placement(x=0.16))
    with scene(tmp_path, BALL, at(), World(objects=(wall,)), contacts=True) as backend:
        assert advance(backend, 0, 240).contacts == ()


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


def test_the_same_steps_in_other_blocks_are_the_same_to_the_last_bit(tmp_path: Path) -> None:
    def state(blocks: list[int]) -> bytes:
        with scene(tmp_path, LOPSIDED, at(z=1)) as backend:
            done, parts = 0, []
            for steps in blocks:
                parts.append(advance(backend, done, steps).state)
                done += steps
        return np.concatenate(parts).tobytes()

    assert state([240]) == state([1] * 240) == state([7, 100, 133])

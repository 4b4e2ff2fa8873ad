"""What the backend promises, against analytic results and other ways to measure the same."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from sim_action.backends import GRAVITY
from sim_action.command import JointTargets
from sim_action.models.urdf import read_urdf
from sim_action.scene import Scene
from sim_action.trace import Trace
from sim_action.workspace import Workspace
from sim_action.world import Body, Ground, Physics, Placement, Robot, Sphere, World

if TYPE_CHECKING:
    from sim_action.backends.pybullet import PyBulletBackend

pytestmark = pytest.mark.pybullet

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
    from sim_action.backends.pybullet import PyBulletBackend

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


@pytest.mark.parametrize("height", [0.2, 0.1, 0.099, 0.05, -0.1])
def test_a_ball_is_as_deep_in_the_ground_as_it_is_low(height: float, tmp_path: Path) -> None:
    with scene(tmp_path, BALL, at(z=height)) as backend:
        found = backend.overlaps()
    assert [(overlap.link, overlap.body) for overlap in found] == [("ball", "ground")] * (height < 0.1)
    assert [overlap.depth for overlap in found] == pytest.approx([0.1 - height] * len(found))


def test_only_what_the_robot_is_in_is_named_and_once(tmp_path: Path) -> None:
    # The box of 20 cm is around (0.3, 0.1, 0.2), and the post reaches 5 cm into its side.
    post = Body(name="post", box=(0.1, 0.1, 1), pose=Placement(x=0.25, z=0.5))
    slab = Body(name="slab", box=(1, 1, 0.08), pose=Placement(z=0.04))
    with scene(tmp_path, LOPSIDED, at(z=0), World(objects=(slab, post))) as backend:
        (found,) = backend.overlaps()
    assert (found.link, found.body) == ("base", "post")
    assert found.depth == pytest.approx(0.05, abs=1e-6)


def test_looking_for_overlaps_changes_nothing(tmp_path: Path) -> None:
    world, states = World(objects=(Body(name="crate", box=(0.2, 0.2, 0.2), pose=Placement(x=0.18), mass=1),)), []
    for looks in (0, 3):
        with scene(tmp_path, BALL, at(), world) as backend:
            assert all(any(found.body == "crate" for found in backend.overlaps()) for _ in range(looks))
            states.append(advance(backend, 0, 240).state)
    assert np.array_equal(states[0], states[1])


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


GRIPPER = """
<robot name="gripper">
  <link name="world"/>
  <joint name="mount" type="fixed"><parent link="world"/><child link="palm"/><origin xyz="0 0 1"/></joint>
  {palm}
  <joint name="left" type="{left}"><parent link="palm"/><child link="one"/><origin xyz="0 1 0"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="50" velocity="2"/></joint>
  {one}
  <joint name="right" type="{right}"><parent link="palm"/><child link="two"/><origin xyz="0 -1 0"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="50" velocity="2"/>
    <mimic joint="left" multiplier="{multiplier}" offset="{offset}"/></joint>
  {two}
</robot>
"""


def part(name: str) -> str:
    inertia = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    return f'<link name="{name}"><inertial><mass value="1"/>{inertia}</inertial></link>'


@pytest.mark.parametrize(
    ("left", "right", "multiplier", "offset"),
    [
        ("revolute", "revolute", -1.0, 0.0),
        ("revolute", "revolute", 2.5, 0.3),
        ("prismatic", "prismatic", 1.0, -0.2),
        ("revolute", "prismatic", 0.1, 0.05),
        ("continuous", "revolute", 0.5, 0.0),
    ],
)
def test_a_follower_is_where_its_leader_wants_it(
    left: str, right: str, multiplier: float, offset: float, tmp_path: Path
) -> None:
    urdf = GRIPPER.format(
        left=left,
        right=right,
        multiplier=multiplier,
        offset=offset,
        **{name: part(name) for name in ("palm", "one", "two")},
    )
    robot = Robot(model="robot.urdf", joints={"left": -0.4})
    with scene(tmp_path, urdf, robot) as backend:
        assert backend.observe(0, contacts=False).pose.position_xyz == pytest.approx((0, 0, 0), abs=1e-9)
        trace = advance(backend, 0, 480, [JointTargets(position={"left": 0.8})])
    leads, follows = trace.joint_position.T
    assert leads[0] == pytest.approx(-0.4, abs=0.02)
    assert leads[-1] == pytest.approx(0.8, abs=1e-3)
    assert np.abs(follows - (multiplier * leads + offset)).max() < 5e-3
    assert follows[-1] == pytest.approx(multiplier * 0.8 + offset, abs=1e-3)


def test_what_turns_faster_than_the_engine_would_let_it_is_not_stopped(tmp_path: Path) -> None:
    robot = Robot(model="robot.urdf", base="fixed", pose=Placement(z=3))
    with scene(tmp_path, PENDULUM.format(type="continuous").replace('effort="50"', 'effort="5000"'), robot) as backend:
        trace = advance(backend, 0, 240, [JointTargets(velocity={"hinge": 300})])
    assert trace.joint_velocity[-1, 0] == pytest.approx(300, rel=1e-3)


def test_a_floating_joint_from_an_empty_root_says_that_the_robot_is_free(tmp_path: Path) -> None:
    floating = '<link name="odom"/><joint name="f" type="floating"><parent link="odom"/><child link="ball"/></joint>'
    with scene(tmp_path, BALL.replace("</robot>", f"{floating}</robot>"), at(z=10)) as backend:
        trace = advance(backend, 0, 240)
    assert trace.base_linear_xyz[-1, 2] == pytest.approx(-GRAVITY, rel=1e-9)

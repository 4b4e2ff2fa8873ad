"""What a backend is: every promise of the protocol, on every engine, against analytic results."""

from __future__ import annotations

import math
import random
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.robot.model.robot_spec import Robot
from sim_action.scenario.body_overlaps import clashes
from sim_action.scenario.stage import DEPTH
from sim_action.simulation.guards import Watchdog
from sim_action.state.command import NO_PUSH, BasePush, JointTargets
from sim_action.state.trace import Trace
from sim_action.world import GRAVITY, Body, Cylinder, Ground, Sphere, World
from sim_action.world.scene import Scene
from tests.integration.engines import (
    BALL,
    CRATE,
    LOPSIDED,
    MOMENT,
    advance,
    at,
    inertia,
    mechanism,
    on_every_engine,
    one_link,
    push,
    running,
    scene_of,
    travelled,
)
from tests.mesh_files import obj, two_objects, wheel
from tests.physics.robots import collision, diagonal, inertial, joint, link, robot
from tests.robot.bad_models import GOOD

pytestmark = on_every_engine


PENDULUM = f"""
<robot name="pendulum"><link name="base"><inertial><mass value="1"/>{inertia(1)}</inertial></link>
  <joint name="hinge" type="TYPE"><parent link="base"/><child link="bob"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="50" velocity="20"/></joint>
  <link name="bob"><inertial><origin xyz="0 0 -1"/><mass value="1"/>{inertia(1e-6)}</inertial></link>
</robot>
"""


@pytest.mark.parametrize("base", ["free", "fixed"])
def test_an_observation_has_the_bits_of_the_trace_whether_it_was_kept_or_is_read_anew(
    engine: str, base: Literal["free", "fixed"], tmp_path: Path
) -> None:
    placed = scene_of(tmp_path, mechanism(), at(z=2, roll=0.3, yaw=-0.7))
    scene = replace(placed, robot=placed.robot.model_copy(update={"base": base}))
    with running(engine, scene) as backend:
        if base == "free":
            push(backend, (1, 2, 3), (4, 5, 6))
        backend.advance(0, [JointTargets(velocity={"joint": 2.0}), *[None] * 50])
        kept = backend.observe(51, contacts=False)
        trace = backend.collect()
        anew = backend.observe(51, contacts=False)
    assert kept == anew
    row = (*kept.pose.position_xyz, *kept.pose.orientation_xyzw, *kept.twist.linear_xyz, *kept.twist.angular_xyz)
    joint = kept.joints["joint"]
    assert (kept.time, *row, *joint) == tuple(trace.state[-1].tolist())
    assert joint.velocity != 0


@pytest.mark.parametrize("looked", [True, False])
def test_contacts_that_are_held_are_those_of_their_moment(engine: str, looked: bool, tmp_path: Path) -> None:
    """Whether they were looked at then, or are looked at later."""
    with running(engine, scene_of(tmp_path, BALL, at())) as backend:
        backend.advance(0, [None] * 240)
        held = backend.observe(240, contacts=True)
        if looked:
            assert held.contacts == tuple(backend.observe(240, contacts=True).contacts) != ()
        push(backend, (0, 0, 5))
        backend.advance(240, [None] * 60)
        if looked:
            assert not backend.observe(300, contacts=True).contacts
        last = backend.observe(300, contacts=True)
    assert [(contact.time, contact.body) for contact in held.contacts] == [(1.0, "ground")]
    assert last.contacts == ()


def slid(engine: str, scene: Scene) -> tuple[float, float]:
    """How far it slides in x from 2 m/s, and how fast it is after 3 s."""
    with running(engine, scene) as backend:
        start = advance(backend, 0, 100).base_position_xyz[-1, 0]
        push(backend, (2, 0, 0))
        trace = advance(backend, 100, 3000)
    return float(trace.base_position_xyz[-1, 0] - start), float(trace.speed[-1])


@pytest.mark.parametrize(("ground", "own"), [(0.5, 0.8), (2.0, 0.5)])
def test_friction_is_the_product_of_two(engine: str, ground: float, own: float, tmp_path: Path) -> None:
    urdf = CRATE.replace("<collision>", f'<contact><lateral_friction value="{own}"/></contact><collision>')
    way, speed = slid(engine, scene_of(tmp_path, urdf, at(), World(ground=Ground(friction=ground)), rate=1000))
    assert way == pytest.approx(2**2 / (2 * ground * own * GRAVITY), rel=0.01)
    assert speed < 1e-3


# Gazebo's largest values mean that a link does not slide on its own account.
@pytest.mark.parametrize(("mu", "friction"), [("0.2", 0.2), ("1e5", 1.0)])
def test_each_link_has_a_friction_of_its_own(engine: str, mu: str, friction: float, tmp_path: Path) -> None:
    inner = CRATE.replace('"it"', '"bumper"').partition("<link")[2].rpartition("</robot>")[0]
    urdf = f"""<robot name="it"><link name="base"><inertial><mass value="1"/>{inertia(0.1)}</inertial></link>
      <joint name="j" type="fixed"><parent link="base"/><child link="bumper"/></joint><link{inner}
      <gazebo reference="bumper"><mu1>{mu}</mu1></gazebo></robot>"""
    way, _ = slid(engine, scene_of(tmp_path, urdf, at(), rate=1000))
    assert way == pytest.approx(2**2 / (2 * friction * GRAVITY), rel=0.01)


def test_a_floating_joint_from_an_empty_root_says_that_the_robot_is_free(engine: str, tmp_path: Path) -> None:
    floating = '<link name="odom"/><joint name="f" type="floating"><parent link="odom"/><child link="it"/></joint>'
    urdf = BALL.replace("</robot>", f"{floating}</robot>")
    trace = travelled(engine, scene_of(tmp_path, urdf, at(z=10)), 240)
    assert trace.base_linear_xyz[-1, 2] == pytest.approx(-GRAVITY, rel=1e-9)


@pytest.mark.parametrize(
    ("shape", "more", "lowest"),
    [
        ('<box size="0.2 0.4 0.6"/>', "", 0.1 * math.sin(0.5) + 0.3 * math.cos(0.5)),
        ('<cylinder radius="0.1" length="0.6"/>', "", 0.1 * math.sin(0.5) + 0.3 * math.cos(0.5)),
        ('<capsule radius="0.1" length="0.6"/>', "", 0.1 + 0.3 * math.cos(0.5)),
        ('<sphere radius="0.1"/>', '<origin xyz="0 0 -1"/>', 0.1 + math.cos(0.5)),
    ],
)
def test_what_has_no_z_stands_on_the_ground(engine: str, shape: str, more: str, lowest: float, tmp_path: Path) -> None:
    with running(engine, scene_of(tmp_path, one_link(shape, more), at(pitch=0.5, x=1, y=2))) as backend:
        pose = backend.observe(0, contacts=False).pose
    # PyBullet's distance of a plane and a tilted cylinder is 0.36 mm off.
    assert pose.position_xyz == pytest.approx((1, 2, lowest), abs=5e-4 if "cylinder" in shape else 1e-5)


def test_a_mesh_stands_at_its_height_on_the_ground(engine: str, tmp_path: Path) -> None:
    (tmp_path / "wheel.obj").write_bytes(obj(*wheel(0.3, 0.1)))
    urdf = one_link('<mesh filename="wheel.obj"/>', '<origin rpy="1.5707963267948966 0 0"/>')
    with running(engine, scene_of(tmp_path, urdf, at())) as backend:
        start = backend.observe(0, contacts=False).pose.position_xyz[2]
        after = advance(backend, 0, 240).base_position_xyz[-1, 2]
    assert start == pytest.approx(0.3, abs=2e-4)
    assert after == pytest.approx(0.3, abs=1e-3)


def test_parts_of_a_mesh_are_hulls_of_their_own(engine: str, tmp_path: Path) -> None:
    (tmp_path / "two.obj").write_bytes(two_objects())
    urdf = one_link('<mesh filename="two.obj"/>')
    places = {"left": 0.0, "between": 0.5, "right": 1.0}
    posts = tuple(Body(name=name, box=(0.1, 0.1, 2), pose=Placement(x=x, z=1)) for name, x in places.items())
    with running(engine, scene_of(tmp_path, urdf, at(z=1), World(objects=posts))) as backend:
        assert {overlap.body for overlap in backend.overlaps()} == {"left", "right"}


def cart(shape: str) -> str:
    """Two wheels of 0.033 m, and a ball without friction behind them."""
    ball = inertial(0.01, (1e-5, 1e-5, 1e-5)) + collision('<sphere radius="0.0105"/>', (-0.06, 0.0, -0.0225))
    parts = [link("body", inertial(1.0, (0.002, 0.002, 0.002))), link("ball", ball, friction=0.0)]
    parts.append(joint("caster", "fixed", "body", "ball"))
    for name, y in (("left", 0.08), ("right", -0.08)):
        wheel = inertial(0.05, (2e-5, 2e-5, 2e-5)) + collision(shape, rpy=(-math.pi / 2, 0.0, 0.0))
        limit = 'effort="10" velocity="100"'
        parts += [joint(name, "continuous", "body", f"wheel_{name}", (0.0, y, 0.0), limit=limit)]
        parts += [link(f"wheel_{name}", wheel)]
    return robot(*parts)


@pytest.mark.parametrize("shape", ['<cylinder radius="0.033" length="0.018"/>', '<mesh filename="wheel.obj"/>'])
def test_wheels_roll_as_far_as_their_radius_says(engine: str, shape: str, tmp_path: Path) -> None:
    (tmp_path / "wheel.obj").write_bytes(obj(*wheel(0.033, 0.018)))
    ramp = [JointTargets(velocity=dict.fromkeys(("left", "right"), 10.0 * step / 240)) for step in range(241)]
    trace = travelled(engine, scene_of(tmp_path, cart(shape), at()), 1440, *ramp).rows(slice(480, None))
    rolled = trace.base_position_xyz[-1, 0] - trace.base_position_xyz[0, 0]
    angle = trace.joint_position[-1].mean() - trace.joint_position[0].mean()
    assert angle == pytest.approx(10 * 959 / 240, rel=1e-3)
    assert rolled / angle == pytest.approx(0.033, rel=0.01)


def test_twists_are_those_of_the_link_frames_origin_in_the_world_frame(engine: str, tmp_path: Path) -> None:
    with running(engine, scene_of(tmp_path, LOPSIDED, at(z=5, roll=0.7, yaw=1.1), rate=2400)) as backend:
        push(backend, (0.5, 0, 0), (0.3, 0.5, 2))
        now = backend.observe(0, contacts=False).twist
        trace = advance(backend, 0, 480)
    assert now.linear_xyz == pytest.approx((0.5, 0, 0), abs=1e-9)
    assert now.angular_xyz == pytest.approx((0.3, 0.5, 2), abs=1e-9)
    moved = np.diff(trace.base_position_xyz, axis=0) * 2400
    assert np.abs(moved - trace.base_linear_xyz[1:]).max() < 0.002
    # Twice the vector part of what turned each orientation into the next.
    x, y, z, w = trace.base_orientation_xyzw[:-1].T
    later = trace.base_orientation_xyzw[1:]
    turned = 2 * np.column_stack(
        (
            -later[:, 3] * x + later[:, 0] * w - later[:, 1] * z + later[:, 2] * y,
            -later[:, 3] * y + later[:, 0] * z + later[:, 1] * w - later[:, 2] * x,
            -later[:, 3] * z - later[:, 0] * y + later[:, 1] * x + later[:, 2] * w,
        )
    )
    assert np.abs(turned * 2400 - trace.base_angular_xyz[1:]).max() < 0.002


def test_a_free_body_falls_with_its_centre_of_mass_and_turns_on(engine: str, tmp_path: Path) -> None:
    trace = travelled(engine, scene_of(tmp_path, LOPSIDED, at(z=5), rate=1000), 500)
    # Nothing turns it, wherever its mass is.
    assert trace.base_linear_xyz[-1, 2] == pytest.approx(-GRAVITY / 2, rel=1e-6)
    assert trace.turn_rate.max() < 1e-9


@pytest.mark.parametrize("urdf", [BALL, CRATE, LOPSIDED])
def test_the_ground_carries_the_weight(engine: str, urdf: str, tmp_path: Path) -> None:
    scene = scene_of(tmp_path, urdf, at())
    with running(engine, scene) as backend:
        start = backend.observe(0, contacts=False).pose.position_xyz[2]
        advance(backend, 0, 480)
        rest = backend.observe(480, contacts=True)
    assert {contact.body for contact in rest.contacts} == {"ground"}
    assert sum(contact.force for contact in rest.contacts) == pytest.approx(scene.model.mass * GRAVITY, rel=0.002)
    assert rest.pose.position_xyz[2] == pytest.approx(start, abs=2e-4)
    assert max(map(abs, rest.twist.linear_xyz)) < 1e-4


CARRIER = f"""<link name="carrier"><inertial><mass value="0.1"/>{inertia(0.1)}</inertial></link>
  <joint name="j" type="fixed"><parent link="carrier"/><child link="it"/></joint>"""


@pytest.mark.parametrize("carrier", ["", CARRIER], ids=["the base", "another link"])
@pytest.mark.parametrize(
    ("contact", "gazebo", "gives_way"),
    [
        ("", "<kp>1000</kp><kd>50</kd>", True),
        ('<contact><stiffness value="1000"/><damping value="50"/></contact>', "<kp>0</kp>", True),
        # A stiffness of 0 is none.
        ("", "<kp>0.0</kp><kd>1.0</kd>", False),
        ("", "<kd>100</kd>", False),
        ('<contact><stiffness value="0"/><damping value="10"/></contact>', "", False),
        ('<contact><damping value="10"/></contact>', "", False),
    ],
)
def test_a_spring_gives_way_as_far_as_it_says(
    engine: str, contact: str, gazebo: str, *, gives_way: bool, carrier: str, tmp_path: Path
) -> None:
    urdf = BALL.replace("</link>", f"{contact}</link>")
    urdf = urdf.replace("</robot>", f'<gazebo reference="it">{gazebo}</gazebo>{carrier}</robot>')
    scene = scene_of(tmp_path, urdf, at())
    height = travelled(engine, scene, 960).base_position_xyz[-1, 2]
    assert 0.1 - height == pytest.approx(scene.model.mass * GRAVITY / 1000 if gives_way else 0.0, rel=0.02, abs=2e-4)


def test_contacts_name_both_and_leave_the_ground_to_observations(engine: str, tmp_path: Path) -> None:
    wall = Body(name="wall", box=(0.1, 1.0, 1.0), pose=Placement(x=0.5))
    scene = scene_of(tmp_path, BALL, at(), World(ground=Ground(friction=0), objects=(wall,)))
    with running(engine, scene, contacts=True) as backend:
        push(backend, (1, 0, 0))
        trace = advance(backend, 0, 240)
        now = backend.observe(240, contacts=True).contacts
    assert {(contact.link, contact.body) for contact in trace.contacts} == {("it", "wall")}
    # 0.35 m to go at 1 m/s.
    assert trace.contacts[0].time == pytest.approx(0.35, abs=0.01)
    assert trace.contacts[0].position_xyz == pytest.approx((0.45, 0, 0.1), abs=0.005)
    # What stops 1 kg at 1 m/s.
    assert sum(contact.force for contact in trace.contacts) / 240 == pytest.approx(1.0, rel=0.05)
    assert "ground" in {contact.body for contact in now}


@pytest.mark.parametrize(("x", "asked"), [(0.16, True), (0.14, False)])
def test_nothing_is_touched_that_is_beside_or_that_nobody_asked_for(
    engine: str, x: float, asked: bool, tmp_path: Path
) -> None:
    wall = Body(name="wall", box=(0.1, 1.0, 1.0), pose=Placement(x=x))
    assert travelled(engine, scene_of(tmp_path, BALL, at(), World(objects=(wall,))), 240, contacts=asked).contacts == ()


@pytest.mark.parametrize(
    ("below", "height"),
    [
        (Body(name="it", box=(1, 1, 0.4)), 0.4),
        (Body(name="it", box=(1, 1, 0.4), mass=5), 0.4),
        (Body(name="world", cylinder=Cylinder(radius=0.5, height=0.3), mass=5), 0.3),
        (Body(name="ball", sphere=Sphere(radius=0.25)), 0.5),
    ],
)
def test_a_robot_stands_on_an_object_that_stands_on_the_ground(
    engine: str, below: Body, height: float, tmp_path: Path
) -> None:
    scene = scene_of(tmp_path, CRATE, at(z=height + 0.06), World(objects=(below,)))
    trace = travelled(engine, scene, 480, contacts=True)
    assert trace.base_position_xyz[-1, 2] == pytest.approx(height + 0.05, abs=5e-4)
    assert {contact.body for contact in trace.contacts} == {below.name}


@pytest.mark.parametrize("height", [0.2, 0.1, 0.099, 0.05, -0.1])
def test_a_ball_is_as_deep_in_the_ground_as_it_is_low(engine: str, height: float, tmp_path: Path) -> None:
    with running(engine, scene_of(tmp_path, BALL, at(z=height))) as backend:
        overlaps = backend.overlaps()
    assert [(overlap.link, overlap.body) for overlap in overlaps] == [("it", "ground")] * (height < 0.1)
    assert [overlap.depth for overlap in overlaps] == pytest.approx([0.1 - height] * len(overlaps))


def test_only_what_the_robot_is_in_is_named_and_once(engine: str, tmp_path: Path) -> None:
    # The box of 20 cm is around (0.3, 0.1, 0.2), and the post reaches 5 cm into its side.
    post = Body(name="post", box=(0.1, 0.1, 1), pose=Placement(x=0.25, z=0.5))
    slab = Body(name="slab", box=(1, 1, 0.08), pose=Placement(z=0.04))
    with running(engine, scene_of(tmp_path, LOPSIDED, at(z=0), World(objects=(slab, post)))) as backend:
        (overlap,) = backend.overlaps()
    assert (overlap.link, overlap.body) == ("base", "post")
    assert overlap.depth == pytest.approx(0.05, abs=1e-6)


def test_looking_for_overlaps_changes_nothing(engine: str, tmp_path: Path) -> None:
    crate = Body(name="crate", box=(0.2, 0.2, 0.2), pose=Placement(x=0.18), mass=1)
    states = []
    for looks in (0, 3):
        with running(engine, scene_of(tmp_path, BALL, at(), World(objects=(crate,)))) as backend:
            advance(backend, 0, 1)
            assert all(backend.overlaps() for _ in range(looks))
            states.append(advance(backend, 1, 240).state)
    assert np.array_equal(states[0], states[1])


def test_links_of_a_robot_do_not_touch_each_other(engine: str, tmp_path: Path) -> None:
    shape = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    urdf = mechanism().replace('<link name="base">', f'<link name="base">{shape}')
    urdf = urdf.replace('<link name="part">', f'<link name="part">{shape}')
    with running(engine, scene_of(tmp_path, urdf, Robot(model="robot.urdf"))) as backend:
        trace = advance(backend, 0, 240, JointTargets(velocity={"joint": 1.0}))
        assert backend.observe(240, contacts=True).contacts == ()
    assert trace.joint_position[-1, 0] == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("kind", ["revolute", "continuous"])
def test_a_joint_with_limits_or_a_motor_is_held_until_it_is_told_otherwise(
    engine: str, kind: str, tmp_path: Path
) -> None:
    robot = Robot(model="robot.urdf", base="fixed", pose=Placement(z=3), joints={"hinge": 1.0})
    with running(engine, scene_of(tmp_path, PENDULUM.replace("TYPE", kind), robot)) as backend:
        held = advance(backend, 0, 480)
        limp = advance(backend, 480, 240, JointTargets(effort={"hinge": 0.0}))
    assert held.joint_position[-1, 0] == pytest.approx(1.0, abs=1e-3)
    # m g l sin(angle), against the way it would fall.
    assert abs(held.joint_effort[-1, 0]) == pytest.approx(GRAVITY * math.sin(1.0), rel=0.01)
    assert limp.joint_position[:, 0].min() < 0


def turned(
    engine: str,
    folder: Path,
    targets: JointTargets,
    *,
    kind: str = "continuous",
    axis: str = "0 0 1",
    rate: int = 240,
    seconds: int = 1,
    **stated: float,
) -> Trace:
    """The trace of the mechanism after one command."""
    scene = scene_of(folder, mechanism(kind, axis, **stated), Robot(model="robot.urdf"), rate=rate)
    return travelled(engine, scene, rate * seconds, targets)


BY_KIND = pytest.mark.parametrize(
    ("kind", "axis", "inert"), [("revolute", "0 0 1", MOMENT), ("prismatic", "1 0 0", 2.0)], ids=["turns", "slides"]
)


@BY_KIND
@pytest.mark.parametrize("stated", [True, False])
def test_a_motor_pushes_no_harder_than_it_may(  # noqa: PLR0917 - pytest passes them by name
    engine: str, kind: str, axis: str, inert: float, stated: bool, tmp_path: Path
) -> None:
    limit = 0.7
    targets = JointTargets(velocity={"joint": 20.0}, max_effort={"joint": limit} if stated else {})
    trace = turned(engine, tmp_path, targets, kind=kind, axis=axis, effort=100 if stated else limit)
    # v = F t / m.
    assert trace.joint_velocity[:, 0] == pytest.approx(limit * trace.time / inert, rel=1e-6)
    assert trace.joint_effort[:, 0] == pytest.approx(limit, rel=1e-6)


@BY_KIND
def test_an_effort_accelerates_and_is_held(engine: str, kind: str, axis: str, inert: float, tmp_path: Path) -> None:
    trace = turned(engine, tmp_path, JointTargets(effort={"joint": 0.3}), kind=kind, axis=axis)
    assert trace.joint_velocity[:, 0] == pytest.approx(0.3 * trace.time / inert, rel=1e-6)
    assert trace.joint_effort[:, 0].tolist() == [0.3] * 240


@pytest.mark.parametrize("kind", ["revolute", "continuous"])
def test_joints_are_observed_before_the_first_step_and_after_each(engine: str, kind: str, tmp_path: Path) -> None:
    robot = Robot(model="robot.urdf", joints={"joint": 0.2})
    with running(engine, scene_of(tmp_path, mechanism(kind, effort=2), robot)) as backend:
        before = backend.observe(0, contacts=True).joints["joint"]
        trace = advance(backend, 0, 1, JointTargets(velocity={"joint": 50.0}))
        after = backend.observe(1, contacts=True).joints["joint"]
    assert list(before) == [0.2, 0.0, 0.0]
    assert list(after) == [trace.joint_position[0, 0], trace.joint_velocity[0, 0], trace.joint_effort[0, 0]]
    assert after.effort == pytest.approx(2.0)


def test_damping_resists_in_proportion_to_speed(engine: str, tmp_path: Path) -> None:
    trace = turned(engine, tmp_path, JointTargets(effort={"joint": 1.0}), damping=0.5, rate=1000, seconds=3)
    expected = 2.0 * (1 - np.exp(-trace.time / (MOMENT / 0.5)))
    assert trace.joint_velocity[:, 0] == pytest.approx(expected, abs=0.002)


@pytest.mark.parametrize(("kind", "multiplier", "offset"), [("revolute", -1.0, 0.0), ("prismatic", 0.1, 0.05)])
def test_a_follower_is_where_its_leader_wants_it(
    engine: str, kind: str, multiplier: float, offset: float, tmp_path: Path
) -> None:
    follower = f"""<joint name="follower" type="{kind}"><parent link="base"/><child link="more"/><axis xyz="0 1 0"/>
      <limit lower="-3" upper="3" effort="50" velocity="2"/>
      <mimic joint="joint" multiplier="{multiplier}" offset="{offset}"/></joint>
      <link name="more"><inertial><mass value="1"/>{inertia(0.01)}</inertial></link></robot>"""
    urdf = mechanism("revolute").replace("</robot>", follower)
    robot = Robot(model="robot.urdf", joints={"joint": -0.4})
    trace = travelled(engine, scene_of(tmp_path, urdf, robot), 480, JointTargets(position={"joint": 0.8}))
    leads, follows = trace.joint_position.T
    assert leads[-1] == pytest.approx(0.8, abs=1e-3)
    assert np.abs(follows - (multiplier * leads + offset)).max() < 5e-3
    assert follows[-1] == pytest.approx(multiplier * 0.8 + offset, abs=1e-3)


def test_what_turns_fast_is_not_stopped(engine: str, tmp_path: Path) -> None:
    trace = turned(engine, tmp_path, JointTargets(velocity={"joint": 300.0}), effort=5000)
    assert trace.joint_velocity[-1, 0] == pytest.approx(300, rel=1e-3)


_DIGEST = """
import sys
from pathlib import Path
from sim_action.state.trace import Digest
from tests.integration.engines import LOPSIDED, advance, at, running, scene_of
digest = Digest()
with running(sys.argv[1], scene_of(Path(sys.argv[2]), LOPSIDED, at(z=0.5, roll=0.3))) as backend:
    digest.add(advance(backend, 0, 960))
print(digest.hexdigest())
"""


def test_two_processes_come_to_the_same_digest(engine: str, tmp_path: Path) -> None:
    pytest.importorskip(engine)
    command = [sys.executable, "-c", _DIGEST, engine, str(tmp_path)]
    ran = [subprocess.run(command, capture_output=True, text=True, check=True) for _ in range(2)]
    assert len(ran[0].stdout.split()[-1]) == 64
    assert ran[0].stdout == ran[1].stdout


def test_what_explodes_is_seen_by_the_watchdog(engine: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "empty"
    folder.mkdir()
    monkeypatch.chdir(folder)
    scene = scene_of(tmp_path, mechanism(), Robot(model="robot.urdf"))
    with running(engine, scene) as backend:
        watchdog = Watchdog.of(scene, backend.observe(0, contacts=False))
        trace = advance(backend, 0, 48, *[JointTargets()] * 9, JointTargets(effort={"joint": 1e300}))
        later = advance(backend, 48, 48)
    kept, unstable = watchdog.watch(trace)
    assert str(unstable).startswith("simulation unstable at t = 0.042 s (step 10), first in joint joint: ")
    assert len(kept) == 9
    assert len(later) == 48
    assert watchdog.watch(later)[1] is not None
    assert list(folder.iterdir()) == []


# On ice; its centre of mass is not where its link is.
PUCK = robot(
    link(
        "puck",
        inertial(4.0, (0.5, 0.5, 0.8), (0.3, 0.1, 0.0)) + collision('<box size="1 1 0.1"/>', (0.3, 0.1, 0.0)),
        friction=0.0,
    )
)


def pushed(engine: str, folder: Path, push: BasePush, steps: int, **pose: float) -> Trace:
    return travelled(engine, scene_of(folder, PUCK, at(**pose)), steps, JointTargets(base=push))


def test_a_push_is_force_over_mass_until_it_is_as_fast_as_wanted(engine: str, tmp_path: Path) -> None:
    push = BasePush((1.5, 2.0), 0.0, (0.3, 0.1, 0.0), max_force=10.0, max_torque=100.0)
    trace = pushed(engine, tmp_path, push, 360)
    # 2.5 m/s^2 along (0.6, 0.8): 2.5 m/s are reached after a second.
    assert trace.base_linear_xyz[119, :2] == pytest.approx([0.75, 1.0], rel=1e-3)
    assert trace.base_linear_xyz[239:, :2] == pytest.approx(np.tile([1.5, 2.0], (121, 1)), rel=1e-3)
    assert trace.base_position_xyz[239, :2] - trace.base_position_xyz[0, :2] == pytest.approx([0.75, 1.0], rel=0.01)
    assert np.abs(np.unwrap(trace.yaw)).max() < 1e-3


def test_a_push_turns_by_torque_over_inertia_until_it_is_as_fast_as_wanted(engine: str, tmp_path: Path) -> None:
    push = BasePush((0.0, 0.0), 1.0, (0.3, 0.1, 0.0), max_force=0.0, max_torque=0.4)
    trace = pushed(engine, tmp_path, push, 720)
    # 0.4 N m on 0.8 kg m^2.
    assert trace.base_angular_xyz[239, 2] == pytest.approx(0.5, rel=1e-3)
    assert trace.base_angular_xyz[599:, 2] == pytest.approx(np.ones(121), rel=0.01)


def test_a_push_is_along_the_bases_own_axes_and_of_its_links_origin(engine: str, tmp_path: Path) -> None:
    push = BasePush((1.0, 0.0), 1.0, (0.3, 0.1, 0.0), max_force=1e6, max_torque=1e6)
    trace = pushed(engine, tmp_path, push, 480, yaw=0.5)
    # From t = 1 s on, its origin goes round a circle of 1 m, whose middle is to its left.
    end, yaw = trace.base_position_xyz[240:, :2], trace.yaw[240:]
    middles = end + np.column_stack((-np.sin(yaw), np.cos(yaw)))
    assert np.ptp(middles, axis=0).max() < 0.01
    assert np.abs(trace.speed[240:] - 1.0).max() < 0.01


FAST, HALT = (BasePush((speed, 0.0), 0.0, (0.3, 0.1, 0.0), 40.0, 10.0) for speed in (1.0, 0.0))


@pytest.mark.parametrize(("friction", "reached", "then"), [("0", 0.999, HALT), ("0.5", 0.8, NO_PUSH)])
def test_a_push_lasts_until_another_or_until_the_base_is_let_go(
    engine: str, friction: str, reached: float, then: BasePush, tmp_path: Path
) -> None:
    urdf = PUCK.replace('friction value="0"', f'friction value="{friction}"')
    with running(engine, scene_of(tmp_path, urdf, at())) as backend:
        there = advance(backend, 0, 240, JointTargets(base=FAST))
        still = advance(backend, 240, 240, JointTargets(base=then))
    assert reached < there.speed[-1] < 1.001
    assert still.speed[-1] == pytest.approx(0.0, abs=1e-3)


# The wheel's axle is its link's z, which lies along y; its inertia stands in a frame of its own, where the axle is x.
WHEEL = f"""<robot name="wheel"><link name="base">{inertial(1.0, (1.0, 1.0, 1.0))}</link>
  <joint name="axle" type="continuous"><parent link="base"/><child link="wheel"/>
    <origin rpy="-1.5707963267948966 0 0"/><axis xyz="0 0 1"/></joint>
  <link name="wheel"><inertial><origin rpy="0 -1.5707963267948966 0"/><mass value="1"/>
  {diagonal((0.1, 0.05, 0.05))}</inertial></link></robot>"""


@pytest.mark.parametrize(("rotors", "inertia"), [({}, 0.1), ({"axle": 0.4}, 0.5)])
def test_a_torque_turns_a_wheel_together_with_the_rotor_of_its_motor(
    engine: str, rotors: dict[str, float], inertia: float, tmp_path: Path
) -> None:
    scene = scene_of(tmp_path, WHEEL, Robot(model="robot.urdf", base="fixed", pose=Placement(z=1.0)))
    trace = travelled(engine, replace(scene, rotors=rotors), 240, JointTargets(effort={"axle": 2.0}))
    assert trace.joint_velocity[-1, 0] == pytest.approx(2.0 / inertia, rel=1e-6)


SHAPES: tuple[dict[str, Any], ...] = (
    {"box": (0.2, 0.3, 0.4)},
    {"sphere": {"radius": 0.15}},
    {"cylinder": {"radius": 0.12, "height": 0.3}},
)
_ROUNDING = 0.002  # in m: engines round edges, and tell of two boxes the depth of single points


def pair(seed: int) -> World:
    """Two bodies, of which the first moves, about as far from each other as they are large."""
    drawn = random.Random(seed)
    objects = []
    for name, mass in (("one", 1.0), ("other", None)):
        pose = {axis: drawn.uniform(-0.2, 0.2) + (2.0 if axis == "z" else 5.0) for axis in "xyz"}
        turn = {angle: drawn.uniform(-3, 3) for angle in ("roll", "pitch", "yaw")}
        objects.append(Body.model_validate({"name": name, **drawn.choice(SHAPES), "mass": mass, "pose": pose | turn}))
    return World(objects=tuple(objects))


@pytest.mark.parametrize("seed", range(24))
def test_what_is_told_before_is_what_the_engine_finds(engine: str, seed: int, tmp_path: Path) -> None:
    world = pair(seed)
    with running(engine, scene_of(tmp_path, GOOD, at(z=1.0), world)) as backend:
        deepest = max((clash.depth for clash in backend.clashes()), default=0.0)
    told = list(clashes(world))
    if told:
        assert deepest > DEPTH - _ROUNDING
    if deepest > DEPTH + _ROUNDING and all(body.cylinder is None for body in world.objects):
        assert told

"""Wrenches on links, against closed forms and a Runge-Kutta integration: free bodies, frames that turn, and an arm."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sim_action.core import geometry
from sim_action.core.geometry import Vector3
from sim_action.core.lazy_numpy import FloatArray
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets, LinkWrench
from sim_action.state.trace import Trace
from sim_action.world import World
from sim_action.world.scene import Scene
from tests.integration.engines import advance, at, on_every_engine, running, scene_of, travelled
from tests.physics.robots import inertial

RATE = 1000
MASS, INERTIA = 2.0, (0.02, 0.03, 0.04)
# The centre of mass in the frame of the base link.
COM = (0.05, -0.02, 0.03)
NO_GRAVITY = World.model_validate({"gravity": (0.0, 0.0, 0.0)})


BODY = f"""<robot name="body"><link name="body">{inertial(MASS, INERTIA, COM)}
<collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link></robot>"""
# A link without an inertia gets a negligible one.
NOZZLE = """<link name="nozzle"/>
<joint name="fixed" type="fixed"><parent link="body"/><child link="nozzle"/>
<origin xyz="0.3 0.1 -0.2" rpy="0 1.5707963267948966 0"/></joint></robot>"""
CENTRED = BODY.replace(inertial(MASS, INERTIA, COM), inertial(MASS, INERTIA))
WITH_NOZZLE = BODY.replace("</robot>", NOZZLE)

ARM = f"""<robot name="arm"><link name="post">{inertial(5.0, (0.1, 0.1, 0.1))}</link>
<link name="upper">{inertial(1.0, (0.01, 0.01, 0.01), (0.2, 0.0, 0.0))}</link>
<link name="fore">{inertial(0.5, (0.01, 0.01, 0.01), (0.15, 0.0, 0.0))}</link>
<link name="tool0"/>
<joint name="shoulder" type="revolute"><parent link="post"/><child link="upper"/><origin xyz="0 0 0.5"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="100" velocity="10"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="100" velocity="10"/></joint>
<joint name="flange" type="fixed"><parent link="fore"/><child link="tool0"/>
<origin xyz="0.3 0 0.05"/></joint></robot>"""


def body(folder: Path, urdf: str = BODY, rate: float = RATE, **pose: float) -> Scene:
    return scene_of(folder, urdf, at(z=5.0, **pose), NO_GRAVITY, rate=rate)


def held(*wrenches: LinkWrench) -> JointTargets:
    return JointTargets(wrenches=wrenches)


def run(engine: str, scene: Scene, steps: int, *wrenches: LinkWrench, spin: Vector3 = (0.0, 0.0, 0.0)) -> Trace:
    return travelled(engine, scene, steps, held(*wrenches), start=((0.0, 0.0, 0.0), spin) if any(spin) else ())


def com_velocity(trace: Trace) -> FloatArray:
    """The last velocity of the centre of mass."""
    x, y, z, w = trace.base_orientation_xyzw[-1].tolist()
    velocity: FloatArray = trace.base_linear_xyz[-1] + np.cross(
        trace.base_angular_xyz[-1], geometry.rotate((x, y, z, w), COM)
    )
    return velocity


@on_every_engine
def test_a_force_at_the_centre_of_mass_accelerates_by_force_over_mass(engine: str, tmp_path: Path) -> None:
    force = (3.0, -1.0, 2.0)
    trace = run(engine, body(tmp_path, yaw=0.7), 500, LinkWrench("body", force, point_xyz=COM))
    for row in (0, 99, 499):
        expected = [part / MASS * (row + 1) / RATE for part in force]
        assert trace.base_linear_xyz[row] == pytest.approx(expected, rel=1e-6)
    assert trace.base_angular_xyz[-1] == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


@on_every_engine
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_torque_turns_by_torque_over_inertia(engine: str, axis: int, tmp_path: Path) -> None:
    torque = [0.0, 0.0, 0.0]
    torque[axis] = 0.2
    x, y, z = torque
    trace = run(engine, body(tmp_path), 200, LinkWrench("body", torque_xyz=(x, y, z)))
    expected = [part / moment * 200 / RATE for part, moment in zip(torque, INERTIA, strict=True)]
    assert trace.base_angular_xyz[-1] == pytest.approx(expected, rel=1e-6, abs=1e-6)
    assert com_velocity(trace) == pytest.approx((0.0, 0.0, 0.0), abs=1e-5)


@on_every_engine
@pytest.mark.parametrize(("link", "lever"), [("body", (0.0, 0.0, 0.0)), ("nozzle", (0.3, 0.1, -0.2))])
def test_without_a_point_a_force_acts_at_the_origin_of_the_links_frame(
    engine: str, link: str, lever: Vector3, tmp_path: Path
) -> None:
    force, yaw = np.array([1.0, 2.0, -3.0]), 0.4
    trace = run(engine, body(tmp_path, WITH_NOZZLE, yaw=yaw), 1, LinkWrench(link, (1.0, 2.0, -3.0)))
    turn = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    arm = turn @ np.subtract(lever, COM)
    inertia = turn @ np.diag(INERTIA) @ turn.T
    assert com_velocity(trace) == pytest.approx(force / MASS / RATE, rel=1e-3, abs=1e-6)
    expected = np.linalg.solve(inertia, np.cross(arm, force)) / RATE
    assert trace.base_angular_xyz[-1] == pytest.approx(expected, rel=2e-3, abs=1e-6)


@on_every_engine
@pytest.mark.parametrize("frame", ["base", "body"])
def test_in_the_frame_of_a_spinning_link_a_force_turns_with_it(engine: str, frame: str, tmp_path: Path) -> None:
    spin, thrust, steps = 8.0, 4.0, 600
    scene = body(tmp_path, CENTRED, yaw=0.3)
    trace = run(engine, scene, steps, LinkWrench("body", (thrust, 0.0, 0.0), frame=frame), spin=(0.0, 0.0, spin))
    # The spin about a principal axis goes on, so that the velocity follows a circle.
    angle = 0.3 + spin * np.arange(steps) / RATE
    per_step = thrust / MASS / RATE
    expected = per_step * np.array([np.cos(angle).sum(), np.sin(angle).sum(), 0.0])
    assert trace.base_linear_xyz[-1] == pytest.approx(expected, abs=1e-6)
    # In continuous time: a circle of radius F / (m w), which half a step of the angle displaces.
    end = 0.3 + spin * steps / RATE
    circle = np.array([math.sin(end) - math.sin(0.3), math.cos(0.3) - math.cos(end), 0.0]) * thrust / (MASS * spin)
    assert trace.base_linear_xyz[-1] == pytest.approx(circle, abs=2 * per_step)


@on_every_engine
@pytest.mark.parametrize("name", ["nozzle", "base"])
def test_the_frame_may_be_that_of_another_link_also_with_the_name_base(engine: str, name: str, tmp_path: Path) -> None:
    # The x axis of the nozzle is the -z axis of the body.
    scene = body(tmp_path, WITH_NOZZLE.replace("nozzle", name))
    trace = run(engine, scene, 1, LinkWrench("body", (2.0, 0.0, 0.0), frame=name, point_xyz=COM))
    assert trace.base_linear_xyz[-1] == pytest.approx((0.0, 0.0, -2.0 / MASS / RATE), rel=1e-3, abs=1e-6)


def runge_kutta(rates: Callable[[FloatArray], FloatArray], state: FloatArray, end: float, steps: int) -> FloatArray:
    step = end / steps
    for _ in range(steps):
        first = rates(state)
        second = rates(state + step / 2 * first)
        third = rates(state + step / 2 * second)
        fourth = rates(state + step * third)
        state = state + step / 6 * (first + 2 * second + 2 * third + fourth)
    return state


@on_every_engine
def test_a_thruster_that_tumbles_its_body_follows_the_equations_of_motion(engine: str, tmp_path: Path) -> None:
    """Forces and torques in the frame of a tumbling link, against Newton's and Euler's equations."""
    force, torque, seconds = np.array([0.0, 0.4, 1.5]), np.array([0.02, 0.05, -0.03]), 0.5
    moments = np.array(INERTIA)
    about = np.cross(np.negative(COM), force) + torque

    def rates(state: FloatArray) -> FloatArray:
        """Of the velocity of the centre, the spin in the frame of the body, and the rows of its rotation matrix."""
        spin, turn = state[3:6], state[6:].reshape(3, 3)
        wx, wy, wz = spin
        across = np.array([[0, -wz, wy], [wz, 0, -wx], [-wy, wx, 0]])
        faster = (about - np.cross(spin, moments * spin)) / moments
        return np.concatenate((turn @ force / MASS, faster, (turn @ across).ravel()))

    end = runge_kutta(rates, np.concatenate((np.zeros(6), np.eye(3).ravel())), seconds, 500)
    velocity, spin = end[:3], end[6:].reshape(3, 3) @ end[3:6]
    wrench = LinkWrench("body", (0.0, 0.4, 1.5), (0.02, 0.05, -0.03), frame="body")
    errors = []
    for rate in (500, 2000):
        trace = run(engine, body(tmp_path, rate=rate), round(seconds * rate), wrench)
        off = np.concatenate((com_velocity(trace) - velocity, trace.base_angular_xyz[-1] - spin))
        errors.append(float(np.abs(off).max()))
    # The engines integrate with a first-order method.
    assert errors[1] < 2e-3
    assert errors[1] < 0.5 * errors[0]


@on_every_engine
def test_wrenches_add_up_until_others_replace_them(engine: str, tmp_path: Path) -> None:
    one = LinkWrench("body", (1.0, 0.0, 0.0), point_xyz=COM)
    with running(engine, body(tmp_path)) as backend:
        both = advance(backend, 0, 100, held(one, one))
        alone = advance(backend, 100, 100, held(one))
        none = advance(backend, 200, 100, held())
    speeds = [trace.base_linear_xyz[-1, 0] for trace in (both, alone, none)]
    assert speeds == pytest.approx([0.1, 0.15, 0.15], rel=1e-6)


@on_every_engine
def test_a_wrench_and_a_disturbance_add_up(engine: str, tmp_path: Path) -> None:
    gust = {"at": 0.05, "for": 0.05, "force": (0.0, 4.0, 0.0)}
    world = World.model_validate({"gravity": (0.0, 0.0, 0.0), "disturbances": (gust,)})
    scene = scene_of(tmp_path, BODY, at(z=5.0), world, rate=RATE)
    trace = run(engine, scene, 200, LinkWrench("body", (0.0, 1.0, 0.0), point_xyz=COM))
    assert trace.base_linear_xyz[-1, 1] == pytest.approx(0.2 * 1.0 / MASS + 0.05 * 4.0 / MASS, rel=1e-6)


@on_every_engine
@pytest.mark.parametrize("frame", ["world", "tool0"])
def test_servos_of_an_arm_bear_the_transpose_of_the_jacobian_times_the_force(
    engine: str, frame: str, tmp_path: Path
) -> None:
    shoulder, elbow = 0.5, 0.6
    angles = {"shoulder": shoulder, "elbow": elbow}
    robot = Robot.model_validate({"model": "robot.urdf", "base": "fixed", "joints": angles})
    scene = scene_of(tmp_path, ARM, robot, NO_GRAVITY, rate=240)
    force, torque = (3.0, -2.0, 4.0), (0.1, 0.3, 0.2)
    wrench = LinkWrench("tool0", force, torque, frame)
    trace = travelled(engine, scene, 480, JointTargets(position=angles, wrenches=(wrench,)))
    # tool0 in the frame of the elbow, turned by the elbow about y and then by the shoulder about z.
    about_y = np.array([[math.cos(elbow), 0, math.sin(elbow)], [0, 1, 0], [-math.sin(elbow), 0, math.cos(elbow)]])
    sine, cosine = math.sin(shoulder), math.cos(shoulder)
    about_z = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    fore = about_z @ about_y @ (0.3, 0.0, 0.05)
    turn = about_z @ about_y if frame == "tool0" else np.eye(3)
    pulled, twisted = turn @ force, turn @ torque
    axes = {"shoulder": (np.array([0, 0, 1.0]), about_z @ (0.4, 0, 0) + fore), "elbow": (about_z @ (0, 1.0, 0), fore)}
    for name, (axis, lever) in axes.items():
        borne = -float(np.cross(axis, lever) @ pulled + axis @ twisted)
        effort = trace.joint_effort[-1, trace.joint_names.index(name)]
        assert effort == pytest.approx(borne, rel=0.01), name

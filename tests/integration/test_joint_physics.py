"""Joints in every engine: where they begin, what brakes them, and that no motor moves them past their limits."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.core.records import replace
from sim_action.engines.engine import Engine
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.simulation.mutations import heavier
from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from sim_action.world import GRAVITY, World
from tests.integration.engines import (
    MOMENT,
    advance,
    at,
    inertia,
    mechanism,
    on_every_engine,
    running,
    scene_of,
    travelled,
)
from tests.physics import robots

pytestmark = on_every_engine
RATE = 240.0
PART = f'<inertial><mass value="1"/>{inertia(2)}</inertial>'


def joint(kind: str, inside: str = "", name: str = "j") -> str:
    """About, or along, a level axis through the centre of mass: no gravity in it, if it turns."""
    ends = f'<parent link="base"/><child link="{name}_part"/><axis xyz="0 1 0"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint><link name="{name}_part">{PART}</link>'


def hinge(limit: str, more: str = "", name: str = "j") -> str:
    return joint("revolute", f"<limit {limit}/>{more}", name)


@contextmanager
def machine(engine: str, folder: Path, *joints: str, allow: tuple[str, ...] = ()) -> Iterator[Engine]:
    """A robot of joints at a base that is bolted down."""
    urdf = f'<robot name="it"><link name="base">{PART}</link>{"".join(joints)}</robot>'
    robot = Robot(model="robot.urdf", base="fixed")
    with running(engine, scene_of(folder, urdf, robot, rate=RATE, allow=allow)) as backend:
        yield backend


def run(backend: Engine, seconds: float, targets: JointTargets) -> Trace:
    return advance(backend, 0, round(seconds * RATE), targets)


@pytest.mark.parametrize(
    ("limits", "home", "end"),
    [
        ('lower="0.5" upper="1e16"', 0.5, 4.5),
        ('lower="-1e16" upper="-0.5"', -0.5, -4.5),
        ('upper="1.5"', 0.0, 1.5),
        ('upper="0"', 0.0, 0.0),
        ('lower="-1.5"', 0.0, -1.5),
    ],
)
def test_a_joint_with_one_limit_begins_there_and_stops_there(
    engine: str, limits: str, home: float, end: float, tmp_path: Path
) -> None:
    way = math.copysign(1, end)
    with machine(engine, tmp_path, hinge(f'{limits} effort="50" velocity="9"')) as backend:
        assert backend.observe(0, contacts=False).joints["j"].position == pytest.approx(home)
        back = run(backend, 2, JointTargets(velocity={"j": -way}))
        assert back.joint_position[-1, 0] == pytest.approx(home, abs=0.02)
        on = run(backend, 4, JointTargets(velocity={"j": way}))
        assert on.joint_position[-1, 0] == pytest.approx(end, abs=0.2)


@pytest.mark.parametrize("kind", ["continuous", "revolute"])
@pytest.mark.parametrize(("effort", "acceleration"), [(5.0, 2.0), (-5.0, -2.0), (0.5, 0.0), (0.0, 0.0)])
def test_an_effort_works_against_the_joints_own_friction(
    engine: str, kind: str, effort: float, acceleration: float, tmp_path: Path
) -> None:
    inside = '<limit lower="-9" upper="9" effort="50" velocity="50"/><dynamics friction="1"/>'
    with machine(engine, tmp_path, joint(kind, inside)) as backend:
        trace = run(backend, 1, JointTargets(effort={"j": effort}))
    # (effort - friction) / moment of inertia, for a second.
    assert trace.joint_velocity[-1, 0] == pytest.approx(acceleration, rel=1e-3, abs=1e-6)
    assert set(trace.joint_effort[:, 0].tolist()) == {effort}


@pytest.mark.parametrize(("kind", "axis", "load"), [("continuous", "0 0 1", MOMENT), ("prismatic", "1 0 0", 2.0)])
def test_the_mutation_of_mass_halves_the_acceleration(
    engine: str, kind: str, axis: str, load: float, tmp_path: Path
) -> None:
    scene = scene_of(tmp_path, mechanism(kind, axis), at())
    for factor in (1.0, 2.0):
        heavy = replace(scene, model=heavier(scene.model, factor))
        trace = travelled(engine, heavy, 240, JointTargets(effort={"joint": 1.0}))
        assert trace.joint_velocity[-1, 0] == pytest.approx(1 / (factor * load), rel=0.01)


def test_friction_stops_what_no_effort_moves_any_more(engine: str, tmp_path: Path) -> None:
    with machine(engine, tmp_path, joint("continuous", '<dynamics friction="1"/>')) as backend:
        run(backend, 1, JointTargets(effort={"j": 5.0}))
        trace = run(backend, 5, JointTargets(effort={"j": 0.0}))
    # From 2 rad/s at friction / moment of inertia = 0.5 rad/s^2.
    assert trace.joint_velocity[239, 0] == pytest.approx(1.5, rel=1e-3)
    assert trace.joint_velocity[-1, 0] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("along", ["0", "-1e-4", "1e-9"])
def test_a_rod_whose_file_says_that_nothing_turns_about_it_turns_as_a_rod(
    engine: str, along: str, tmp_path: Path
) -> None:
    # 1 kg and 2 m: m l^2 / 12 about its middle.
    rod = joint("continuous").replace(inertia(2), inertia(0.333333).replace("0.333333", along, 1))
    with machine(engine, tmp_path, rod, allow=("impossible-inertia",)) as backend:
        trace = run(backend, 1, JointTargets(effort={"j": 1.0}))
    assert trace.joint_velocity[-1, 0] == pytest.approx(3.0, rel=2e-3)


@pytest.mark.parametrize("lower", [-1e-3, 0.0])
def test_a_servo_at_a_stop_carries_the_same_as_next_to_it(engine: str, lower: float, tmp_path: Path) -> None:
    lift = joint("prismatic", f'<limit lower="{lower}" upper="1" effort="50" velocity="9"/>').replace("0 1 0", "0 0 1")
    with machine(engine, tmp_path, lift) as backend:
        held = run(backend, 1, JointTargets(position={"j": 0.0}))
        dropped = run(backend, 1, JointTargets(effort={"j": 0.0}))
    # The stop would carry any share of the 1 kg: all of it in PyBullet, and 71 % in MuJoCo.
    assert held.joint_effort[-1, 0] == pytest.approx(GRAVITY, rel=1e-6)
    assert dropped.joint_position[-1, 0] == pytest.approx(lower, abs=1e-4)


def test_a_follower_stops_its_leader_at_its_own_limit(engine: str, tmp_path: Path) -> None:
    leader = hinge('lower="-3" upper="3" effort="50" velocity="2"')
    follower = hinge('lower="-0.2" upper="0.2" effort="50" velocity="2"', '<mimic joint="j"/>', "follower")
    with machine(engine, tmp_path, leader, follower) as backend:
        trace = run(backend, 4, JointTargets(position={"j": 0.8}))
    assert trace.joint_position[-1] == pytest.approx([0.2, 0.2], abs=1e-3)
    assert trace.joint_effort[-1, 0] == pytest.approx(50)


def test_a_motor_of_0_has_no_limit_in_the_model_as_in_the_engine(engine: str, tmp_path: Path) -> None:
    with machine(engine, tmp_path, hinge('lower="-9" upper="9" effort="0" velocity="0"')) as backend:
        trace = run(backend, 1, JointTargets(velocity={"j": 4.0}))
    (model,) = read_urdf(tmp_path / "robot.urdf").joints
    assert (model.max_effort, model.max_velocity) == (None, None)
    assert trace.joint_velocity[-1, 0] == pytest.approx(4.0, rel=1e-3)


def test_a_motor_that_may_exert_nothing_holds_nothing_until_it_may_again(engine: str, tmp_path: Path) -> None:
    with machine(engine, tmp_path, joint("continuous")) as backend:
        idle = run(backend, 0.5, JointTargets(velocity={"j": 2.0}, max_effort={"j": 0.0}))
        turned = run(backend, 0.5, JointTargets(velocity={"j": 2.0}))
    assert idle.joint_velocity[-1, 0] == pytest.approx(0.0, abs=1e-6)
    assert turned.joint_velocity[-1, 0] == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize("friction", ["0", "0.5"])
def test_a_motor_goes_over_from_one_kind_of_target_to_the_next(engine: str, friction: str, tmp_path: Path) -> None:
    rubs = f'<dynamics friction="{friction}"/>'
    with machine(engine, tmp_path, hinge('lower="-9" upper="9" effort="500" velocity="5"', rubs)) as backend:
        placed = run(backend, 1, JointTargets(position={"j": 0.5}))
        turned = run(backend, 1, JointTargets(velocity={"j": -2.0}))
        rolled = run(backend, 1, JointTargets(effort={"j": 0.0}))
        braked = run(backend, 1, JointTargets(velocity={"j": 0.0}))
        placed_again = run(backend, 2, JointTargets(position={"j": 1.0}))
    assert placed.joint_position[-1, 0] == pytest.approx(0.5, abs=1e-3)
    assert turned.joint_velocity[-1, 0] == pytest.approx(-2.0, rel=1e-3)
    # Friction / moment of inertia, for a second.
    assert rolled.joint_velocity[-1, 0] == pytest.approx(-2.0 + float(friction) / 2, rel=1e-3)
    assert braked.joint_velocity[-1, 0] == pytest.approx(0.0, abs=1e-6)
    assert placed_again.joint_position[-1, 0] == pytest.approx(1.0, abs=1e-3)


def test_a_motor_without_a_limit_turns_what_is_heavy(engine: str, tmp_path: Path) -> None:
    flywheel = joint("continuous").replace('"2"', '"20000"').replace('mass value="1"', 'mass value="30000"')
    with machine(engine, tmp_path, flywheel) as backend:
        trace = run(backend, 0.5, JointTargets(velocity={"j": 1.0}))
    # With 1,000 N m, it would take 20 s.
    assert trace.joint_velocity[-1, 0] == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(("told", "behind"), [({}, 10 / RATE), ({"j": 1.0}, 0.0)])
def test_a_servo_that_knows_how_fast_its_target_moves_is_not_behind_it(
    engine: str, told: dict[str, float], behind: float, tmp_path: Path
) -> None:
    """Else it is behind by ten steps' way: it takes back a tenth of what it is off in each."""
    ramp = [JointTargets(position={"j": step / RATE}, velocity=told) for step in range(240)]
    with machine(engine, tmp_path, hinge('lower="-9" upper="9" effort="500" velocity="5"')) as backend:
        trace = advance(backend, 0, 240, *ramp)
    assert (trace.time - trace.joint_position[:, 0])[120:] == pytest.approx(behind + 0 * trace.time[120:], abs=1e-3)


def test_a_servo_goes_no_faster_than_its_joint_can_whatever_it_is_told(engine: str, tmp_path: Path) -> None:
    with machine(engine, tmp_path, hinge('lower="-9" upper="9" effort="500" velocity="2"')) as backend:
        trace = run(backend, 0.5, JointTargets(position={"j": 5.0}, velocity={"j": 3.0}))
    assert trace.joint_velocity[60:, 0].max() == pytest.approx(2.0, rel=1e-2)


def test_a_servo_forgets_how_fast_its_target_was(engine: str, tmp_path: Path) -> None:
    with machine(engine, tmp_path, hinge('lower="-9" upper="9" effort="500" velocity="5"')) as backend:
        advance(backend, 0, 24, JointTargets(position={"j": 0.5}, velocity={"j": 1.0}))
        trace = advance(backend, 24, 240, JointTargets(position={"j": 0.5}))
    assert trace.joint_position[-1, 0] == pytest.approx(0.5, abs=1e-3)


# What the product promises.
MOST_RAD = math.radians(0.2)
MOST_M = 0.001


def stop(name: str, kind: str, lower: float, upper: float, mimic: str = "", *, effort: float = 10) -> str:
    """A joint about, or along, the upright, with a light part."""
    limit = f'lower="{lower}" upper="{upper}" effort="{effort}" velocity="50"'
    part = robots.link(f"{name}_part", f'<inertial><mass value="0.5"/>{inertia(1e-3)}</inertial>')
    return robots.joint(name, kind, "base", f"{name}_part", axis=(0.0, 0.0, 1.0), limit=limit, mimic=mimic) + part


def trace_of(
    engine: str, folder: Path, joints: str, targets: JointTargets, *, base: str = "fixed", rate: float = 240.0
) -> Trace:
    robot = Robot(model="robot.urdf", base="fixed") if base == "fixed" else at(1.0)
    urdf = robots.robot(robots.link("base", f'<inertial><mass value="0.5"/>{inertia(0.01)}</inertial>'), joints)
    scene = scene_of(folder, urdf, robot, World(gravity=0), rate=rate, allow=["follower-limits"])
    return travelled(engine, scene, round(1.5 * rate), targets)


COMMANDS = {
    "gentle effort": JointTargets(effort={"j": 0.5}),
    "effort beyond its limit": JointTargets(effort={"j": 50.0}),
    "effort to the lower limit": JointTargets(effort={"j": -5.0}),
    "speed": JointTargets(velocity={"j": 20.0}),
    "speed without a limit of effort": JointTargets(velocity={"j": 20.0}, max_effort={"j": 1e6}),
    "position beyond the limit": JointTargets(position={"j": 3.0}),
    "position far below": JointTargets(position={"j": -9.0}),
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(("base", "rate"), [("fixed", 240.0), ("free", 1000.0)])
@pytest.mark.parametrize("stated", [("revolute", 0.0, 0.5), ("prismatic", -0.01, 0.03), ("revolute", -2.0, -0.2)])
def test_no_motor_moves_a_joint_past_its_limits(  # noqa: PLR0917 - pytest passes them by name
    engine: str, command: str, base: str, rate: float, stated: tuple[str, float, float], tmp_path: Path
) -> None:
    kind, lower, upper = stated
    targets = COMMANDS[command]
    trace = trace_of(engine, tmp_path, stop("j", kind, lower, upper), targets, base=base, rate=rate)
    position, most = trace.joint_position[:, 0], MOST_M if kind == "prismatic" else MOST_RAD
    assert position.max() <= upper + most
    assert position.min() >= lower - most
    goes_down = min([*targets.effort.values(), *targets.velocity.values(), *targets.position.values()]) < 0
    assert position[-1] == pytest.approx(lower if goes_down else upper, abs=most)
    # It rests: what a motor presses against a stop has no speed.
    assert trace.joint_velocity[-1, 0] == pytest.approx(0.0, abs=0.05)
    if targets.effort:
        assert trace.joint_effort[-1, 0] == pytest.approx(targets.effort["j"])
    if targets.position:
        assert trace.joint_effort[-1, 0] == pytest.approx(0.0, abs=0.1)


def test_a_stop_takes_the_speed_with_an_impulse_on_both_links(engine: str, tmp_path: Path) -> None:
    trace = trace_of(engine, tmp_path, stop("j", "revolute", 0.0, 0.5), JointTargets(effort={"j": 0.5}), base="free")
    spin = trace.base_angular_xyz[:, 2]
    # Motors and stops are inside of the robot: with no gravity, its angular momentum stays 0.
    momentum = (0.01 + 1e-3) * spin + 1e-3 * trace.joint_velocity[:, 0]
    after = np.flatnonzero(trace.joint_position[:, 0] > 0.499)[0] + 2
    assert abs(momentum[after:]).max() < 1e-4
    assert abs(spin[after:]).max() < 0.01


@pytest.mark.parametrize(("multiplier", "offset"), [(1.0, 0.0), (-1.0, 0.0), (2.0, 0.1)])
def test_followers_stop_with_their_leader(engine: str, multiplier: float, offset: float, tmp_path: Path) -> None:
    mimic = f'joint="j" multiplier="{multiplier}" offset="{offset}"'
    joints = stop("j", "prismatic", 0.0, 0.04) + stop("k", "prismatic", -0.2, 0.2, mimic)
    trace = trace_of(engine, tmp_path, joints, JointTargets(effort={"j": 20.0}))
    leader, follower = trace.joint_position.T
    assert leader.max() <= 0.04 + MOST_M
    assert leader[-1] == pytest.approx(0.04, abs=MOST_M)
    assert abs(follower - multiplier * leader - offset).max() < MOST_M


def test_the_stop_of_a_follower_stops_its_leader(engine: str, tmp_path: Path) -> None:
    joints = stop("j", "revolute", 0.0, 1.0) + stop("k", "revolute", 0.0, 0.6, 'joint="j" multiplier="2"')
    trace = trace_of(engine, tmp_path, joints, JointTargets(velocity={"j": 2.0}))
    leader, follower = trace.joint_position.T
    assert follower.max() <= 0.6 + MOST_RAD
    assert leader[-1] == pytest.approx(0.3, abs=MOST_RAD)


@pytest.mark.parametrize("multiplier", [2.0, -1.0, 0.5])
def test_a_leader_has_the_limit_of_effort_that_its_model_states(engine: str, multiplier: float, tmp_path: Path) -> None:
    """A motor of 2 N m accelerates itself and the follower, whose inertia counts with the square of its ratio."""
    mimic = f'joint="j" multiplier="{multiplier}"'
    follower = stop("k", "revolute", -60.0, 60.0, mimic).replace(inertia(1e-3), inertia(0.05))
    joints = stop("j", "revolute", -30.0, 30.0, effort=2) + follower
    trace = trace_of(engine, tmp_path, joints, JointTargets(velocity={"j": 40.0}))
    moment, step = 1e-3 + 0.05 * multiplier**2, 24
    assert trace.joint_velocity[step - 1, 0] == pytest.approx(2 / moment * step / 240, rel=0.02)
    assert trace.joint_effort[step - 1, 0] == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize(("multiplier", "mass"), [(2.0, 20.0), (1.0, 20.0), (-2.0, 0.1)])
def test_a_follower_that_its_leader_carries_stays_with_it(
    engine: str, multiplier: float, mass: float, tmp_path: Path
) -> None:
    """From the moment on at which both are released under their weight."""
    robot = at(3.0).model_copy(update={"base": "fixed"})
    scene = scene_of(tmp_path, robots.followers(((multiplier, mass),), in_series=True), robot)
    trace = travelled(engine, scene, 60, JointTargets(position={"leader": 0.0}))
    leader, follower = trace.joint_position.T
    assert np.degrees(abs(follower - multiplier * leader)).max() < 0.05


def test_coupled_rockers_stay_together_on_the_ground_in_few_iterations(
    engine: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Contacts keep the solver of PyBullet from ending early: each iteration that it may take costs time."""
    iterations = [0]
    if engine == "pybullet":
        import pybullet  # other systems do not have it

        stated = pybullet.setPhysicsEngineParameter

        def recorded(**parameters: Any) -> None:
            iterations.append(parameters.get("numSolverIterations", 0))
            stated(**parameters)

        monkeypatch.setattr(pybullet, "setPhysicsEngineParameter", recorded)
    limit, mimic = 'lower="-0.3" upper="0.3" effort="100" velocity="9"', 'joint="left" multiplier="-1"'
    feet = "".join(robots.collision(robots.sphere_shape(0.05), (x, 0.0, -0.1)) for x in (-0.15, 0.15))
    rocker = robots.inertial(2.0, (0.01, 0.05, 0.05)) + feet
    parts = [robots.link("base", robots.inertial(1.5, (0.01, 0.005, 0.02)))]
    for side, y, follows in (("left", 0.2, ""), ("right", -0.2, mimic)):
        parts.append(robots.link(f"{side}_rocker", rocker))
        parts.append(robots.joint(side, "revolute", "base", f"{side}_rocker", (0.02, y, 0), limit=limit, mimic=follows))
    scene = scene_of(tmp_path, robots.robot(*parts), at(0.16))
    trace = travelled(engine, scene, 60, JointTargets(position={"left": 0.0}))
    left, right = trace.joint_position.T
    assert np.degrees(abs(right + left)).max() < 0.05
    assert max(iterations) < 2000

"""Joints in every engine: where they begin, what stops them and what brakes them, against the laws of mechanics."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from sim_action.engines.engine import Engine
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from tests.integration.engines import advance, inertia, on_every_engine, running, scene_of

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


def test_a_servo_that_is_told_to_go_beyond_a_limit_rests_there(engine: str, tmp_path: Path) -> None:
    with machine(engine, tmp_path, hinge('lower="-0.5" upper="0.5" effort="20" velocity="5"')) as backend:
        trace = run(backend, 2.0, JointTargets(position={"j": 2.0}))
    assert trace.joint_position[-1, 0] == pytest.approx(0.5, abs=2e-3)
    assert trace.joint_effort[-1, 0] == pytest.approx(0.0, abs=0.1)


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

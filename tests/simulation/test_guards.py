"""What is no physics is named: the first step, the part of the robot, the measure, the bound."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import BadStart, SimulationUnstable
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose
from sim_action.robot.model.robot_model import Joint, JointType, Link, RobotModel, Shape
from sim_action.robot.reading.urdf import read_urdf
from sim_action.scenario.model import DrivenRobot
from sim_action.simulation.guards import Watchdog
from sim_action.simulation.loop import SimulationRun
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.world import MAX_SPEED, Physics
from tests.robot.bad_models import GOOD
from tests.simulated import simulated
from tests.traces import BURGER, START, WHEELS, piece, scene, trace

LEFT, RIGHT = WHEELS
BASE = "the base link base_footprint"
TIMES = [0.0, 1 / 240, 2 / 240, 3 / 240]


def watchdog(physics: Physics | None = None, start: Observation = START, robot: DrivenRobot | None = None) -> Watchdog:
    where = replace(scene(), physics=physics or Physics())
    return Watchdog.of(replace(where, robot=robot or where.robot), start)


def fault(moments: Trace, dog: Watchdog | None = None) -> str:
    kept, unstable = (dog or watchdog()).watch(moments)
    assert unstable is not None
    assert len(kept) < len(moments)
    return str(unstable)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("column", range(1, 20))
def test_what_is_no_number_is_seen_in_every_column(column: int, value: float) -> None:
    moments = trace(TIMES)
    moments.state[2, column] = value
    part = BASE if column < 14 else f"joint {WHEELS[(column - 14) % 2]}"
    assert fault(moments).startswith(
        f"simulation unstable at t = 0.008 s (step 2), first in {part}: its state is not a number; usual causes:"
    )


@pytest.mark.parametrize(
    ("moments", "what"),
    [
        (trace(TIMES, speed=[0, 1, 120, 130]), f"{BASE}: 120 m/s, and the bound is 100 m/s;"),
        (trace(TIMES, turn_rate=[0, 1, -1000, 0]), f"{BASE}: 1000 rad/s, and the bound is 1000 rad/s;"),
        (trace(TIMES, velocity=[0, 999, -1000, 0]), f"joint {LEFT}: 1000 rad/s, and the bound is 1000 rad/s;"),
        (trace(TIMES, y=[0, 0, -1.2e4, 0]), f"{BASE}: 1.2e+04 m from where it began, and the bound is 1e+04 m;"),
        (trace(TIMES, z=[0, 0, -2, -3]), f"{BASE}: 2 m below the ground, and the bound is 1.0"),
    ],
)
def test_the_first_step_beyond_a_bound_is_named(moments: Trace, what: str) -> None:
    kept, unstable = watchdog().watch(moments)
    assert str(unstable).startswith(f"simulation unstable at t = 0.008 s (step 2), first in {what}")
    assert kept.time.tolist() == TIMES[:2]


@pytest.mark.parametrize(
    ("moments", "advice"),
    [
        (trace([1.0], velocity=[2000]), "if this is intended, raise physics.max_turn_rate"),
        (trace([1.0], x=[2e4]), "if this is intended, raise physics.max_distance"),
        (trace([1.0], z=[-20]), "a start below the ground (robot.pose.z)"),
        (trace([1.0], z=[-20]), "if this is intended, raise physics.max_depth"),
        (trace([1.0], speed=[math.nan]), "an inertia that is too small for the forces"),
    ],
)
def test_it_says_what_to_do(moments: Trace, advice: str) -> None:
    assert advice in fault(moments)


def test_how_speeds_are_measured() -> None:
    moments = trace([1.0])
    moments.state[0, 8:11] = 57.0, -57.0, 57.0
    assert watchdog().watch(moments) == (moments, None)
    moments.state[0, 8:11] = 58.0, -58.0, 58.0
    assert "100.5 m/s" in fault(moments.rows(slice(None)))
    # In one step, a joint is named before the base, and the worst joint first.
    moments = trace(TIMES, speed=[0, 500, 500, 500], velocity=[0, 2e3, 2e3, 2e3])
    moments.state[1, 17] = -3000.0
    assert f"(step 1), first in joint {RIGHT}: 3000 rad/s" in fault(moments)
    highest = watchdog(Physics(max_turn_rate=MAX_SPEED))
    assert "no engine allows more" in fault(trace([1.0], velocity=[MAX_SPEED]), highest)


def test_bounds_are_those_of_the_scenario() -> None:
    strict = Physics(max_speed=2.0, max_turn_rate=3.0, max_distance=4.0, max_depth=0.5)
    dog = watchdog(strict)
    fine = trace(TIMES, x=[0, 3.9, 0, 0], z=[0, 0, -0.49, 0], speed=[0, 1.9, 0, 0], velocity=[0, 0, 2.9, 0])
    assert dog.watch(fine) == (fine, None)
    assert "2 m/s, and the bound is 2 m/s" in fault(trace(TIMES, speed=[0, 2, 0, 0]), dog)
    assert "raise physics.max_speed" in fault(trace(TIMES, speed=[0, 2, 0, 0]), dog)
    assert f"joint {LEFT}: 3 rad/s" in fault(trace(TIMES, velocity=[0, 3, 0, 0]), dog)
    assert "4.1 m from where it began" in fault(trace(TIMES, x=[0, 4.1, 0, 0]), dog)
    assert "0.5 m below the ground, and the bound is 0.5 m" in fault(trace(TIMES, z=[0, -0.5, 0, 0]), dog)


def test_distance_and_depth_count_from_where_the_robot_was_put() -> None:
    far = replace(START, pose=Pose((5e5, -2e6, 0.0)))
    there = trace(TIMES, x=[5e5] * 4, y=[-2e6] * 4)
    assert watchdog(start=far).watch(there) == (there, None)
    assert "m from where it began" in fault(there)
    # A base that is bolted down cannot sink.
    deep = trace(TIMES, z=[-30.0] * 4)
    bolted = DrivenRobot(model=BURGER, base="fixed")
    assert watchdog(robot=bolted).watch(deep) == (deep, None)
    # A robot that stands on the ground is above it, wherever its origin is drawn.
    drawn = replace(START, pose=Pose((0.0, 0.0, -12.0)))
    assert watchdog(start=drawn).depth == pytest.approx(13.0)
    put_there = DrivenRobot(model=BURGER, pose=Placement(z=-12.0))
    assert watchdog(start=drawn, robot=put_there).depth < 2.0


def sliding(
    model: RobotModel, kind: JointType = "prismatic", lower: float | None = -0.25, upper: float | None = 2.0
) -> RobotModel:
    joint = Joint("slide", kind, "base", "tip", Pose((0.0, 3.0, 4.0)), (0, 0, 1), lower=lower, upper=upper)
    shape = Shape("box", Pose((0.0, 0.0, 0.5)))
    return replace(model, links=(Link("base", 1.0), Link("tip", 1.0, (shape,))), joints=(joint,))


@pytest.mark.parametrize(
    ("kind", "lower", "upper", "stroke"),
    [
        ("prismatic", -0.25, 2.0, 2.0),
        ("prismatic", -2.0, 0.25, 2.0),
        ("prismatic", None, 0.25, 0.25),
        ("prismatic", -0.25, None, 0.25),
        ("prismatic", None, None, 0.0),
        ("revolute", -0.25, 2.0, 0.0),
    ],
)
def test_the_way_to_the_nearest_shape_goes_over_joints_offsets_and_strokes(
    kind: JointType, lower: float | None, upper: float | None, stroke: float
) -> None:
    where = scene(sliding(scene().model, kind, lower, upper))
    assert Watchdog.of(where, START).depth == pytest.approx(1.0 + 5.0 + stroke + 0.5)


def test_a_joint_that_slides_without_end_one_way_adds_what_it_goes_the_other_way(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    block = GOOD[GOOD.index("<collision>") : GOOD.index("</collision>") + len("</collision>")]
    text = GOOD.replace(block, "").replace('<link name="upper">', f'<link name="upper">{block}')
    path.write_text(text.replace("revolute", "prismatic").replace('upper="2"', 'upper="1e16"'))
    where = replace(scene(read_urdf(path)), physics=Physics())
    assert Watchdog.of(where, START).depth < 10


def test_a_joint_that_slides_is_bounded_in_m() -> None:
    dog = Watchdog.of(scene(sliding(scene().model)), START)
    columns = trace([1.0]).state[:, :14]
    slides = Trace(("slide",), np.column_stack((columns, [[0.0, 150.0, 0.0]])))
    assert "joint slide: 150 m/s, and the bound is 100 m/s" in fault(slides, dog)
    slid = Trace(("slide",), np.column_stack((columns, [[-2e4, 0.0, 0.0]])))
    assert "joint slide: 2e+04 m, and the bound is 1e+04 m" in fault(slid, dog)


def test_settling_is_told_by_the_time_since_release_and_nothing_is_no_reason() -> None:
    moments = trace([-1.55, -1.54], z=[0.0, -9.0])
    assert "unstable while the robot settled, 0.460 s after its release, first in" in fault(moments)
    empty = trace([1.0]).rows(slice(0))
    assert watchdog().watch(empty) == (empty, None)


@given(st.lists(st.floats(-150, 150), min_size=1, max_size=12), st.lists(st.integers(0, 12), max_size=4))
def test_however_a_trace_is_cut_the_same_step_is_named(speeds: list[float], cuts: list[int]) -> None:
    moments = trace([index / 240 for index in range(1, len(speeds) + 1)], velocity=speeds)
    dog = watchdog()
    whole, unstable = dog.watch(moments)
    edges = sorted({0, len(speeds), *(cut for cut in cuts if cut < len(speeds))})
    seen, found = 0, None
    for start, end in pairwise(edges):
        kept, found = dog.watch(piece(moments, start, end))
        seen += len(kept)
        if found:
            break
    assert seen == len(whole)
    assert str(found) == str(unstable)


PENDULUM = """\
<robot name="pendulum">
  <link name="base">
    <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    {shape}
  </link>
  <link name="arm">
    <inertial><mass value="0.1"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="swing" type="revolute">
    <parent link="base"/><child link="arm"/><origin xyz="0 0 0.1"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1e5" velocity="1e4"/>
  </joint>
</robot>
"""
SHAPE = '<collision><geometry><box size="0.3 0.2 0.1"/></geometry></collision>'
GAINS = """\
from sim_action import JointTargets

def control(observation):
    swing = observation.joints["swing"]
    return JointTargets(effort={"swing": -100 * swing.position - 1000 * swing.velocity})
"""


def pendulum(folder: Path, robot: str = "", more: str = "", shape: str = SHAPE) -> SimulationRun:
    (folder / "pendulum.urdf").write_text(PENDULUM.format(shape=shape))
    (folder / "gains.py").write_text(GAINS)
    text = f"name: pendulum\nrobot: {{model: pendulum.urdf{robot}}}\n{more}\n"
    return simulated(folder, f"{text}expect: [{{upright: {{max_tilt: 179 deg}}}}]\ntime_limit: 2 s\n")


def unstable(folder: Path, robot: str = "", more: str = "", shape: str = SHAPE) -> str:
    with pytest.raises(SimulationUnstable) as raised:
        pendulum(folder, robot, more, shape)
    return str(raised.value)


def test_an_honest_run_is_left_alone(tmp_path: Path) -> None:
    assert pendulum(tmp_path).end == "time limit"


# When, and at what speed, is the engine's.
@pytest.mark.pybullet
def test_gains_that_explode_are_an_error_that_names_the_joint(tmp_path: Path) -> None:
    message = unstable(tmp_path, ", joints: {swing: 1}", "commands: {script: gains.py}")
    assert message.startswith("simulation unstable at t = 0.104 s (step 25), first in joint swing: 1365 rad/s")


def test_a_robot_that_nothing_carries_or_below_the_ground_is_an_error(tmp_path: Path) -> None:
    message = unstable(tmp_path, shape="")
    assert "while the robot settled, 0.450 s after its release, first in the base link base: 1.00" in message
    below = ", pose: {z: -5}"
    assert "0.004 s after its release, first in the base link base" in unstable(tmp_path, below, shape="")
    with pytest.raises(BadStart, match=r"starts 5\.05 m inside the ground"):
        pendulum(tmp_path, below)


# MuJoCo bears these.
@pytest.mark.pybullet
def test_steps_that_are_too_long_are_an_error(tmp_path: Path) -> None:
    message = unstable(tmp_path, ", pose: {z: 4}", "physics: {rate: 5}")
    assert "time steps that are too long (raise physics.rate)" in message

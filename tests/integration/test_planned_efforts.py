"""Efforts and work of planned joint motions against inverse dynamics, at several rates of the physics and the ticks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pybullet
import pytest

from sim_action.core.lazy_numpy import FloatArray
from sim_action.simulation.loop import SimulationRun
from sim_action.state.trace import Trace
from tests.integration.engines import inertia, on_every_engine
from tests.integration.test_joint_trajectories import ARMS, KNOWN, TIMES, Arm, wanted
from tests.simulated import simulated
from tests.soak import soaked

pytestmark = pytest.mark.pybullet
IIWA = ARMS[0]
STEP = 1e-4  # s, of numerical derivatives
NEAR_A_CORNER = 0.1  # s
RESIDUAL = 0.0025  # efforts of PyBullet's solver are uncertain by this share of the greatest one: 0.1 N m of 38 N m


Moving = tuple[int, ...]  # the indices of the joints that move

MOTIONS: Final[tuple[tuple[str, Moving], ...]] = (
    ("minimum_jerk", (0,)),
    ("minimum_jerk", (1, 3)),
    ("minimum_jerk", (0, 4, 6)),
    ("minimum_jerk", (2, 3, 4, 5, 6)),
    ("minimum_jerk", tuple(range(7))),
    ("linear", (6,)),
    ("linear", (3, 5)),
    ("linear", (0, 1, 2, 3)),
    ("linear", (0, 1, 3, 4, 5, 6)),
    ("linear", tuple(range(7))),
)
RATES: Final = ((200, 10), (250, 50), (300, 60), (500, 20), (1000, 200))  # in Hz: of the physics, and of the command
FEW: Final = ((9, 0), (4, 4), (2, 1))  # the indices of motions and rates that `make test` tries


def moved(  # noqa: PLR0917 - one for each parameter of the tests
    folder: Path, arm: Arm, engine: str, interpolation: str, physics: float, rate: float, moving: Moving
) -> Trace:
    points = [
        {"at": time, "position": {arm.joints[index]: knot[index] for index in moving}}
        for time, knot in zip(TIMES[1:], arm.knots[1:], strict=True)
    ]
    known = KNOWN[arm.name]
    scenario = {
        "name": "n",
        "robot": {"model": known.path, **known.keys, "joints": dict(zip(arm.joints, arm.knots[0], strict=True))},
        "physics": {"rate": physics},
        "commands": {"joints": points, "interpolation": interpolation, "rate": rate},
        "expect": [{"energy": {"at_most": 1e6}}],
        "allow": ["fixed-base"],
        "backend": engine,
        "time_limit": 5.2,
        "trace": {"rate": physics},
    }
    return simulated(folder, scenario, outside=True).trace


def inverse_dynamics(arm: Arm, interpolation: str, time: FloatArray, moving: Moving) -> tuple[FloatArray, FloatArray]:
    """Return velocities and efforts (T, 7) of the plan in rad/s and N m, with the damping of the model."""

    def plan(at: FloatArray) -> FloatArray:
        planned = wanted(arm, interpolation, at)
        rest = [index for index in range(len(arm.joints)) if index not in moving]
        planned[:, rest] = np.array(arm.knots[0])[rest]
        return planned

    before, here, after = plan(time - STEP), plan(time), plan(time + STEP)
    speeds, bends = (after - before) / (2 * STEP), (after - 2 * here + before) / STEP**2
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setGravity(0, 0, -9.80665, physicsClientId=client)
        flags = pybullet.URDF_USE_IMPLICIT_CYLINDER
        robot = pybullet.loadURDF(str(KNOWN[arm.name].path), useFixedBase=True, flags=flags, physicsClientId=client)
        infos = [pybullet.getJointInfo(robot, j, client) for j in range(pybullet.getNumJoints(robot, client))]
        damping = np.array([info[6] for info in infos if info[2] != pybullet.JOINT_FIXED])
        rows = zip(here.tolist(), speeds.tolist(), bends.tolist(), strict=True)
        efforts = [pybullet.calculateInverseDynamics(robot, *row, physicsClientId=client) for row in rows]
    finally:
        pybullet.disconnect(client)
    return speeds, np.array(efforts) + speeds * damping


def work(speeds: FloatArray, efforts: FloatArray, time: FloatArray) -> float:
    return float(np.trapezoid(np.clip(speeds * efforts, 0, None).sum(axis=1), time))


@pytest.mark.parametrize(
    ("motion", "rates"), soaked([(m, r) for m in range(len(MOTIONS)) for r in range(len(RATES))], FEW)
)
@on_every_engine
def test_efforts_and_work_are_those_of_inverse_dynamics(engine: str, motion: int, rates: int, tmp_path: Path) -> None:
    (interpolation, moving), (physics, rate) = MOTIONS[motion], RATES[rates]
    trace = moved(tmp_path, IIWA, engine, interpolation, physics, rate, moving)
    columns = [trace.joint_names.index(joint) for joint in IIWA.joints]
    # The effort of a step acts from the moment before it on.
    time, efforts = trace.time[:-1], trace.joint_effort[1:, columns]
    _, expected = inverse_dynamics(IIWA, interpolation, time, moving)
    corners = np.abs(time[:, None] - np.array(TIMES)).min(axis=1)
    smooth = corners > NEAR_A_CORNER if interpolation == "linear" else corners >= 0
    largest = np.abs(expected[smooth]).max(axis=0)
    assert np.abs(efforts[smooth]).max(axis=0) == pytest.approx(largest, rel=0.03, abs=RESIDUAL * largest.max())
    fine = np.linspace(0.0, float(time[-1]), 5201)
    speeds = np.vstack((np.zeros(7), trace.joint_velocity[:, columns]))
    mean = (speeds[1:-1] + speeds[2:]) / 2
    done = float((np.clip(efforts * mean, 0, None).sum(axis=1) / physics).sum())
    needed = work(*inverse_dynamics(IIWA, interpolation, fine, moving), fine)
    assert done == pytest.approx(needed, rel=0.03)


TURRET = f"""<robot name="turret"><link name="base"/>
<joint name="pan" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="40" velocity="3"/></joint>
<link name="arm"><inertial><mass value="2"/>{inertia(0.16)}</inertial></link></robot>"""


def turned(
    folder: Path, engine: str, commands: object, expect: Sequence[object], urdf: str = TURRET, **keys: Any
) -> SimulationRun:
    """The run of a turret that is bolted down."""
    (folder / "turret.urdf").write_text(urdf)
    robot = {"model": "turret.urdf", "base": "fixed"}
    scenario = {"name": "n", "robot": robot, "commands": commands, "expect": expect, "allow": ["fixed-base"]}
    return simulated(folder, {**scenario, "backend": engine, **keys})


def to(pan: float, time: float, **keys: object) -> dict[str, object]:
    """A motion of minimum jerk to an angle in rad."""
    return {"joints": [{"at": time, "position": {"pan": pan}}], "interpolation": "minimum_jerk", **keys}


@pytest.mark.parametrize("rate", [200, 1000])
@on_every_engine
def test_a_light_joint_with_much_damping_follows_its_motion(engine: str, rate: int, tmp_path: Path) -> None:
    """The effort of minimum jerk is damping x speed, at most 1.875 way / time, and nearly no inertia."""
    damped = TURRET.replace("<axis", '<dynamics damping="5"/><axis').replace('velocity="3"', 'velocity="9"')
    light, at_rate = damped.replace(inertia(0.16), inertia(0.001)), {"rate": rate}
    keys: dict[str, Any] = {"physics": at_rate, "trace": at_rate, "time_limit": 1.2}
    run = turned(tmp_path, engine, to(1.5, 1.0), [{"effort": {"at_most": 39}}], light, **keys)
    s = np.clip(run.trace.time, 0, 1)
    assert run.trace.joint_position[:, 0] == pytest.approx(1.5 * s**3 * (10 - 15 * s + 6 * s**2), abs=1e-4)
    assert run.verdicts[0].measured == pytest.approx(5 * 1.875 * 1.5, rel=0.01)


@pytest.mark.parametrize(("physics", "rate"), [(200, 10), (240, 40), (240, 240), (1000, 10)])
@on_every_engine
def test_a_quarter_turn_needs_the_effort_and_work_of_a_closed_form(
    engine: str, physics: int, rate: int, tmp_path: Path
) -> None:
    """Minimum jerk: the peak acceleration is 10 / sqrt(3) of way / time^2, and the peak speed 1.875 of way / time."""
    way, time, moment = np.pi / 2, 2.0, 0.16
    limits = [{"effort": {"at_most": 39}}, {"energy": {"at_most": 1000}}]
    run = turned(tmp_path, engine, to(way, time, rate=rate), limits, physics={"rate": physics}, time_limit=2.5)
    effort, energy = run.verdicts
    assert effort.measured == pytest.approx(moment * 10 / np.sqrt(3) * way / time**2, rel=0.01)
    assert energy.measured == pytest.approx(moment * (1.875 * way / time) ** 2 / 2, rel=0.01)


_AT_1_S = "at 1.00 s"
_SHARP = {"diff": {"left": ["wheel_left_joint"], "right": ["wheel_right_joint"], "acceleration": "100 m/s^2"}}


@pytest.mark.parametrize(
    ("commands", "step"),
    [
        ({**to(0.3, 1.0), "interpolation": "hold"}, f"position {_AT_1_S}"),
        (to(0.3, 1.0), ""),
        (
            {"joints": [{"at": 1.0, "velocity": {"pan": 0.3}}], "interpolation": "hold", "rate": 10},
            f"velocity {_AT_1_S}",
        ),
        ({"replay": "jump.csv"}, "position between two rows, 0.90 s to 1.00 s,"),
        ({"replay": "gap.csv"}, "position at 1.20 s"),
        ({"replay": "smooth.csv"}, ""),
    ],
)
@on_every_engine
def test_a_step_of_a_target_is_named_where_it_may_decide(
    engine: str, commands: object, step: str, tmp_path: Path
) -> None:
    """A position is not decided by a step, also if its joint is named like a word of another message."""
    rows = np.arange(0.0, 1.55, 0.1)
    logs = {
        "jump": [(time, 0.05 * time + 0.3 * (time > 0.95)) for time in rows],
        "gap": [(0.0, 0.0), (1.2, 0.3), (1.3, 0.3)],
        "smooth": [(time, 0.3 * (1 - np.cos(2 * time))) for time in rows],
    }
    for name, log in logs.items():
        lines = [f"{time:.3f},{position:.6f}" for time, position in log]
        (tmp_path / f"{name}.csv").write_text("\n".join(["time,position.pan", *lines]))
    limits = [
        {"effort": {"at_most": 39.9}},
        {"effort": {"rms_at_most": 39}},
        {"energy": {"at_most": 1000}},
        {"joint_within": {"velocity": {"pan": [-50, 50]}}},
        {"joint_within": {"position": {"pan": [-1, 1]}}},
    ]
    kind, _, when = step.partition(" ")
    cause = f"of the {kind} target of 'pan' {when} adds to it"
    verdicts = turned(tmp_path, engine, commands, limits, duration=1.5, time_limit=2).verdicts
    messages = [verdict.message for verdict in verdicts]
    assert [cause in message for message in messages] == [bool(step)] * 4 + [False], messages
    assert any("adds to it" in message for message in messages) is bool(step), messages
    assert [verdict.joint for verdict in verdicts] == ["pan"] * 5


@pytest.mark.parametrize(
    ("model", "drive", "step"),
    [
        ("turtlebot3_burger", _SHARP, "a step of the velocity target of 'wheel_"),
        ("turtlebot3_burger", {}, ""),
        ("f1tenth", {}, "a step of the position target of '"),
    ],
)
@on_every_engine
def test_steps_of_wheels_and_steering_are_named(
    engine: str, model: str, drive: dict[str, object], step: str, tmp_path: Path
) -> None:
    """A drive that speeds up within the grip of its wheels makes no steps."""
    scenario = {
        "name": "n",
        "robot": {"model": model, **({"drive": drive} if drive else {})},
        "commands": {"twist": [{"linear": 0.2, "angular": 0.3}]},
        "expect": [{"energy": {"at_most": 1e5}}],
        "backend": engine,
        "duration": 0.5,
        "time_limit": 1,
    }
    (verdict,) = simulated(tmp_path, scenario).verdicts
    assert (
        (step in verdict.message and "adds to it" in verdict.message) if step else "adds to it" not in verdict.message
    )


MOVES = """\
from sim_action import JointMotion

TIMES = [0.0, 0.5, 1.0]


def control(observation):
    if observation.time:
        return None
    return JointMotion.through(["pan"], TIMES, [[0.0], [0.4], [1.0]], [[0.0], [1.0], [0.0]])
"""


@on_every_engine
def test_a_script_hands_over_a_motion_once(engine: str, tmp_path: Path) -> None:
    """The servo follows the cubic through its rows from one physics step to the next."""
    (tmp_path / "moves.py").write_text(MOVES)
    limits = [{"joint": {"name": "pan", "near": "1 rad", "tolerance": "0.5 deg"}}]
    script = {"rate": 10, "script": "moves.py"}
    trace = turned(tmp_path, engine, script, limits, duration=1.5, time_limit=2).trace
    share = np.clip(trace.time, 0, 1)
    first, second = share / 0.5, (share - 0.5) / 0.5
    # The two cubics in terms of their points and speeds.
    wanted_first = 0.4 * (3 * first**2 - 2 * first**3) + 0.5 * (first**3 - first**2)
    wanted_second = 0.4 + 0.6 * (3 * second**2 - 2 * second**3) + 0.5 * (second**3 - 2 * second**2 + second)
    expected = np.where(share < 0.5, wanted_first, wanted_second)
    assert trace.joint_position[:, 0] == pytest.approx(expected, abs=5e-3)

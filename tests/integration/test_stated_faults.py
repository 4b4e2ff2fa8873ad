"""Faults that a scenario states, in every engine, against the laws of mechanics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.core.errors import InvalidScenario
from sim_action.recording.replay.build import make_replay
from sim_action.recording.replay.replay_data import read_replay
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.simulation.recorder import RunRecorder
from tests.integration.engines import on_every_engine
from tests.physics.case import Run, Setup, run_on
from tests.physics.measures import GRAVITY
from tests.physics.robots import (
    STANCE,
    arm,
    box_inertia,
    box_shape,
    collision,
    inertial,
    joint,
    lift,
    link,
    quadruped,
    robot,
)
from tests.simulated import simulated

pytestmark = on_every_engine
FIXED = {"base": "fixed", "pose": {"z": 3.0}}
ALLOW = {"allow": ["fixed-base"]}
LOAD = 5.0


def held_lift(engine: str, *faults: dict[str, Any], seconds: float = 2.0) -> Run:
    """The run of a lift that holds a load of 5 kg, with 1000 N at most."""
    return run_on(engine, Setup(lift(LOAD), seconds, {"faults": list(faults), **ALLOW}, FIXED, rate=1000.0))


def test_a_motor_that_is_off_lets_its_load_fall(engine: str) -> None:
    run = held_lift(engine, {"motor": "slide", "at": 1.0, "off": True}, seconds=1.3)
    height = run.trace.joint_position[:, 0]
    assert abs(height[: run.row(1.0)]).max() < 1e-4
    assert height[run.row(1.3)] == pytest.approx(-GRAVITY * 0.3**2 / 2, rel=0.02)
    assert abs(run.trace.joint_effort[run.row(1.1), 0]) < 1e-6


def test_a_motor_that_is_off_for_some_time_takes_its_last_target_again(engine: str) -> None:
    run = held_lift(engine, {"motor": "slide", "at": 0.5, "for": 0.2, "off": None})
    height = run.trace.joint_position[:, 0]
    assert height[run.row(0.7)] == pytest.approx(-GRAVITY * 0.2**2 / 2, rel=0.02)
    assert height[-1] == pytest.approx(0.0, abs=1e-3)
    assert run.trace.joint_effort[-1, 0] == pytest.approx(LOAD * GRAVITY, rel=0.01)


def test_a_weak_motor_has_a_share_of_its_effort(engine: str) -> None:
    run, strong = (
        held_lift(engine, {"motor": "slide", "at": 0.5, "weak": share}, seconds=seconds)
        for share, seconds in (("2 %", 0.9), ("6 %", 2.0))
    )
    # 2 % of 1000 N carry less than the load weighs.
    acceleration = GRAVITY - 0.02 * 1000 / LOAD
    assert run.trace.joint_position[run.row(0.9), 0] == pytest.approx(-acceleration * 0.4**2 / 2, rel=0.02)
    assert run.trace.joint_effort[run.row(0.8), 0] == pytest.approx(20.0, rel=0.01)
    assert abs(strong.trace.joint_position[:, 0]).max() < 1e-3


@pytest.mark.parametrize("interpolation", ["minimum_jerk", "linear", "hold"])
def test_a_stuck_joint_stays_where_it_is_and_then_follows_its_commands_again(engine: str, interpolation: str) -> None:
    points = [{"at": 0.0, "position": {"elbow": 0.0}}, {"at": 2.0, "position": {"elbow": 1.0}}]
    points += [{"at": 2.5, "position": {"elbow": 1.0}}] if interpolation == "hold" else []
    keys = {"commands": {"joints": points, "interpolation": interpolation}, **ALLOW}
    fault = {"motor": "elbow", "at": 1.0, "for": 2.0, "stuck": True}
    run = run_on(engine, Setup(arm(), 4.0, {**keys, "faults": [fault]}, FIXED))
    sound = run_on(engine, Setup(arm(), 4.0, keys, FIXED))
    elbow, wanted = (each.trace.joint_position[:, 1] for each in (run, sound))
    assert elbow[: run.row(1.0)] == pytest.approx(wanted[: run.row(1.0)], abs=1e-12)
    place = wanted[run.row(1.0)]
    assert elbow[run.row(1.2) : run.row(3.0)] == pytest.approx(place, abs=0.002)
    assert elbow[-1] == pytest.approx(wanted[-1], abs=0.002)


@pytest.mark.parametrize(
    "limit",
    [
        {"effort": {"at_most": "30 N"}},
        {"effort": {"joints": ["slide"], "rms_at_most": "30 N"}},
        {"joint": {"name": "slide", "reading": "effort", "at_most": "30 N"}},
        {"joint_within": {"effort": {"*": ["-30 N", "30 N"]}}},
        {"stl": "always (effort(slide) < 30 N)"},
    ],
    ids=" ".join,
)
def test_a_stuck_motor_exceeds_a_limit_above_its_own(engine: str, limit: dict[str, Any], tmp_path: Path) -> None:
    """A motor of 20 N cannot exceed 30 N, but what holds a stuck joint carries the 49 N of its load."""
    (tmp_path / "it.urdf").write_text(lift(LOAD).replace('effort="1000"', 'effort="20"'))
    scenario: dict[str, Any] = {
        "name": "n",
        "robot": {"model": "it.urdf", **FIXED},
        "physics": {"settle": 0},
        "faults": [{"motor": "slide", "at": 0, "stuck": True}],
        "expect": [limit],
        "backend": engine,
        "duration": 1,
        "time_limit": 2,
    }
    (verdict,) = simulated(tmp_path, scenario).verdicts
    assert not verdict.passed
    assert verdict.measured == pytest.approx(LOAD * GRAVITY, rel=0.05)
    fault = scenario["faults"][0]
    for other in ({"at": 2.5}, {"stuck": None, "off": True}):
        kept = {key: value for key, value in {**fault, **other}.items() if value is not None}
        with pytest.raises(InvalidScenario, match="unreachable-limit"):
            simulated(tmp_path, {**scenario, "faults": [kept]})


def test_a_robot_whose_wheel_motor_dies_does_not_drive_on(engine: str) -> None:
    keys: dict[str, Any] = {"commands": [{"twist": [{"linear": 0.2}]}]}
    sound = run_on(engine, Setup("turtlebot3_burger", 6.0, keys))
    keys["faults"] = [{"motor": "wheel_left_joint", "at": 3.0, "stuck": True}]
    broken = run_on(engine, Setup("turtlebot3_burger", 6.0, keys))
    row = sound.row(3.0)
    assert broken.trace.state[:row] == pytest.approx(sound.trace.state[:row], abs=0.0)
    # It turns about the wheel that stands, at the speed of the other one over their distance.
    rate = np.gradient(np.unwrap(broken.trace.yaw), broken.trace.time)[broken.row(4.0) : broken.row(5.5)]
    assert abs(rate).mean() == pytest.approx(0.2 / 0.16, rel=0.03)


def test_a_failure_names_the_faults_before_it(engine: str, tmp_path: Path) -> None:
    """A broken limit only those before that time, a goal that was missed all of them; a pass names none."""
    scenario = {
        "name": "n",
        "robot": {"model": "turtlebot3_burger"},
        "commands": {"twist": [{"linear": 0.2}]},
        "faults": [
            {"motor": "wheel_left_joint", "at": 1.0, "stuck": True},
            {"motor": "wheel_right_joint", "at": 2.0, "off": True},
        ],
        "expect": [{"travel": {"at_least": 1.5}}, {"travel": {"at_most": 0.1}, "severity": "warning"}, "upright"],
        "backend": engine,
        "time_limit": 3,
    }
    missed, broken, upright = (verdict.message for verdict in simulated(tmp_path, scenario).verdicts)
    right = "; motor of joint 'wheel_right_joint' is off from 2.00 s on"
    assert missed.endswith(f"{right}; motor of joint 'wheel_left_joint' is stuck from 1.00 s on")
    assert "motor" not in broken + upright


def sensed(engine: str, folder: Path, sensor: str, *faults: str) -> SimulationRun:
    """The run of a burger that turns in front of a wall 1 m away, with a sensor `it` that is read 10 times a second."""
    lines = "".join(f"\n  - {fault}" for fault in faults) or " []"
    return simulated(
        folder,
        f"""
name: turns
robot: {{model: turtlebot3_burger}}
world: {{objects: [{{name: wall, box: [0.1, 20, 2], pose: {{x: 1.05}}}}]}}
backend: {engine}
commands: {{twist: [{{angular: 0.5}}]}}
sensors: [{{{sensor}, name: it, rate: 10, trace: true}}]
faults:{lines}
expect: [{{path_length: {{at_most: 10}}}}]
allow: [never-moved]
duration: 3 s
time_limit: 3 s
""",
    )


@pytest.mark.parametrize("kind", ["frozen", "silent"])
def test_a_sensor_fails_for_some_time(engine: str, kind: str, tmp_path: Path) -> None:
    run = sensed(engine, tmp_path, "imu: {}", f"{{sensor: it, at: 1 s, for: 1 s, {kind}}}")
    record = run.trace.sensors["it"]
    times = np.round(record.time, 6)
    fails = (times >= 1.0) & (times < 2.0)
    if kind == "silent":
        assert not fails.any()
        assert {0.9, 2.0, 2.9} <= set(times.tolist())
    else:
        values = np.column_stack([record.columns[name] for name in sorted(record.columns)])
        before = values[np.flatnonzero(times < 1.0)[-1]]
        assert fails.sum() == 10
        assert (values[fails] == before).all()
        assert not (values[np.flatnonzero(times >= 2.0)[0]] == before).all()
    assert any("sensor 'it' is" in note for note in run.notes)


@pytest.mark.parametrize(
    ("sensor", "biased", "wanted"),
    [
        ("imu: {gyro_noise: 0.1}", "3 deg/s", ("angular_velocity_xyz", np.deg2rad([3.0] * 3))),
        ("imu: {}", "{linear_acceleration_xyz: [0, 0, 0.5]}", ("linear_acceleration_xyz", [0.0, 0.0, 0.5])),
        ("odometry: {}", "{position_xyz: [10 cm, 0, 0]}", ("position_xyz", [0.1, 0.0, 0.0])),
        ("odometry: {}", "{angular_xyz: [0, 0, 0.1]}", ("angular_xyz", [0.0, 0.0, 0.1])),
        ("lidar: {rays: 9, noise: 0.01, field_of_view: 90 deg}", "-5 cm", ("ranges", -0.05)),
    ],
)
def test_a_biased_sensor_adds_its_error_for_some_time(
    engine: str, sensor: str, biased: str, wanted: tuple[str, Any], tmp_path: Path
) -> None:
    fault = f"{{sensor: it, at: 1 s, for: 1 s, biased: {biased}}}"
    sound, broken = (sensed(engine, tmp_path, sensor, *faults).trace.sensors["it"] for faults in ((), (fault,)))
    times = np.round(sound.time, 6)
    fails = (times >= 1.0) & (times < 2.0)
    assert fails.sum() == 10
    for name, values in sound.columns.items():
        added = np.asarray(wanted[1]) if name == wanted[0] else np.zeros(1)
        finite = np.isfinite(values[fails])
        assert np.where(finite, values[fails] + added, 0.0) == pytest.approx(
            np.where(finite, broken.columns[name][fails], 0.0)
        )
        assert (broken.columns[name][~fails] == values[~fails]).all()


def test_a_range_that_a_bias_moves_out_of_range_is_infinite(engine: str, tmp_path: Path) -> None:
    scan = "lidar: {rays: 1, min_range: 20 cm, range: 3 m}"
    faults = ["{sensor: it, at: 1 s, for: 1 s, biased: -1.9 m}", "{sensor: it, at: 2 s, biased: 5 m}"]
    record = sensed(engine, tmp_path, scan, *faults).trace.sensors["it"]
    ranges, times = record.columns["ranges"][:, 0], np.round(record.time, 6)
    assert np.isfinite(ranges[times < 1.0]).all()
    assert np.isneginf(ranges[(times >= 1.0) & (times < 2.0)]).all()
    assert np.isposinf(ranges[times >= 2.0]).all()


@pytest.mark.parametrize(
    ("sensor", "biased", "message"),
    [
        ("imu: {}", "0.1", "say which one, as in {angular_velocity_xyz: ...}"),
        ("imu: {}", "{angular_velocity_xyz: 1 m}", "is not a unit of"),
        ("imu: {}", "{angular_velocity: 1}", "did you mean 'angular_velocity_xyz'"),
        ("imu: {}", "{orientation_xyzw: 1}", "no readings 'orientation_xyzw' that can be biased"),
        ("imu: {}", "{angular_velocity_xyz: [1, 2]}", "expected one number or 3 (x, y, z), found 2"),
        ("lidar: {}", "[0.1, 0.2]", "expected one number, found 2"),
        ("lidar: {}", "0 m", "an error of 0 changes nothing"),
        ("lidar: {}", "3 kg", "faults.0.biased: 'kg' is not a unit of"),
        ("lidar: {}", "true", "faults.0.biased: expected length or force"),
        ("lidar: {}", "[1, x]", "faults.0.biased.1: expected length or force"),
        ("lidar: {}", "{ranges: [1, x]}", "faults.0.biased.ranges.1: expected length or force"),
        ("lidar: {}", "null", "a sensor needs exactly one of"),
        ("lidar: {}", "{}", "an error of 0 changes nothing"),
        ("lidar: {}", ".nan", "finite"),
    ],
)
def test_a_bias_that_no_sensor_can_have_is_refused(
    engine: str, sensor: str, biased: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidScenario) as error:
        sensed(engine, tmp_path, sensor, f"{{sensor: it, at: 1 s, biased: {biased}}}")
    assert message in str(error.value)
    assert len(error.value.problems) == 1


FAULTS: list[tuple[dict[str, Any], str]] = [
    ({"motor": "elbo", "off": True}, "the model has no moving joint 'elbo'"),
    ({"sensor": "imu", "frozen": True}, "there is no sensor 'imu'"),
    ({"motor": "elbow", "frozen": True}, "a motor needs exactly one of 'off', 'stuck', 'weak'"),
    ({"motor": "elbow", "off": True, "stuck": True}, "a motor needs exactly one of"),
    ({"motor": "elbow", "weak": 1.5}, "weak"),
    ({"motor": "elbow", "off": True, "at": 9.0}, "is not earlier than time_limit"),
    ({"off": True}, "name either a 'motor' or a 'sensor'"),
    ({"payload": {"link": "forearm", "mass": "2 kg"}}, "write it as world: {disturbances: [{payload: 2 kg, link"),
    ({"force": [1, 0, 0], "for": 1}, "write it as world: {disturbances: [{force"),
    ({"patch": {"size": [1, 1], "friction": 0.1}}, "write it as world: {patches: ["),
]
LOADS: list[tuple[dict[str, Any], str]] = [
    ({"payload": -5.0, "link": "carriage"}, "link 'carriage' has only 5 kg"),
    ({"payload": 1.0, "link": "carriag"}, "carriage"),
    ({"payload": 1.0, "link": "base"}, "fixed to the world"),
    ({"payload": 1.0, "link": "carriage", "at": 9.0}, "is not earlier than time_limit"),
    ({"payload": 1.0, "link": "carriage", "for": 9.0}, "but the run ends at time_limit"),
    ({"payload": 1.0, "link": "carriage", "velocity": [1, 0, 0]}, "or 'payload'"),
    ({"payload": 1.0, "link": "carriage", "adhesion": 1.0}, "or 'payload', or 'adhesion'"),
    ({"adhesion": 1.0, "link": "carriage", "force": [1, 0, 0], "for": 1.0}, "or 'payload', or 'adhesion'"),
    ({"adhesion": -1.0, "link": "carriage"}, "adhesion: must be at least 0, found -1"),
    ({"payload": "1 m", "link": "carriage"}, "is not a unit of mass"),
    ({"payload": 1.0, "body": "crate"}, "not a 'body'"),
]
PATCHES: list[tuple[dict[str, Any], str]] = [
    ({"appears": 9.0}, "is not earlier than time_limit"),
    ({"appears": -1.0}, "appears"),
]
SLIPPERY = {"patches": [{"size": [1, 1], "friction": 0.1, "appears": 1.0}], "ground": {"friction": 0}}


@pytest.mark.parametrize(
    ("model", "keys", "message"),
    [
        *((arm(), {"faults": [{"at": 1.0, **fault}]}, message) for fault, message in FAULTS),
        *((lift(LOAD), {"world": {"disturbances": [{"at": 1.0, **load}]}}, message) for load, message in LOADS),
        *(
            (lift(LOAD), {"world": {"patches": [{"size": [1, 1], "friction": 0.1, **patch}]}}, message)
            for patch, message in PATCHES
        ),
        (lift(LOAD), {"world": SLIPPERY}, "state a small one"),
    ],
)
def test_what_cannot_happen_is_refused(engine: str, model: str, keys: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidScenario) as error:
        run_on(engine, Setup(model, 2.0, {**keys, **ALLOW}, FIXED))
    assert message in str(error.value)


def loaded(engine: str, model: str, *loads: dict[str, Any], seconds: float = 2.0, **robot: Any) -> Run:
    keys = {"world": {"disturbances": list(loads)}, **ALLOW}
    return run_on(engine, Setup(model, seconds, keys, robot or FIXED, rate=1000.0))


@pytest.mark.parametrize("mass", [2.0, -3.0])
def test_a_payload_for_some_time_changes_the_effort_that_holds_a_link(engine: str, mass: float) -> None:
    run = loaded(engine, lift(LOAD), {"payload": mass, "link": "carriage", "at": 0.5, "for": 0.8})
    for time, carried in ((0.4, LOAD), (1.2, LOAD + mass), (1.9, LOAD)):
        effort = run.trace.joint_effort[run.row(time), 0]
        assert effort == pytest.approx(carried * GRAVITY, rel=0.005)
    assert abs(run.trace.joint_position[:, 0]).max() < 1e-3


@pytest.mark.parametrize(("link_name", "ahead"), [("lower", 0.25), ("payload", 0.5)])
def test_a_payload_acts_at_the_centre_of_mass_of_its_link(engine: str, link_name: str, ahead: float) -> None:
    run = loaded(engine, arm(), {"payload": 4.0, "link": link_name, "at": 0.5})
    # 1 kg at 0.25 m, at 0.75 m, and at 1 m of the shoulder; the payload is `ahead` of the elbow, at 0.5 m.
    before, after = (run.trace.joint_effort[run.row(time)] for time in (0.4, 1.9))
    assert abs(before) == pytest.approx([GRAVITY * 2.0, GRAVITY * 0.75], rel=0.01)
    carried = 4.0 * GRAVITY
    wanted = [GRAVITY * 2.0 + carried * (0.5 + ahead), GRAVITY * 0.75 + carried * ahead]
    assert abs(after) == pytest.approx(wanted, rel=0.01)


@pytest.mark.parametrize("shape", ["", collision(box_shape((0.2, 0.2, 0.2)))], ids=["no shape", "a shape"])
def test_a_payload_adds_no_inertia_about_the_centre_of_mass(engine: str, shape: str) -> None:
    # A torque turns the joint about the centre of mass, where only the inertia counts, and gravity does not.
    inertia = 0.02
    text = robot(
        link("base", inertial(1.0, (1.0, 1.0, 1.0))),
        link("rotor", inertial(1.0, (0.01, inertia, 0.03)) + shape),
        joint("spin", "revolute", "base", "rotor", limit='lower="-50" upper="50" effort="10" velocity="90"'),
    )
    keys = {
        "commands": {"joints": [{"at": 0.0, "effort": {"spin": 0.1}}], "interpolation": "hold"},
        "world": {"disturbances": [{"payload": 9.0, "link": "rotor", "at": 0.0}]},
        **ALLOW,
    }
    run = run_on(engine, Setup(text, 1.0, keys, FIXED, rate=1000.0))
    assert abs(run.trace.joint_velocity[run.row(0.9), 0]) == pytest.approx(0.9 * 0.1 / inertia, rel=0.02)


def test_a_force_accelerates_a_robot_by_its_mass_with_the_payload(engine: str) -> None:
    body = robot(link("base", inertial(2.0, (0.1, 0.1, 0.1)) + collision(box_shape((0.3, 0.3, 0.3)))))
    push = {"force": [10.0, 0.0, 0.0], "at": 0.1, "for": 0.5}
    run = loaded(engine, body, {"payload": 3.0, "at": 0.1}, push, seconds=0.7, base="free", pose={"z": 100.0})
    # It falls from the start of the 2 s on in which robots settle.
    assert run.trace.base_linear_xyz[run.row(0.6), 0] == pytest.approx(10.0 / 5.0 * 0.5, rel=0.01)
    assert run.trace.base_linear_xyz[run.row(0.6), 2] == pytest.approx(-GRAVITY * (2.0 + 0.6), rel=0.01)


def test_faults_and_other_events_are_marked_on_the_timeline_of_the_report(engine: str, tmp_path: Path) -> None:
    path = tmp_path / "it.sim.yml"
    path.write_text(
        f"""
name: stands
robot: {{model: turtlebot3_burger}}
backend: {engine}
world:
  objects: [{{name: crate, box: [0.1, 0.1, 0.1], pose: {{x: 2}}, appears: 0.4 s}}]
  patches: [{{x: 3, size: [1, 1], friction: 0.1, appears: 0.45 s}}]
  disturbances:
    - {{payload: 500 g, link: base_scan, at: 0.1 s, for: 0.2 s}}
    - {{velocity: [0, 0.1, 0], at: 0.3 s}}
    - {{force: [3 N, 4 N, 0], at: 0.3 s, for: 0.1 s, link: base_footprint}}
    - {{payload: 1 kg, at: 2 s}}
sensors: [{{imu: {{}}, name: imu}}]
faults:
  - {{sensor: imu, at: 0.2 s, biased: 3 deg/s}}
  - {{motor: wheel_left_joint, at: 0 s, for: 0.1 s, off}}
expect: [{{path_length: {{at_most: 10}}}}]
allow: [never-moved]
duration: 0.5 s
time_limit: 3 s
"""
    )
    it = load_scenario(path)
    scene = build_scene(it)
    footage = RunRecorder(it.scenario, filmed=True)
    simulate(it.scenario, scene, lambda _: None, footage)
    film = footage.film()
    assert film is not None
    assert footage.start is not None
    make_replay(it.scenario, scene, footage.start, film, tmp_path / "run.html", events=footage.marks)
    assert [(event.time, event.until, event.words) for event in read_replay(tmp_path / "run.html").events] == [
        (0.0, 0.1, "motor of joint 'wheel_left_joint' is off"),
        (0.1, pytest.approx(0.3), "link 'base_scan' loaded with 0.5 kg"),
        (0.2, None, "sensor 'imu' is biased by 3 deg/s"),
        (0.3, None, "pushed by 0.1 m/s"),
        (0.3, pytest.approx(0.4), "link 'base_footprint' pushed with 5 N"),
        (0.4, None, "body 'crate' appeared"),
        (0.45, None, "the patch at (3, 0) m with a friction of 0.1 appeared"),
    ]


def test_payloads_may_not_take_the_whole_mass_together(engine: str) -> None:
    half = {"payload": -2.5, "link": "carriage", "at": 0.2, "for": 0.2}
    loaded(engine, lift(LOAD), half, {**half, "at": 0.5})
    with pytest.raises(InvalidScenario, match="some of it must be left"):
        loaded(engine, lift(LOAD), half, {**half, "at": 0.3})


def test_a_payload_moves_the_centre_of_mass_over_the_feet(engine: str, tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(quadruped())

    def margin(*loads: dict[str, Any]) -> float:
        scenario = {
            "name": "stands",
            "robot": {"model": "robot.urdf", "joints": STANCE},
            "backend": engine,
            "world": {"disturbances": loads},
            "expect": [{"support_margin": {"links": ["*_foot"], "at_least": 0.05}}],
            "duration": 1.0,
            "time_limit": 1.0,
        }
        return simulated(tmp_path, scenario).verdicts[0].measured or 0.0

    # The feet are 0.3 m apart, and the robot weighs 12.6 kg.
    assert margin() == pytest.approx(0.15, abs=0.002)
    load = {"payload": 4.0, "link": "front_left_foot", "at": 0.5}
    assert margin(load) == pytest.approx(0.15 - 0.15 * 4.0 / 16.6, abs=0.002)


@pytest.mark.parametrize("friction", [0.1, 0.0, 2.0])
def test_a_patch_that_appears_changes_the_friction_of_what_slides_on_it(engine: str, friction: float) -> None:
    crate = robot(
        link("base", inertial(2.0, box_inertia(2.0, (0.4, 0.4, 0.1))) + collision(box_shape((0.4, 0.4, 0.1))), 0.5)
    )
    patch = {"x": 2, "size": [8, 8], "friction": friction, "appears": 0.5}
    world = {"patches": [patch], "disturbances": [{"velocity": [5.0, 0, 0], "at": 0.1}]}
    run = run_on(
        engine,
        Setup(crate, 0.9, {"world": world, "physics": {"rate": 1000, "settle": 2}}, {"pose": {"x": 0.0}}, rate=1000.0),
    )
    speed = run.trace.base_linear_xyz[:, 0]
    assert speed[run.row(0.5)] == pytest.approx(5.0 - 0.5 * GRAVITY * 0.4, rel=0.01)
    assert speed[run.row(0.5)] - speed[run.row(0.8)] == pytest.approx(
        0.5 * friction * GRAVITY * 0.3, rel=0.02, abs=0.005
    )


def test_wheels_slip_on_a_patch_that_appears(engine: str) -> None:
    keys: dict[str, Any] = {"commands": {"twist": [{"linear": 0.2, "for": 2}, {"linear": -0.2}]}, "world": {}}
    keys["world"]["patches"] = [{"size": [8, 8], "friction": 0.001, "appears": 1.0}]
    run = run_on(engine, Setup("turtlebot3_burger", 4.0, keys))
    # The wheels reverse at 2 s, but the robot slides on: 0.001 g changes 0.2 m/s by 0.02 m/s in 2 s.
    assert run.trace.base_linear_xyz[-1, 0] > 0.15

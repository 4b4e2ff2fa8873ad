"""Real robots drive a line, a circle and an eight by twists, in the real engine, against the analytic path.

The analytic path is that of a point that moves as it is told, with wheels (or a car's speed) that ramp at the
acceleration of the drive. `off`: how far from it the base is at the most, of the way's length. `yaw_off`: how much too
far, or too little, it has turned in the end, of all its turning. All are as measured, and a little.

Two wheels follow the command. So does a car, except for the width of its wheels, which touch the ground at both of
their edges: those of racecar are 45 mm wide, on circles of 1 m. Skid steer drives straight as well as the others, and
turns within 1 to 5 %. husky is heavier at the back, so it turns about a point behind its middle, and its path differs
by as much.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

from sim_action.simulation.loop import SimulationRun
from sim_action.state.trace import FloatArray, Trace
from tests.integration.engines import on_every_engine
from tests.simulated import simulated
from tests.soak import soaked
from tools.bench.robots import BURGER, ROBOTS, KnownRobot

RATE: Final = 240
Segment = dict[str, float]

KNOWN: Final = {known.name: known for known in (BURGER, *ROBOTS)}
HUSKYS: Final = {side: [f"front_{side}_wheel", f"rear_{side}_wheel"] for side in ("left", "right")}
R2D2S: Final = {side: [f"{side}_front_wheel_joint", f"{side}_back_wheel_joint"] for side in ("left", "right")}


@dataclass(frozen=True)
class Driven:
    """A robot, how fast it drives, and how well."""

    name: str
    speed: float  # speed, turn: m/s and rad/s of the circle
    turn: float
    off: Mapping[str, tuple[float, float, float]]  # engine -> of the way's length, for a line, a circle and an eight
    yaw_off: Mapping[str, tuple[float, float, float]]  # engine -> of all turning, for the same; rad for a line
    separation: float | None = None  # m, in effect; None for a car, which is told a curve
    heading: float = 0.0  # rad, of forward in the base frame
    acceleration: float = 1.0
    drive: Mapping[str, object] = field(default_factory=dict)  # where it is not the one that is recognised


ROBOTS_DRIVEN: Final = (
    Driven(
        "burger",
        0.2,
        0.5,
        separation=0.16,
        off={"pybullet": (0.001, 0.0015, 0.0015), "mujoco": (0.001, 0.0015, 0.0015)},
        yaw_off={"pybullet": (0.002, 0.001, 0.001), "mujoco": (0.001, 0.0015, 0.001)},
    ),
    Driven(
        "husky",
        0.5,
        0.5,
        # 0.5708 m between its wheels, and a slip of 1.54: three fifths of its weight are on the rear ones.
        separation=0.5708 * 1.54,
        off={"pybullet": (0.001, 0.04, 0.065), "mujoco": (0.001, 0.05, 0.085)},
        yaw_off={"pybullet": (0.001, 0.035, 0.005), "mujoco": (0.001, 0.05, 0.005)},
    ),
    Driven(
        "r2d2",
        0.3,
        0.3,
        separation=0.44 * 1.438,
        heading=math.pi / 2,
        # Its wheels have the inertia of flywheels (1 kg m^2): at 1 m/s^2 they would lift its front off the ground.
        acceleration=0.2,
        drive={"drive": {"skid": {**R2D2S, "acceleration": 0.2}}},
        # Tyres creep while it speeds up.
        off={"pybullet": (0.001, 0.03, 0.035), "mujoco": (0.002, 0.01, 0.015)},
        yaw_off={"pybullet": (0.001, 0.035, 0.015), "mujoco": (0.001, 0.02, 0.01)},
    ),
    Driven(
        "racecar",
        0.5,
        0.5,
        off={"pybullet": (0.001, 0.02, 0.03), "mujoco": (0.001, 0.01, 0.01)},
        yaw_off={"pybullet": (0.001, 0.02, 0.02), "mujoco": (0.001, 0.01, 0.006)},
    ),
)

# Both husky and r2d2 have skid steer; r2d2 takes three times as long.
MARKS: Final = {"burger": (), "r2d2": (pytest.mark.pybullet, pytest.mark.soak)}

every_robot = pytest.mark.parametrize(
    "robot",
    [
        pytest.param(robot, marks=MARKS.get(robot.name, (pytest.mark.pybullet,)), id=robot.name)
        for robot in ROBOTS_DRIVEN
    ],
)


def segments(shape: str, robot: Driven) -> list[Segment]:
    """The shape as twists; a circle takes as long as whole ticks of the command let it."""
    around = round(2 * math.pi / robot.turn, 1)
    if shape == "line":
        return [{"linear": robot.speed, "for": 6.0}]
    circle = {"linear": robot.speed, "for": around}
    turns = {"circle": (1,), "eight": (1, -1)}[shape]
    return [{**circle, "angular": way * robot.turn} for way in turns]


def run(folder: Path, known: KnownRobot, twist: list[Segment], **parts: Any) -> SimulationRun:
    """Drives, and then stands for 5 s; in PyBullet, if nobody says otherwise."""
    seconds = sum(segment["for"] for segment in twist) + 5
    scenario = {
        "name": "drives",
        "robot": {"model": known.path, **known.keys, **parts.pop("robot", {})},
        "commands": {"rate": "10 Hz", "twist": twist},
        "expect": [{"upright": {"max_tilt": "10 deg"}}],
        "time_limit": seconds,
        "trace": {"rate": RATE},
        "backend": "pybullet",
        **parts,
    }
    done = simulated(folder, scenario, outside=True)
    assert all(verdict.passed for verdict in done.verdicts)
    return done


def told(twist: list[Segment], key: str, steps: int) -> FloatArray:
    """What is commanded in each step; 0 after the last segment."""
    each = [np.full(round(segment["for"] * RATE), segment.get(key, 0.0)) for segment in twist]
    whole = np.concatenate(each)
    return np.concatenate((whole, np.zeros(steps - len(whole))))


def ramped(wanted: FloatArray, acceleration: float) -> FloatArray:
    """Speeds that follow what is wanted, and change no faster than they may."""
    speed, speeds = 0.0, []
    for goal in wanted:
        speed += float(np.clip(goal - speed, -acceleration / RATE, acceleration / RATE))
        speeds.append(speed)
    return np.array(speeds)


def motion(robot: Driven, twist: list[Segment], steps: int) -> tuple[FloatArray, FloatArray]:
    """Forward speed in m/s and turning rate in rad/s in each step."""
    linear, angular = told(twist, "linear", steps), told(twist, "angular", steps)
    if robot.separation is None:
        # A car goes on along its curve while it slows down.
        curvature = np.concatenate([np.full(round(s["for"] * RATE), s.get("angular", 0) / s["linear"]) for s in twist])
        curvature = np.concatenate((curvature, np.full(steps - len(curvature), curvature[-1])))
        speed = ramped(linear, robot.acceleration)
        return speed, speed * curvature
    half = robot.separation / 2
    left, right = (ramped(linear + side * half * angular, robot.acceleration) for side in (-1, 1))
    return (left + right) / 2, (right - left) / (2 * half)


@dataclass(frozen=True)
class Compared:
    """How a run compares: in m, m, rad and rad."""

    length: float
    furthest: float
    turning: float
    yaw_error: float


def compared(trace: Trace, robot: Driven, twist: list[Segment]) -> Compared:
    speed, turn = motion(robot, twist, len(trace) - 1)
    yaw = trace.yaw[0] + np.concatenate(([0.0], np.cumsum(turn))) / RATE
    towards = (yaw[1:] + yaw[:-1]) / 2 + robot.heading
    steps = np.column_stack((speed * np.cos(towards), speed * np.sin(towards))) / RATE
    path = trace.base_position_xyz[0, :2] + np.concatenate((np.zeros((1, 2)), np.cumsum(steps, axis=0)))
    off = np.linalg.norm(trace.base_position_xyz[:, :2] - path, axis=1)
    turned = np.unwrap(trace.yaw)
    return Compared(
        length=float(np.abs(speed).sum() / RATE),
        furthest=float(off.max()),
        turning=float(np.abs(turn).sum() / RATE),
        yaw_error=float(abs((turned[-1] - turned[0]) - (yaw[-1] - yaw[0]))),
    )


# An eight begins with the circle.
@every_robot
@on_every_engine
@pytest.mark.parametrize(
    ("number", "shape"), soaked([(0, "line"), (1, "circle"), (2, "eight")], short=[(0, "line"), (2, "eight")])
)
def test_it_drives_what_it_is_told(robot: Driven, engine: str, number: int, shape: str, tmp_path: Path) -> None:
    twist = segments(shape, robot)
    done = run(tmp_path, KNOWN[robot.name], twist, robot=robot.drive, backend=engine)
    found = compared(done.trace, robot, twist)
    assert found.furthest <= robot.off[engine][number] * found.length
    assert found.yaw_error <= robot.yaw_off[engine][number] * max(found.turning, 1.0)


@pytest.mark.parametrize("name", ["burger", "husky", "r2d2", "racecar"])
def test_its_drive_is_recognised_and_told_with_every_figure(name: str, tmp_path: Path) -> None:
    done = run(tmp_path, KNOWN[name], [{"linear": 0.0, "for": 0.1}])
    kinds = {"burger": "diff drive: ", "husky": "skid steer: ", "r2d2": "skid steer: ", "racecar": "ackermann: "}
    figures = {"burger": "0.16 m", "husky": "x slip 1.54", "r2d2": "heading 90 deg", "racecar": "wheelbase 0.325 m"}
    (note,) = (note for note in done.notes if note.startswith(f"recognised: {kinds[name]}"))
    assert figures[name] in note


def test_a_car_that_is_told_to_turn_on_the_spot_stands_still(tmp_path: Path) -> None:
    done = run(tmp_path, KNOWN["racecar"], [{"angular": 1.0, "for": 2.0}])
    assert done.travelled < 0.001
    assert (
        "a twist asked for a turn on the spot, which Ackermann steering cannot do: the robot stood still" in done.notes
    )


def test_a_car_takes_the_tightest_curve_it_can(tmp_path: Path) -> None:
    """Its inner wheel is turned by 1 rad: 0.325 m / tan(1 rad) beside it, which is 0.1 m off the middle."""
    done = run(tmp_path, KNOWN["racecar"], [{"linear": 0.2, "angular": 2.0, "for": 8.0}])
    radius = 0.325 / math.tan(1.0) + 0.1
    middle = slice(4 * RATE, 8 * RATE)
    turned = float(np.ptp(np.unwrap(done.trace.yaw)[middle]))
    assert turned == pytest.approx(4 * 0.2 / radius, rel=0.1)
    assert "a twist asked for a tighter curve than the steering allows: the robot took the tightest curve" in done.notes


# At 0 degrees it is the first half of an eight.
@pytest.mark.parametrize("degrees", soaked([20, 45, 70], short=[45]))
def test_skid_steer_turns_alike_wherever_it_faces(degrees: int, tmp_path: Path) -> None:
    twist = [{"linear": 0.5, "angular": 0.5, "for": 12.6}]
    done = run(tmp_path, KNOWN["husky"], twist, robot={"pose": {"yaw": f"{degrees} deg"}})
    husky = next(robot for robot in ROBOTS_DRIVEN if robot.name == "husky")
    found = compared(done.trace, husky, twist)
    assert found.furthest <= husky.off["pybullet"][1] * found.length
    assert found.yaw_error <= husky.yaw_off["pybullet"][1] * found.turning


@on_every_engine
def test_rotors_do_not_change_how_far_skid_steer_turns(engine: str, tmp_path: Path) -> None:
    twist = [{"linear": 0.5, "angular": 0.5, "for": 6.0}]
    turned = [
        float(np.ptp(np.unwrap(run(tmp_path, KNOWN["husky"], twist, robot={"drive": drive}, backend=engine).trace.yaw)))
        for drive in ({"skid": HUSKYS}, {"skid": {**HUSKYS, "rotor_inertia": 0.7}})
    ]
    assert turned[1] == pytest.approx(turned[0], rel=0.02)


def test_a_slip_that_is_stated_is_what_counts(tmp_path: Path) -> None:
    twist = [{"angular": 0.5, "for": 4.0}]
    turned = [
        float(np.ptp(np.unwrap(run(tmp_path, KNOWN["husky"], twist, robot={"drive": {"skid": skid}}).trace.yaw)))
        for skid in ({**HUSKYS, "slip": 1.2}, {**HUSKYS, "slip": 1.8})
    ]
    assert turned[1] / turned[0] == pytest.approx(1.8 / 1.2, rel=0.05)


ROVER: Final = KnownRobot("rover", str(Path(__file__).parents[2] / "examples/drives/rover.urdf"))
CORNERS: Final = {side: [f"front_{side}_wheel_joint", f"rear_{side}_wheel_joint"] for side in ("left", "right")}


@on_every_engine
def test_skid_steer_slips_alike_if_joint_commands_turn_the_wheels(engine: str, tmp_path: Path) -> None:
    """At 1.21 rad/s all forces and moments are in balance, see `test_agreement`."""
    speeds = {name: speed for side, speed in (("left", -3.0), ("right", 3.0)) for name in HUSKYS[side]}
    trajectory = {"joints": [{"at": 0, "velocity": speeds}]}
    trace = run(tmp_path, KNOWN["husky"], [], commands=trajectory, backend=engine).trace
    assert trace.base_angular_xyz[2 * RATE :, 2].mean() == pytest.approx(1.21, rel=0.06)


@on_every_engine
def test_skid_steer_turns_on_a_body_that_moves(engine: str, tmp_path: Path) -> None:
    """A platform that drives away carries the robot, which turns on the spot by 5 s x 0.8 rad/s."""
    path = [{"at": 0.1, "x": 0.0}, {"at": 1.1, "x": 0.25}, {"at": 9.0, "x": 4.2}]
    plate = {"name": "plate", "box": [12.0, 6.0, 0.1], "path": path}
    robot = {"drive": {"skid": CORNERS}, "pose": {"z": 0.2}}
    twist = [{"angular": 0.8, "for": 5.0}]
    trace = run(tmp_path, ROVER, twist, robot=robot, world={"objects": [plate]}, backend=engine).trace
    assert np.ptp(np.unwrap(trace.yaw)) == pytest.approx(4.0, rel=0.03)
    assert trace.base_position_xyz[-1] == pytest.approx([4.2, 0.0, 0.2], abs=0.1)


@on_every_engine
def test_skid_steer_turns_a_body_on_ice_the_other_way(engine: str, tmp_path: Path) -> None:
    """Nothing else can take up the angular momentum of the rover, which turns by 5 s x 0.8 rad/s on the plate."""
    plate = {"name": "plate", "box": [1.2, 1.2, 0.02], "mass": 2.0, "friction": 0.8}
    world = {"ground": {"friction": 0.0}, "objects": [plate]}
    robot = {"drive": {"skid": CORNERS}, "pose": {"z": 0.12}}
    trace = run(tmp_path, ROVER, [{"angular": 0.8, "for": 5.0}], robot=robot, world=world, backend=engine).trace
    # About the vertical through the middle, in kg m^2.
    plates, rovers = 2.0 * (1.2**2 + 1.2**2) / 12, 0.2267 + 4 * (0.001317 + 0.5 * (0.2**2 + 0.175**2))
    assert np.ptp(np.unwrap(trace.yaw)) == pytest.approx(4.0 * plates / (plates + rovers), rel=0.03)


@on_every_engine
@pytest.mark.parametrize(("degrees", "way"), [(0, (1.0, 0.0)), (90, (0.0, 1.0)), (150, (-math.sqrt(0.75), 0.5))])
def test_mecanum_wheels_go_any_way_and_face_ahead(
    engine: str, degrees: int, way: tuple[float, float], tmp_path: Path
) -> None:
    twist = [{"linear": 0.5 * way[0], "lateral": 0.5 * way[1], "for": 4.0}]
    trace = run(tmp_path, ROVER, twist, robot={"drive": {"mecanum": CORNERS}}, backend=engine).trace
    # It slows down for as long as it sped up.
    gone = trace.base_position_xyz[-1, :2] - trace.base_position_xyz[0, :2]
    assert gone == pytest.approx([2.0 * way[0], 2.0 * way[1]], abs=0.02)
    assert abs(trace.yaw[-1]) < math.radians(2)
    front_left = trace.joint_velocity[2 * RATE, trace.joint_names.index("front_left_wheel_joint")]
    assert front_left == pytest.approx((0.5 * way[0] - 0.5 * way[1]) / 0.1, abs=0.01)


@on_every_engine
def test_mecanum_wheels_turn_on_the_spot(engine: str, tmp_path: Path) -> None:
    trace = run(
        tmp_path, ROVER, [{"angular": 0.5, "for": 4.0}], robot={"drive": {"mecanum": CORNERS}}, backend=engine
    ).trace
    assert trace.yaw[-1] - trace.yaw[0] == pytest.approx(2.0, rel=0.02)
    assert np.linalg.norm(trace.base_position_xyz[-1, :2] - trace.base_position_xyz[0, :2]) < 0.01


@on_every_engine
def test_mecanum_wheels_push_no_harder_than_they_may(engine: str, tmp_path: Path) -> None:
    """10 kg and 5 N: 0.5 m/s after a second, and 0.25 m less than at once."""
    spec = {"mecanum": {**CORNERS, "force": 5.0, "acceleration": 100.0}}
    trace = run(tmp_path, ROVER, [{"lateral": 0.5, "for": 4.0}], robot={"drive": spec}, backend=engine).trace
    assert trace.base_linear_xyz[RATE // 2, 1] == pytest.approx(0.25, rel=0.02)
    assert trace.base_position_xyz[4 * RATE, 1] - trace.base_position_xyz[0, 1] == pytest.approx(1.75, rel=0.02)

"""Drives of real robots: what is recognised, what the table of accuracy does not measure, and paths of waypoints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

from sim_action.commands.waypoints import Leg, Point
from sim_action.engines import ENGINES
from sim_action.simulation.loop import SimulationRun
from tests.integration.engines import on_every_engine
from tests.simulated import simulated
from tools.bench.robots import BURGER, ROBOTS, KnownRobot

RATE: Final = 240
Segment = dict[str, float]
KNOWN: Final = {known.name: known for known in (BURGER, *ROBOTS)}
HUSKYS: Final = {side: [f"front_{side}_wheel", f"rear_{side}_wheel"] for side in ("left", "right")}


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


@pytest.mark.parametrize("name", ["burger", "husky", "r2d2", "racecar"])
def test_its_drive_is_recognised_and_told_with_every_figure(name: str, tmp_path: Path) -> None:
    done = run(tmp_path, KNOWN[name], [{"linear": 0.0, "for": 0.1}])
    kinds = {"burger": "diff drive: ", "husky": "skid steer: ", "r2d2": "skid steer: ", "racecar": "ackermann: "}
    figures = {"burger": "0.16 m", "husky": "x slip 1.54", "r2d2": "heading 90 deg", "racecar": "wheelbase 0.325 m"}
    (note,) = (note for note in done.notes if note.startswith(f"recognised: {kinds[name]}"))
    assert figures[name] in note


def test_a_car_takes_the_tightest_curve_it_can(tmp_path: Path) -> None:
    """Its inner wheel is turned by 1 rad: 0.325 m / tan(1 rad) beside it, which is 0.1 m off the middle."""
    done = run(tmp_path, KNOWN["racecar"], [{"linear": 0.2, "angular": 2.0, "for": 8.0}])
    radius = 0.325 / math.tan(1.0) + 0.1
    middle = slice(4 * RATE, 8 * RATE)
    turned = float(np.ptp(np.unwrap(done.trace.yaw)[middle]))
    assert turned == pytest.approx(4 * 0.2 / radius, rel=0.1)
    assert "a twist asked for a tighter curve than the steering allows: the robot took the tightest curve" in done.notes


@on_every_engine
def test_rotors_do_not_change_how_far_skid_steer_turns(engine: str, tmp_path: Path) -> None:
    twist = [{"linear": 0.5, "angular": 0.5, "for": 6.0}]
    turned = [
        float(np.ptp(np.unwrap(run(tmp_path, KNOWN["husky"], twist, robot={"drive": drive}, backend=engine).trace.yaw)))
        for drive in ({"skid": HUSKYS}, {"skid": {**HUSKYS, "rotor_inertia": 0.7}})
    ]
    assert turned[1] == pytest.approx(turned[0], rel=0.02)


ROVER: Final = KnownRobot("rover", str(Path(__file__).parents[2] / "examples/drives/rover.urdf"))
CORNERS: Final = {side: [f"front_{side}_wheel_joint", f"rear_{side}_wheel_joint"] for side in ("left", "right")}


@on_every_engine
def test_skid_steer_slips_alike_if_joint_commands_turn_the_wheels(engine: str, tmp_path: Path) -> None:
    """At 1.21 rad/s all forces and moments are in balance."""
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
def test_mecanum_wheels_push_no_harder_than_they_may(engine: str, tmp_path: Path) -> None:
    """10 kg and 5 N: 0.5 m/s after a second, and 0.25 m less than at once."""
    spec = {"mecanum": {**CORNERS, "force": 5.0, "acceleration": 100.0}}
    trace = run(tmp_path, ROVER, [{"lateral": 0.5, "for": 4.0}], robot={"drive": spec}, backend=engine).trace
    assert trace.base_linear_xyz[RATE // 2, 1] == pytest.approx(0.25, rel=0.02)
    assert trace.base_position_xyz[4 * RATE, 1] - trace.base_position_xyz[0, 1] == pytest.approx(1.75, rel=0.02)


# The path turns by 90 deg twice, by 135 deg once, by 45 deg once, where nobody stops, and crosses itself. `off`: how
# far from it the base is at most, in m. A car cuts corners; who turns on the spot leaves the path where it does not, at
# 45 deg, and slips while it turns (r2d2 the most). `near`: how far from the furthest of the waypoints. `end`: how far
# from the last, at rest. All are as measured, and a little.
PATH_RATE: Final = 120
PATH: Final = ((1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.5, 0.5), (1.5, 0.5))


@dataclass(frozen=True)
class Follower:
    """A robot, how large its path is, how it drives, and in PyBullet and MuJoCo how well, in m."""

    name: str
    scale: float  # of the path
    figures: Mapping[str, object]
    off: tuple[float, float]
    near: tuple[float, float]
    end: tuple[float, float]
    robot: Mapping[str, object] = field(default_factory=dict)


def figures(speed: float, lookahead: float, tolerance: float, **more: float) -> dict[str, float]:
    return {"speed": speed, "lookahead": lookahead, "tolerance": tolerance, **more}


R2D2S: Final = {side: [f"{side}_front_wheel_joint", f"{side}_back_wheel_joint"] for side in ("left", "right")}
# Its wheels have the inertia of flywheels.
R2D2: Final = {"drive": {"skid": {**R2D2S, "acceleration": 0.2}}}
NEAR: Final = (0.01, 0.01)
FOLLOWERS: Final = (
    Follower("burger", 1.0, figures(0.2, 0.3, 0.05), (0.07, 0.07), NEAR, NEAR),
    Follower("husky", 2.0, figures(0.5, 0.6, 0.1, max_turn_rate=0.8), (0.17, 0.12), NEAR, NEAR),
    Follower("r2d2", 2.0, figures(0.3, 0.6, 0.1, max_turn_rate=0.5), (0.28, 0.2), (0.02, 0.015), (0.02, 0.015), R2D2),
    Follower("racecar", 2.0, figures(0.5, 0.5, 0.05), (0.22, 0.22), (0.28, 0.28), NEAR),
)
IN_SOAK: Final = (pytest.mark.pybullet, pytest.mark.soak)


def waypoints(follower: Follower) -> list[Point]:
    return [(follower.scale * x, follower.scale * y) for x, y in PATH]


def nearest_in_turn(places: list[Point], points: list[Point], within: float) -> list[float]:
    """How near it came to each point, on its way from within some distance of the one before to the next one."""
    firsts, first = [], 0
    for point in points:
        first += next(index for index, place in enumerate(places[first:]) if math.dist(place, point) <= within)
        firsts.append(first)
    stretches = zip(points, firsts, [*firsts[1:], len(places)], strict=True)
    return [min(math.dist(place, point) for place in places[here:after]) for point, here, after in stretches]


@on_every_engine
@pytest.mark.parametrize(
    "follower", [pytest.param(each, marks=() if each.name == "burger" else IN_SOAK, id=each.name) for each in FOLLOWERS]
)
def test_it_follows_five_waypoints(follower: Follower, engine: str, tmp_path: Path) -> None:
    commands = {"waypoints": [{"x": x, "y": y} for x, y in waypoints(follower)], **follower.figures}
    keys = {"commands": commands, "time_limit": "75 s", "trace": {"rate": PATH_RATE}, "backend": engine}
    done = run(tmp_path, KNOWN[follower.name], [], robot=follower.robot, **keys)
    places: list[Point] = [(x, y) for x, y, _ in done.trace.base_position_xyz.tolist()]
    points = waypoints(follower)
    legs = [Leg(*ends) for ends in zip([places[0], *points], points, strict=False)]
    off = max(min(math.dist(place, leg.closest(place)) for leg in legs) for place in places)
    column = list(ENGINES).index(engine)
    assert off <= follower.off[column]
    assert max(nearest_in_turn(places, points, 0.3 * follower.scale)) <= follower.near[column]
    assert math.dist(places[-1], points[-1]) <= follower.end[column]
    assert float(np.abs(done.trace.speed[-PATH_RATE:]).max()) < 0.005
    # Nothing was asked of the drive that it cannot do.
    assert not [note for note in done.notes if "a twist asked" in note]

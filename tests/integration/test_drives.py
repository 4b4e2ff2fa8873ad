"""Drives of real robots in the real engine: what is recognised, and what the table of accuracy does not measure."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

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

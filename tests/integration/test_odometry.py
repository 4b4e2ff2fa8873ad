"""Wheel odometry against the truth, in real engines.

`off`: how far from the truth the pose that is believed comes at the most, of the way; `yaw_off`: the same of the
heading, of all turning. All are as measured, and a little.

Two wheels and a car know their circle as well as they drive it. Skid steer slips sideways and lengthwise when it turns,
so that what it believes is off by as much as its slip is: the rover by less than 1 % of the turning, husky by up to
4 %. husky, being heavier behind, also turns about a point behind its middle, which costs it 6 to 8 % of its place. What
all of them have, mecanum wheels too, is half a step of turning by which the engines' steps are off an arc.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from sim_action.core.lazy_numpy import FloatArray
from sim_action.engines import ENGINES
from sim_action.simulation.loop import SimulationRun
from tests.integration.engines import BALL, on_every_engine
from tests.scenarios import LEAST, told
from tests.simulated import simulated
from tests.traces import WHEELS
from tools.bench.robots import ROBOTS

Twist = dict[str, float]
ROOT: Final = Path(__file__).resolve().parents[2]
KNOWN: Final = {known.name: known for known in ROBOTS}
RATE: Final = 20
TIME: Final = 6.0


@dataclass(frozen=True)
class Rolling:
    """A robot, how fast it drives, and in PyBullet and MuJoCo how well it knows where it is on a circle."""

    name: str
    model: str
    speed: float
    turn: float
    off: tuple[float, float]
    yaw_off: tuple[float, float]
    keys: Mapping[str, object] = field(default_factory=dict)


ROVERS: Final = {side: [f"{end}_{side}_wheel_joint" for end in ("front", "rear")] for side in ("left", "right")}
DRIVES: Final = ROOT / "examples/drives"
ROVER: Final = str(DRIVES / "rover.urdf")
OURS: Final = (
    Rolling("burger", "turtlebot3_burger", 0.2, 0.5, (0.003, 0.003), (0.002, 0.002)),
    Rolling("rover", ROVER, 0.4, 0.4, (0.04, 0.02), (0.01, 0.005), {"drive": {"skid": ROVERS}}),
    Rolling("mecanum", ROVER, 0.4, 0.4, (0.002, 0.002), (0.001, 0.001), {"drive": {"mecanum": ROVERS}}),
    Rolling("car", str(DRIVES / "car.urdf"), 0.5, 0.5, (0.003, 0.004), (0.003, 0.003)),
)
OTHERS: Final = (
    Rolling("husky", KNOWN["husky"].path, 0.5, 0.5, (0.08, 0.065), (0.03, 0.045), KNOWN["husky"].keys),
    Rolling("racecar", KNOWN["racecar"].path, 0.5, 0.5, (0.02, 0.01), (0.02, 0.008), KNOWN["racecar"].keys),
)

every_robot = pytest.mark.parametrize(
    "robot",
    [
        *(pytest.param(robot, id=robot.name) for robot in OURS),
        *(pytest.param(robot, id=robot.name, marks=pytest.mark.pybullet) for robot in OTHERS),
    ],
)


def run(folder: Path, engine: str, robot: Rolling, twist: Twist) -> SimulationRun:
    scenario = {
        "name": "it",
        "robot": {"model": robot.model, **robot.keys},
        "backend": engine,
        "commands": {"twist": [twist]},
        "sensors": [{"odometry": {}, "rate": RATE, "trace": True}],
        "expect": ["upright"],
        "time_limit": TIME,
        "trace": {"rate": RATE},
    }
    return simulated(folder, scenario, outside=True)


def drift(found: SimulationRun) -> tuple[float, float]:
    """The furthest that the pose is off in m, and the heading in rad."""
    (record,), trace = found.trace.sensors.values(), found.trace
    rows = trace.rows(slice(0, len(record)))
    assert rows.time == pytest.approx(record.time)
    apart = record.columns["position_xyz"] - rows.base_position_xyz
    yaws = _yaws(record.columns["orientation_xyzw"]) - _yaws(rows.base_orientation_xyzw)
    return float(np.hypot(apart[:, 0], apart[:, 1]).max()), float(np.abs(yaws).max())


def _yaws(orientations_xyzw: FloatArray) -> FloatArray:
    """Of what stays upright, without jumps."""
    yaws: FloatArray = np.unwrap(2 * np.arctan2(orientations_xyzw[:, 2], orientations_xyzw[:, 3]))
    return yaws


@on_every_engine
@every_robot
def test_it_knows_a_circle_as_well_as_its_wheels_roll(engine: str, robot: Rolling, tmp_path: Path) -> None:
    found = run(tmp_path, engine, robot, {"linear": robot.speed, "angular": robot.turn})
    off, yaw_off = drift(found)
    column = list(ENGINES).index(engine)
    assert off / (robot.speed * TIME) < robot.off[column]
    assert yaw_off / (robot.turn * TIME) < robot.yaw_off[column]


@on_every_engine
def test_wheels_that_spin_go_unnoticed(engine: str, tmp_path: Path) -> None:
    burger, drive = OURS[0], {"diff": {"left": [WHEELS[0]], "right": [WHEELS[1]], "acceleration": 100.0}}
    found = run(tmp_path, engine, replace(burger, keys={"drive": drive}), {"linear": 1.5})
    (record,) = found.trace.sensors.values()
    ahead = record.columns["position_xyz"][-1, 0] - found.trace.base_position_xyz[len(record) - 1, 0]
    assert ahead > 0.01


@pytest.mark.parametrize(
    ("sensor", "problem"),
    [
        ("{odometry: {}, link: base_footprint}", "sensors.0.link: 'odometry' is of the base link by its wheels; leave"),
        ("{odometry: {}, pose: {x: 1}}", "sensors.0.pose: 'odometry' is of the base link by its wheels; leave"),
        ("{odometry: {radius_error: -1}}", "sensors.0.odometry.radius_error: must be greater than -1"),
        ("{odometry: {resolution: 0}}", "sensors.0.odometry.resolution: must be greater than 0"),
    ],
)
def test_what_cannot_be_is_told_on_its_line(sensor: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, f"{LEAST}sensors: [{sensor}]\n")
    assert problem in found


def test_a_robot_without_wheels_has_no_odometry(tmp_path: Path) -> None:
    (tmp_path / "ball.urdf").write_text(BALL)
    text = LEAST.replace("turtlebot3_burger", "ball.urdf")
    commands = text[text.index("commands:") : text.index("expect:")]
    (found,) = told(tmp_path, text.replace(commands, "") + "sensors: [odometry]\n")
    assert found.startswith("7:11: sensors.0.odometry: it is not plain from 'it' which joints are wheels; name them")

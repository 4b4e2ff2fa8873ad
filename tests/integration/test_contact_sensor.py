"""Contact sensors on real engines: what carries a robot, and what it bumps into."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from sim_action.engines import installed
from sim_action.state.trace import Trace
from sim_action.state.trace_records import SensorRecord
from sim_action.world import GRAVITY
from tests.simulated import simulated
from tests.traces import burger

every_engine = pytest.mark.parametrize("engine", installed())
WHEELS = ("wheel_left_link", "wheel_right_link")
LINKS = ("base_footprint", *WHEELS, "caster_back_link", "base_scan")
SENSORS = "".join(f"  - {{contact: {{}}, name: {link}, link: {link}, rate: 240 Hz, trace: true}}\n" for link in LINKS)
# The burger's shell ends 38 mm ahead of its base link.
WALL, FRONT = 0.3, 0.038
SCENARIO = f"""\
name: burger
robot: {{model: turtlebot3_burger}}
world:
  objects: [{{name: wall, box: [0.1, 2, 0.5], pose: {{x: {WALL + 0.05}}}}}]
commands:
  twist: [{{linear: SPEED}}]
expect: [upright: {{}}]
time_limit: 3 s
trace: {{rate: 240 Hz}}
"""


def run(folder: Path, engine: str, speed: float) -> Trace:
    return simulated(folder, f"{SCENARIO.replace('SPEED', str(speed))}sensors:\n{SENSORS}backend: {engine}\n").trace


def forces(records: Mapping[str, SensorRecord]) -> dict[str, float]:
    """N, by link, in the mean of the last second."""
    return {link: float(record.columns["force"][record.time > 2.0].mean()) for link, record in records.items()}


@every_engine
def test_the_ground_carries_the_weight(engine: str, tmp_path: Path) -> None:
    found = forces(run(tmp_path, engine, 0.0).sensors)
    weight = burger().mass * GRAVITY
    assert sum(found.values()) == pytest.approx(weight, rel=0.01)
    # The mass is 3 cm behind the axle, the caster 8 cm.
    assert found["wheel_left_link"] == pytest.approx(found["wheel_right_link"], rel=0.05)
    assert 0.25 * weight < found["caster_back_link"] < 0.5 * weight
    assert found["base_footprint"] == found["base_scan"] == 0.0


@every_engine
def test_a_bumper_touches_the_wall_when_it_is_there(engine: str, tmp_path: Path) -> None:
    trace = run(tmp_path, engine, 0.2)
    record = trace.sensors["base_footprint"]
    touching = record.columns["touching"].astype(bool)
    ahead = trace.rows(slice(0, len(record))).base_position_xyz[:, 0]
    # From one reading to the next it drives 1 mm.
    first = int(np.flatnonzero(touching)[0])
    assert ahead[first] == pytest.approx(WALL - FRONT, abs=0.003)
    assert not record.columns["force"][~touching].any()
    # Wheels push as hard as they hold on to the ground, with a friction of 1: by what they carry. In MuJoCo, the shell
    # hits the wall again and again, so that it is so in the mean.
    pushed = forces(trace.sensors)
    assert pushed["base_footprint"] == pytest.approx(sum(pushed[wheel] for wheel in WHEELS), rel=0.1)

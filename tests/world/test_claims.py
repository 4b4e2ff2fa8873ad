"""Ceilings: what no run exceeds is refused as a limit; tests/scenario/test_checks.py has the other rules."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim_action.app import catalogue
from sim_action.assertions import ASSERTIONS
from tests.scenario.test_checks import WALL, errors, scenario
from tests.scenarios import load
from tests.simulation.test_unearned_passes import LIMITS_OF_RUNS
from tests.soak import examples

_LIMITS: Final[Mapping[str, tuple[str, float]]] = {
    "travel: {at_most: LIMIT m}": ("max_distance", 1),
    "stay_within: {x: [-1000000, START + LIMIT]}": ("max_distance", 1),
    "reach: {x: START + LIMIT, y: 0, tolerance: 1 mm}": ("max_distance", 1.01),
    "final_pose: {x: 0, y: 0, tolerance: LIMIT m}": ("max_distance", 11),
    "final_pose: {x: 0, relative: true, tolerance: LIMIT m}": ("max_distance", 2.01),
    "follow_path: {path: [{x: 0, y: 0}, {x: 1, y: 0}], max_error: LIMIT m}": ("max_distance", 11),
    "follow_path: {path: [{x: 0, y: 0}, {x: 1, y: 0}], max_error: 1 m, rms: LIMIT m}": ("max_distance", 11),
    "matches: {trace: golden.csv, position: LIMIT m}": ("max_distance", 2),
    "max_speed: {linear: LIMIT m/s}": ("max_speed", 1),
    "max_speed: {angular: LIMIT rad/s}": ("max_turn_rate", 1),
    "settled: {speed: LIMIT m/s}": ("max_speed", 1),
    "settled: {turn_rate: LIMIT rad/s}": ("max_turn_rate", 1),
    "stops_before: {body: wall, gap: [0.1, 0.5], speed: LIMIT m/s}": ("max_speed", 1),
    "path_length: {at_most: LIMIT m}": ("max_speed", 30),
    "stl: always (travel < LIMIT m)": ("max_distance", 1),
    "stl: always (speed < LIMIT m/s)": ("max_speed", 1),
    "stl: always (turn_rate < LIMIT rad/s)": ("max_turn_rate", 1),
    "upright: {max_tilt: LIMIT rad}": ("half a turn", 1),
    "final_pose: {yaw: 0, yaw_tolerance: LIMIT rad}": ("half a turn", 1),
    "reach: {x: 1, y: 0, yaw: 0, yaw_tolerance: LIMIT rad}": ("half a turn", 1),
    "reach: {x: 1, y: 0, orientation: {tolerance: LIMIT rad}}": ("half a turn", 1),
    "matches: {trace: golden.csv, yaw: LIMIT rad}": ("half a turn", 1),
    "odometry_error: {yaw: LIMIT rad}": ("half a turn", 1),
    "object: {name: crate, upright: {max_tilt: LIMIT rad}}": ("half a turn", 1),
    "stops_before: {body: wall, gap: [0.1, 0.5], turn_rate: LIMIT rad/s}": ("max_turn_rate", 1),
    "joint: {name: wheel_left_joint, reading: velocity, at_most: LIMIT}": ("max_turn_rate", 1),
    "joint_within: {velocity: {wheel_left_joint: [-LIMIT, LIMIT]}}": ("max_turn_rate", 1),
    "joint: {name: wheel_left_joint, reading: effort, at_most: LIMIT}": ("motor", 1),
    "joint_within: {effort: {wheel_left_joint: [-LIMIT, LIMIT]}}": ("motor", 1),
    "effort: {at_most: LIMIT N m}": ("motor", 1),
    "effort: {rms_at_most: LIMIT N m}": ("motor", 1),
    "sensor: {name: imu, reading: orientation_xyzw, which: norm, at_most: LIMIT}": ("unit", 1.001),
}
"""A limit -> the key of `physics` that bounds its quantity, and the multiple of it that no run exceeds."""

_CONSTANTS: Final = {"half a turn": math.pi, "motor": 10.0, "unit": 1.0}
_WORLD: Final = WALL.replace("]}", ", {name: crate, box: [0.2, 0.2, 0.2], mass: 1 kg, pose: {y: 3}}]}") + (
    "sensors: [odometry, {imu: {}, name: imu, rate: 20 Hz}]\n"
)

_UNLIMITED: Final[Mapping[str, str]] = {
    "contact.at_most": "nothing bounds a force; a limit on a body that was never touched is a warning",
    "contact.impulse": "as contact.at_most",
    "contact.window": "a way to measure, as its longest value is stated",
    "grasped.slip": "nothing bounds the speed of an object",
    "matches.duration": "a run of the same length always passes; positions are compared as well",
    "matches.joints": "a joint without stops turns as far as it likes in the time of a golden run",
    "matches.rate": "a way to write files",
    "object.settled": "nothing bounds the speed of an object",
    "odometry_error.drift": "wheels that spin in place make any share",
    "stops_before.gap": "it must also stop, and not touch",
    "feet_on_ground.at_most": "refused from the number of feet on, see tests/assertions/test_legs.py",
}
"""Upper limits and tolerances without a greatest value, or that are tested elsewhere, and why."""

_LOWER: Final = frozenset(
    {
        *("contact.at_least", "grasped.at_least", "clearance.at_least", "feet_on_ground.at_least"),
        *("support_margin.at_least", "joint.at_least", "joint.near", "sensor.at_least", "clearance.at_most"),
        *(f"{name}.at_least" for name in ("travel", "path_length")),
        *(f"{name}.for" for name in ("settled", "contact", "stops_before", "grasped")),
        *(f"{name}.{axis}" for name in ("reach", "final_pose") for axis in ("x", "y", "z", "yaw")),
        *("follow_path.path", "follow_path.end", "final_pose.orientation", "object.reach"),
    }
)
"""Goals and places: beyond what is possible, they fail."""


def test_each_limit_of_an_assertion_is_tested_or_has_a_reason() -> None:
    numeric = {
        f"{entry.name}.{key.name}"
        for entry in catalogue.entries(ASSERTIONS)
        for key in entry.fields
        if re.search(r"[(][a-zA-Z]|number|[{]", key.takes)
    }
    stated = {
        f"{name}.{key}"
        for expect in (*_LIMITS, *LIMITS_OF_RUNS)
        for name, keys in yaml.safe_load(expect).items()
        if isinstance(keys, dict)
        for key in keys
    }
    alike = {"stay_within.y", "stay_within.z", "joint.tolerance"}
    assert numeric == (numeric & stated) | alike | _LOWER | set(_UNLIMITED)


@pytest.mark.parametrize("expect", _LIMITS)
@settings(examples(4), suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(
    most=st.floats(20, 500).map(lambda value: round(value, 2)),
    start=st.floats(-10, 10).map(lambda value: round(value, 2)),
    beyond=st.floats(1.001, 1000),
)
def test_a_limit_beyond_what_any_run_reaches_is_refused(
    expect: str, most: float, start: float, beyond: float, tmp_path: Path
) -> None:
    head = "# sim-action golden trajectory 1: turtlebot3_burger\ntime_s,x_m,y_m,z_m,yaw_rad\n"
    (tmp_path / "golden.csv").write_text(f"{head}0.0,0.0,0.0,0.0,0.0\n0.1,0.1,0.0,0.0,0.0\n")
    key, multiple = _LIMITS[expect]
    physics = "" if key in _CONSTANTS else f"physics: {{{key}: {most}}}\n"
    reachable = _CONSTANTS.get(key, most) * multiple

    def text(limit: float) -> str:
        stated = expect.replace("START + LIMIT", f"{start + limit:.4f}").replace("LIMIT", f"{limit:.4f}")
        stated = stated.replace("-1000000", f"{start - 2 * limit:.4f}")
        placed = f"model: turtlebot3_burger\n  pose: {{x: {start}}}\n"
        return scenario(stated, _WORLD + physics).replace("model: turtlebot3_burger\n", placed)

    refused = errors(tmp_path, text(reachable * beyond))
    assert {rule for _, rule in refused} <= {"unreachable-limit", "unreachable-target"}
    assert len(refused) == 1
    assert load(tmp_path, text(0.4 * min(most, reachable)))

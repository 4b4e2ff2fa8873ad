"""What sensors tell, by hand-made readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sim_action.assertions.monitors import State
from sim_action.assertions.sensor import SensorReading
from sim_action.sensors import SENSORS
from sim_action.state.readings import READING_COLUMNS
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, SensorRecord
from sim_action.state.verdict import Judged, Verdict
from tests.traces import judged, monitor, trace

KINDS = {"scan": "lidar", "bumper": "contact", "imu": "imu", "eye": "camera"}


def sensing(kind: str, time: Sequence[float], **columns: Any) -> Trace:
    record = SensorRecord(kind, np.array(time), {name: np.array(column) for name, column in columns.items()})
    return replace(trace([float(n) for n in range(1, 6)]), sensors={"s": record})


SCANS = sensing("lidar", [0.0, 1.0, 2.0], ranges=[[3.0, 2.0], [0.5, math.inf], [1.0, 0.75]])


def least(**bounds: Any) -> SensorReading:
    return SensorReading(name="s", reading="ranges", which="min", **bounds)


def test_the_first_reading_beyond_its_bound_speaks_or_the_nearest_to_it_if_all_hold() -> None:
    message = "min of s's ranges was 0.5 m at 1.00 s, lowest; at least 0.25 m"
    assert judged(least(at_least=0.25), SCANS) == Verdict(True, 0.5, 0.25, 0.25, "m", 1.0, message)
    message = "min of s's ranges was 0.5 m at 1.00 s, less than 1 m"
    assert judged(least(at_least=1.0, at_most=9.0), SCANS) == Verdict(False, 0.5, 1.0, -0.5, "m", 1.0, message)
    assert judged(least(at_least=0.25, at_most=1.0), SCANS).message.endswith("was 2 m at 0.00 s, more than 1 m")


def test_once_is_enough_for_a_goal() -> None:
    spec = least(at_most=0.75, once=True)
    assert monitor(spec).state is State.PENDING
    assert judged(spec, SCANS) == Verdict(True, 0.5, 0.75, 0.25, "m", 1.0, "min of s's ranges was 0.5 m at 1.00 s")
    failed = judged(least(at_most=0.25, once=True), SCANS)
    told = "min of s's ranges was 0.5 m at 1.00 s, the closest value; never within bounds: at most 0.25 m"
    assert (failed.passed, failed.message) == (False, told)


@pytest.mark.parametrize(
    ("kind", "column", "values", "which", "measured"),
    [
        ("lidar", "ranges", [[1.0, math.inf, 3.0]], "mean", 2.0),
        ("lidar", "ranges", [[1.0, 3.0]], "max", 3.0),
        ("contact", "force", [4.0], None, 4.0),
        ("imu", "linear_acceleration_xyz", [[3.0, 4.0, 12.0]], "norm", 13.0),
        ("imu", "linear_acceleration_xyz", [[3.0, 4.0, 12.0]], "z", 12.0),
        ("imu", "orientation_xyzw", [[0.0, 0.0, 0.6, 0.8]], "w", 0.8),
        ("camera", "depth", np.array([[[1.0, 2.0], [math.inf, 6.0]]], dtype=np.float32), "mean", 3.0),
        ("camera", "rgb", np.array([[[[0, 255, 9]]]], dtype=np.uint8), "max", 255.0),
    ],
)  # fmt: skip
def test_a_number_is_picked_from_each_reading(kind: str, column: str, values: Any, which: Any, measured: float) -> None:
    spec = SensorReading(name="s", reading=column, which=which, at_most=1000)
    verdict = judged(spec, sensing(kind, [1.0], **{column: values}))
    assert verdict.measured == measured
    assert verdict.unit == READING_COLUMNS[kind][column].dimension.si


def test_what_is_out_of_range_is_far_away_and_what_is_too_near_is_near() -> None:
    empty = sensing("lidar", [1.0], ranges=[[math.inf, math.inf]])
    verdict = judged(least(at_least=0.25), empty)
    assert (verdict.passed, verdict.measured, verdict.margin) == (True, None, None)
    assert not judged(least(at_most=5), empty).passed
    assert not judged(least(at_least=0.25), sensing("lidar", [1.0], ranges=[[-math.inf, 1.0]])).passed
    assert not judged(least(at_most=5).model_copy(update={"which": "mean"}), empty).passed


def test_what_was_not_read_is_not_exercised_so_it_asks_for_its_sensor() -> None:
    assert least(at_least=1).channels == Channels(sensors=frozenset({"s"}))
    for once in (False, True):
        verdict = monitor(least(at_least=0.25, once=once)).observe(trace([1.0])).verdict()
        assert verdict.judged == Judged()
        assert verdict.message == "s gave no reading in this time; raise its 'rate', or check for longer"


@pytest.mark.parametrize(
    ("keys", "place", "problem"),
    [
        ({"name": "scann"}, ("name",), "the scenario has no sensor 'scann'; did you mean 'scan'?"),
        ({"reading": "range"}, ("reading",), "a reading of 'scan' has no column 'range'; did you mean 'ranges'?"),
        ({"which": None}, ("reading",), "the reading has several numbers; select one with 'which': min, max, mean"),
        ({"which": "x"}, ("which",), "the reading has no 'x'"),
        ({"name": "bumper", "reading": "force"}, ("which",), "the reading is a single number; remove 'which'"),
        ({"at_least": "3 N"}, ("at_least",), "'N' is not a unit of length; use one of: m, mm, cm, km"),
        (
            {"name": "imu", "reading": "angular_velocity_xyz", "which": None},
            ("reading",),
            "the reading has several numbers; select one with 'which': x, y, z, norm, min, max, mean",
        ),
    ],
)
def test_what_does_not_fit_the_sensors_is_told(keys: dict[str, Any], place: tuple[str, ...], problem: str) -> None:
    data = {"name": "scan", "reading": "ranges", "which": "min", "at_least": "3 m"} | keys
    data = {**data, "at_least": 3} if "name" in keys else data
    ((path, message),) = SensorReading.model_validate(data).sensor_problems(KINDS)
    assert path == place
    assert message.startswith(problem)


def test_what_fits_is_no_problem() -> None:
    spec = SensorReading(name="imu", reading="angular_velocity_xyz", which="z", at_most="90 deg/s")
    assert list(spec.sensor_problems(KINDS)) == []
    assert spec.title == "sensor z of imu's angular_velocity_xyz at most 90 deg/s"


def test_every_kind_of_sensor_has_its_columns() -> None:
    assert set(READING_COLUMNS) == set(SENSORS)

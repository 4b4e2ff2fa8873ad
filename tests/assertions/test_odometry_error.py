"""Odometry against the truth, by hand-made readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.windows import Window
from sim_action.assertions.odometry_error import OdometryError, _around
from sim_action.core import units
from sim_action.core.errors import InvalidPart
from sim_action.core.geometry import quaternion_from_rpy
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, SensorRecord
from sim_action.state.verdict import Judged, Verdict
from tests.traces import judged, monitor, trace


def told(time: Sequence[float], x: Sequence[float], yaw: Sequence[float] | None = None) -> SensorRecord:
    turned = [quaternion_from_rpy(0.0, 0.0, angle) for angle in yaw or [0.0] * len(time)]
    columns = {"position_xyz": np.array([(at, 0.0, 9.0) for at in x]), "orientation_xyzw": np.array(turned)}
    return SensorRecord("odometry", np.array(time), columns)


def driven(record: SensorRecord, **columns: Any) -> Trace:
    """1 m/s along x, a moment each half second."""
    time = [0.5 * n for n in range(1, 9)]
    return replace(trace(time, x=time, **columns), sensors={"odometry": record})


# It is told 0, 1.125, 2.5, 3.25 where it is 0, 1, 2, 3.
AHEAD = driven(told([0.0, 1.0, 2.0, 3.0], [0.0, 1.125, 2.5, 3.25]))


def test_the_greatest_error_in_position_speaks_or_the_first_that_is_too_great_and_heights_do_not_count() -> None:
    message = "odometry was 0.5 m off at 2.00 s, the largest error; limit 0.75 m"
    assert judged(OdometryError(position=0.75), AHEAD) == Verdict(True, 0.5, 0.75, 0.25, "m", 2.0, message)
    message = "odometry was 0.125 m off at 1.00 s, more than 0.0625 m"
    verdict = judged(OdometryError(position=0.0625), AHEAD)
    assert verdict == Verdict(False, 0.125, 0.0625, -0.0625, "m", 1.0, message)
    assert judged(OdometryError(position=0.1), driven(told([1.0], [1.0]))).margin == 0.1


def test_drift_is_a_share_of_the_way_of_which_the_first_metre_counts_whole() -> None:
    verdict = judged(OdometryError(drift=0.5), driven(told([0.5, 4.0], [0.75, 5.0])))
    message = "odometry was off by 25 % of the distance travelled at 0.50 s, the largest error; limit 50 %"
    assert verdict == Verdict(True, 0.25, 0.5, 0.25, "", 0.5, message)
    failed = judged(OdometryError(drift=0.125), AHEAD)
    assert failed.message == "odometry was off by 25 % of the distance travelled at 2.00 s, more than 12.5 %"


def test_headings_are_compared_round_the_circle() -> None:
    yaw = [math.pi - 0.01 if n % 2 else -math.pi + 0.01 for n in range(8)]
    record = told([0.5, 1.0], [0.5, 1.0], [math.pi - 0.01, -math.pi + 0.11])
    seen = driven(record, yaw=[-yaw[0] - 0.02, -math.pi + 0.01, *yaw[2:]])
    verdict = judged(OdometryError(yaw=0.5), seen)
    assert verdict.measured == pytest.approx(0.1)
    assert verdict.time == 1.0
    assert verdict.message == "odometry was 5.73 deg off its heading at 1.00 s, the largest error; limit 28.65 deg"


def test_of_several_what_failed_speaks_else_what_is_nearest_to_its_limit() -> None:
    assert judged(OdometryError(position=0.2, yaw=0.1, drift=0.9), AHEAD).limit == 0.2
    assert judged(OdometryError(position=10.0, yaw=0.1, drift=0.3), AHEAD).limit == 0.3


def test_the_way_before_its_window_counts_as_way() -> None:
    verdict = Window(monitor(OdometryError(drift=0.5)), 2.5).observe(AHEAD).verdict()
    assert verdict.measured == pytest.approx(0.25 / 3)
    assert verdict.time == 3.0


def test_a_reading_of_a_step_is_compared_with_this_step_alone_however_its_time_is_rounded() -> None:
    time = np.array([0.1, 0.2, 0.3, 0.4])
    # 0.1 + 0.2 is a bit more than 0.3, and the others a bit less.
    before, after, share = _around(np.array([0.1 + 0.2, 0.3 - 5e-10, 0.4 - 5e-10, 0.35]), time)
    assert (before.tolist(), after.tolist()) == ([2, 2, 3, 2], [2, 2, 3, 3])
    assert share.tolist() == [0.0, 0.0, 0.0, pytest.approx(0.5)]


def test_a_stored_trace_has_fewer_moments_than_readings() -> None:
    stored = AHEAD.rows(np.array([0, 7]))
    assert judged(OdometryError(position=0.75), stored).measured == pytest.approx(0.5)


def test_what_was_not_read_is_not_exercised() -> None:
    opened = monitor(OdometryError(position=0.1)).observe(trace([1.0]))
    assert opened.state is State.HOLDS
    assert opened.verdict().judged == Judged()
    assert opened.verdict().message == ("odometry gave no reading in this time; raise its 'rate', or check for longer")


def test_the_reading_at_the_start_is_no_evidence() -> None:
    """Its error is 0 by definition."""
    first = monitor(OdometryError(position=0.1)).observe(driven(told([0.0], [0.0]))).verdict()
    assert (first.status, first.judged) == ("not_exercised", Judged())
    assert first.message.startswith("odometry gave no reading after t = 0 in this time; raise its 'rate'")
    assert monitor(OdometryError(position=0.75)).observe(AHEAD).verdict().judged == Judged(3, 1.0, 3.0)


MISSPELT = "the scenario has no sensor 'odometry'; did you mean 'odometri'? (allowed: odometri)"


def test_it_asks_for_its_sensor() -> None:
    assert OdometryError(yaw=0.1, name="wheels").channels == Channels(sensors=frozenset({"wheels"}))


@pytest.mark.parametrize(
    ("kinds", "problem"),
    [
        ({"odometry": "odometry"}, None),
        ({"scan": "lidar"}, "the scenario has no odometry; add it to sensors, such as sensors: [odometry]"),
        ({"odometry": "imu", "wheels": "odometry"}, "'odometry' is not odometry but 'imu' (allowed: wheels)"),
        ({"odometri": "odometry"}, MISSPELT),
    ],
)
def test_a_sensor_that_is_not_there_is_told(kinds: dict[str, str], problem: str | None) -> None:
    found = [message for _, message in OdometryError(position=0.1).sensor_problems(kinds)]
    assert found == ([] if problem is None else [problem])


def test_it_asks_for_something_and_is_titled_by_that() -> None:
    with pytest.raises(InvalidPart, match="give 'position', 'yaw', 'drift' or several of them"):
        OdometryError()
    spec = OdometryError.model_validate({"position": "5 cm", "yaw": "3 deg", "drift": "2 %"})
    assert spec.title == "odometry_error position at most 0.05 m, yaw at most 3 deg, drift at most 2 %"
    assert spec.drift == 0.02
    assert units.parse(0.02, units.SHARE) == 0.02

"""The readings that a replay keeps: at most so many per second, and fewer in long runs."""

from __future__ import annotations

import pytest

from sim_action.core.geometry import Pose
from sim_action.sensors import MountedSensor, Sensor
from sim_action.sensors.camera import Camera
from sim_action.sensors.lidar import Lidar
from sim_action.sensors.reading_log import ReadingLog
from sim_action.state.readings import Values


def log_of(sensor: Sensor, rate: float, count: int) -> ReadingLog:
    log = ReadingLog.of(MountedSensor(sensor, "eye", None, Pose(), rate, trace=False))
    for number in range(count):
        log.add(Values(number / rate, {}))
    return log


@pytest.mark.parametrize(
    ("sensor", "rate", "every"),
    [(Lidar(), 10, 1), (Lidar(), 30, 1), (Lidar(), 40, 2), (Lidar(), 100, 4), (Camera(), 2, 1), (Camera(), 10, 5)],
)
def test_so_many_readings_per_second_are_kept(sensor: Sensor, rate: float, every: int) -> None:
    log = log_of(sensor, rate, 21)
    assert log.every == every
    assert [reading.time for reading in log.readings] == [number / rate for number in range(0, 21, every)]


def test_long_logs_keep_every_second_reading_and_the_first() -> None:
    # A scan has 800 kB.
    log = log_of(Lidar(rays=100_000), 10, 200)
    assert log.every == 8
    assert [reading.time for reading in log.readings] == [number / 10 for number in range(0, 200, 8)]

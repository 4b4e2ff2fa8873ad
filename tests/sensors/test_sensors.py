"""What sensors get to see, and only if they look."""

from __future__ import annotations

import pytest

from sim_action.core.geometry import Pose
from sim_action.sensors import Mount, MountedSensor, ReadingLog, Sensor, Sight
from sim_action.sensors.camera import Camera
from sim_action.sensors.imu import Imu
from sim_action.sensors.lidar import Lidar
from sim_action.state.observation import Observation
from sim_action.state.readings import Values
from tests.sensors.stubs import NO_PROBE
from tests.traces import START, scene


def test_a_robot_is_looked_at_once_by_however_many() -> None:
    looks: list[Observation] = []

    def look() -> Observation:
        looks.append(START)
        return START

    sight = Sight(1.0, NO_PROBE, look)
    assert looks == []
    assert sight.robot is sight.robot is START
    assert looks == [START]


@pytest.mark.parametrize("sensor", [Lidar(rays=4), Camera(width=4, height=3), Imu()])
def test_what_needs_but_the_engine_costs_no_look_at_the_robot(sensor: Sensor) -> None:
    there = scene()
    mount = Mount(there, there.model.root, Pose(), 10.0, there.generator("test"))
    assert sensor.open(mount)(Sight(1.5, NO_PROBE, lambda: pytest.fail("it was looked at"))).time == 1.5


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

"""Readings made by hand, as a run keeps them for its replay."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from sim_action.core.geometry import Pose
from sim_action.sensors import MountedSensor, ReadingLog, Sensor
from sim_action.sensors.contact import ContactSensor
from sim_action.sensors.lidar import Lidar
from sim_action.state.readings import ContactReading, LidarScan, Reading


def log(
    sensor: Sensor, name: str, readings: Sequence[Reading], rate: float = 10.0, pose: Pose | None = None
) -> ReadingLog:
    made = ReadingLog.of(MountedSensor(sensor, name, None, pose or Pose(), rate, trace=False))
    for reading in readings:
        made.add(reading)
    return made


def scan(time: float, ranges: Sequence[float], spread: float = 2 * math.pi) -> LidarScan:
    """A scan with its first ray straight ahead."""
    return LidarScan(time, 0.0, spread / len(ranges), 0.1, 5.0, np.array(ranges))


def lidar(name: str, count: int, ranges: Callable[[float], Sequence[float]], rate: float = 10.0) -> ReadingLog:
    """A lidar on the base; `ranges` are those at a time in s."""
    scans = [scan(number / rate, ranges(number / rate)) for number in range(count)]
    return log(Lidar(rays=len(scans[0].ranges)), name, scans, rate)


def bumper(name: str, touches: Mapping[float, str]) -> ReadingLog:
    """A contact sensor that is read 10 times in a second, and touches these bodies at these times."""
    times = [number / 10 for number in range(11)]
    readings = [
        ContactReading(time, time in touches, 0.0, (touches[time],) if time in touches else ()) for time in times
    ]
    return log(ContactSensor(), name, readings)

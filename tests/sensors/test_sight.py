"""What sensors get to see, and only if they look."""

from __future__ import annotations

import pytest

from sim_action.core.geometry import Pose
from sim_action.sensors import Mount, Sensor, Sight
from sim_action.sensors.camera import Camera
from sim_action.sensors.imu import Imu
from sim_action.sensors.lidar import Lidar
from sim_action.state.observation import Observation
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

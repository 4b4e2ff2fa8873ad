"""The columns that readings are said to have are those that they have."""

from __future__ import annotations

import numpy as np
import pytest

from sim_action.core.geometry import Pose, Twist
from sim_action.state.reading_columns import READING_COLUMNS
from sim_action.state.readings import CameraImage, ContactReading, ImuReading, LidarScan, OdometryReading, Reading

READINGS: dict[str, Reading] = {
    "camera": CameraImage(0.0, np.zeros((2, 3, 3), dtype=np.uint8), np.zeros((2, 3), dtype=np.float32)),
    "contact": ContactReading(0.0, touching=True, force=1.0, bodies=("wall",)),
    "imu": ImuReading(0.0, (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 9.8)),
    "lidar": LidarScan(0.0, 0.0, 0.1, 0.0, 3.5, np.ones(5)),
    "odometry": OdometryReading(0.0, Pose(), Twist()),
}


@pytest.mark.parametrize("kind", list(READING_COLUMNS))
def test_a_kind_has_the_columns_of_its_readings(kind: str) -> None:
    told = {name: np.asarray(column) for name, column in READINGS[kind].columns().items()}
    assert set(told) == set(READING_COLUMNS[kind])
    for name, column in READING_COLUMNS[kind].items():
        assert column.many or told[name].shape == ((len(column.axes),) if column.axes else ())
        assert column.is_single == (told[name].shape == ())

"""What controllers ask readings for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist
from sim_action.state import readings
from sim_action.state.readings import PlanarWay

READINGS: dict[str, readings.Reading] = {
    "camera": readings.CameraImage(0.0, np.zeros((2, 3, 3), dtype=np.uint8), np.zeros((2, 3), dtype=np.float32)),
    "contact": readings.ContactReading(0.0, touching=True, force=1.0, bodies=("wall",)),
    "imu": readings.ImuReading(0.0, (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 9.8)),
    "lidar": readings.LidarScan(0.0, 0.0, 0.1, 0.0, 3.5, np.ones(5)),
    "odometry": readings.OdometryReading(0.0, Pose(), Twist()),
}


@pytest.mark.parametrize("kind", list(readings.READING_COLUMNS))
def test_a_kind_has_the_columns_of_its_readings(kind: str) -> None:
    told = {name: np.asarray(column) for name, column in READINGS[kind].columns().items()}
    assert set(told) == set(readings.READING_COLUMNS[kind])
    for name, column in readings.READING_COLUMNS[kind].items():
        assert column.many or told[name].shape == ((len(column.axes),) if column.axes else ())
        assert column.is_single == (told[name].shape == ())


SCAN = readings.LidarScan(0.0, -math.pi, math.pi / 2, 0.1, 10.0, np.array([4.0, 3.0, 2.0, 5.0]))
"""Behind, to the right, ahead, to the left."""


@pytest.mark.parametrize(
    ("start", "end", "nearest"),
    [
        (0, 0, 2.0),
        (-90, 90, 2.0),
        (-90, -90, 3.0),
        (45, 180, 4.0),
        (90, 270, 3.0),
        (170, -170, 4.0),
        (-190, -170, 4.0),
        (530, 550, 4.0),
        (90, -90, 3.0),
        (10, 80, 2.0),
        (50, 80, 5.0),
        (-60, -60, 3.0),
        (-45, -45, 2.0),
        (225, 225, 3.0),
        (-46, -46, 3.0),
        (-180, 180, 2.0),
        (1, 361, 2.0),
        (0, 1000, 2.0),
    ],
)
def test_the_nearest_is_sought_counter_clockwise(start: float, end: float, nearest: float) -> None:
    assert SCAN.nearest(math.radians(start), math.radians(end)) == nearest


def test_where_no_ray_looks_nothing_is_seen_but_beside_a_ray_and_what_is_too_near_is_the_nearest() -> None:
    forward = readings.LidarScan(0.0, -math.pi / 4, math.pi / 4, 0.1, 10.0, np.array([4.0, 3.0, 2.0]))
    for start, end in ((46, 60), (60, 80)):
        assert forward.nearest(math.radians(start), math.radians(end)) == 2.0
    for start, end in ((91, 269), (100, 100), (46, -46)):
        assert forward.nearest(math.radians(start), math.radians(end)) == math.inf
    scan = readings.LidarScan(0.0, 0.0, 0.1, 0.1, 10.0, np.array([np.inf, -np.inf, 3.0]))
    assert scan.nearest(0.0, 1.0) == -math.inf
    assert scan.nearest(0.0, 0.0) == math.inf


ways = st.builds(PlanarWay, st.floats(-2, 2), st.floats(-2, 2), st.floats(-7, 7))


@pytest.mark.parametrize(
    ("way", "x", "y", "yaw"),
    [
        (PlanarWay(1.5, -0.5, 0.0), 1.5, -0.5, 0.0),
        (PlanarWay(math.pi / 2, 0.0, math.pi / 2), 1.0, 1.0, math.pi / 2),
        (PlanarWay(math.pi / 2, 0.0, -math.pi / 2), 1.0, -1.0, -math.pi / 2),
        (PlanarWay(0.0, math.pi, math.pi), -2.0, 0.0, math.pi),
        (PlanarWay(-2.0, 0.0, 2 * math.pi), 0.0, 0.0, 0.0),
        (PlanarWay(0.0, 0.0, 0.3), 0.0, 0.0, 0.3),
    ],
)
def test_an_arc_leads_where_it_should(way: PlanarWay, x: float, y: float, yaw: float) -> None:
    pose = way.pose()
    assert pose.position_xyz == pytest.approx((x, y, 0.0), abs=1e-12)
    assert math.remainder(pose.yaw - yaw, 2 * math.pi) == pytest.approx(0.0, abs=1e-12)
    assert way.twist(0.5) == Twist((2 * way.x, 2 * way.y, 0.0), (0.0, 0.0, 2 * way.turn))


@given(ways, st.integers(2, 50))
def test_pieces_of_an_arc_add_up_to_it(way: PlanarWay, pieces: int) -> None:
    piece = PlanarWay(way.x / pieces, way.y / pieces, way.turn / pieces).pose()
    reached = Pose()
    for _ in range(pieces):
        reached = geometry.compose(reached, piece)
    assert reached.position_xyz == pytest.approx(way.pose().position_xyz, abs=1e-9)


@given(ways, st.floats(-1, 1), st.floats(-1, 1))
def test_points_of_the_same_base_go_together(way: PlanarWay, x: float, y: float) -> None:
    offset = Pose((x, y, 0.0))
    moved = geometry.compose(geometry.inverse(offset), geometry.compose(way.pose(), offset))
    found = way.of_point(x, y).pose()
    assert found.position_xyz == pytest.approx(moved.position_xyz, abs=1e-9)
    assert found.orientation_xyzw == pytest.approx(moved.orientation_xyzw)

"""Messages as plain data: exact stamps, covariances, images, and the projection of a camera."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist
from sim_action.ros import messages
from sim_action.sensors.camera import Camera
from sim_action.sensors.rendering.solids import Pinhole
from sim_action.state.readings import ImuReading


@pytest.mark.parametrize("rate", [100, 120, 240, 1000, 30])
def test_stamps_of_a_million_ticks_are_exact(rate: int) -> None:
    step = max(1, 1_000_000 // 5000)
    for tick in (*range(2000), *range(0, 1_000_001, step), *range(999_000, 1_000_001)):
        stamp = messages.stamp(tick / rate)
        nanoseconds = stamp["sec"] * 10**9 + stamp["nanosec"]
        # Half a nanosecond at most, whatever the tick: nothing adds up.
        assert abs(nanoseconds * rate - tick * 10**9) * 2 <= rate
        assert 0 <= stamp["nanosec"] < 10**9


@given(st.integers(0, 10**6), st.sampled_from([100, 120, 240, 1000]))
def test_times_come_back_from_their_stamps(tick: int, rate: int) -> None:
    assert messages.seconds_of(messages.stamp(tick / rate)) == pytest.approx(tick / rate, abs=5.1e-10)


def test_the_covariances_of_an_imu_are_those_of_its_noise() -> None:
    reading = ImuReading(1.0, geometry.IDENTITY, (0.1, 0.2, 0.3), (0.0, 0.0, 9.81))
    imu = messages.imu_message(1.0, "imu_link", reading, (0.1, 0.5))
    assert imu["angular_velocity_covariance"].tolist() == pytest.approx([0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01])
    assert imu["linear_acceleration_covariance"].tolist() == [0.25, 0, 0, 0, 0.25, 0, 0, 0, 0.25]
    assert not any(imu["orientation_covariance"])
    assert imu["linear_acceleration"] == {"x": 0.0, "y": 0.0, "z": 9.81}


def test_images_have_the_bytes_of_their_rows() -> None:
    rgb = np.arange(18, dtype=np.uint8).reshape(2, 3, 3)
    depth = np.array([[0.5, 1.0, np.inf], [2.0, 3.0, 4.0]], dtype=np.float32)
    image = messages.image_message(0.5, "eye", rgb)
    assert (image["height"], image["width"], image["encoding"], image["step"]) == (2, 3, "rgb8", 9)
    assert image["data"].tobytes() == rgb.tobytes()
    deep = messages.image_message(0.5, "eye", depth, "32FC1")
    assert (deep["encoding"], deep["step"], deep["is_bigendian"]) == ("32FC1", 12, 0)
    assert np.frombuffer(deep["data"].tobytes(), "<f4").reshape(2, 3).tolist() == depth.tolist()


@given(
    width=st.integers(1, 640),
    height=st.integers(1, 480),
    field=st.floats(0.1, 2.9),
    share=st.tuples(st.floats(0, 1), st.floats(0, 1)),
)
def test_camera_info_projects_as_the_camera_does(
    width: int, height: int, field: float, share: tuple[float, float]
) -> None:
    camera, pinhole = Camera(width=width, height=height, field_of_view=field), Pinhole(width, height, field, 0.05, 10.0)
    info = messages.camera_info_message(0.0, "eye", camera)
    row, column = (min(int(part * count), count - 1) for part, count in zip(share, (height, width), strict=True))
    # The point at a depth of 2 m that the camera sees in this pixel, in the optical frame.
    seen = Pose((2.0, 2.0 * float(pinhole.left[0, column]), 2.0 * float(pinhole.up[row, 0])))
    point = geometry.compose(geometry.inverse(messages.OPTICAL), seen).position_xyz
    assert point[2] == pytest.approx(2.0)
    for matrix in (np.reshape(info["k"], (3, 3)), np.reshape(info["p"], (3, 4))[:, :3]):
        u, v, scale = matrix @ point
        assert (u / scale, v / scale) == pytest.approx((column, row), abs=1e-6 * max(width, height))


def test_the_optical_frame_looks_ahead_with_x_to_the_right_and_y_down() -> None:
    axes = [geometry.rotate(messages.OPTICAL.orientation_xyzw, axis) for axis in geometry.AXES]
    assert axes == [(0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)]


numbers = st.floats(allow_nan=False, allow_infinity=False)


@given(st.tuples(*[numbers] * 3), st.tuples(*[numbers] * 3), st.booleans())
def test_twists_come_with_and_without_a_stamp(linear: Any, angular: Any, stamped: bool) -> None:
    plain = {"linear": messages.vector(linear), "angular": messages.vector(angular)}
    message = {"header": messages.header(3.0, "base"), "twist": plain} if stamped else plain
    assert messages.twist_of(message) == Twist(linear, angular)


@given(st.floats(0, 1e5), st.tuples(*[st.floats(-1e3, 1e3)] * 3))
def test_transforms_have_their_frames(time: float, position: Any) -> None:
    (found,) = messages.transforms_message(time, [("odom", "base", Pose(position))])["transforms"]
    assert (found["header"]["frame_id"], found["child_frame_id"]) == ("odom", "base")
    assert tuple(found["transform"]["translation"].values()) == position
    assert math.hypot(*found["transform"]["rotation"].values()) == 1.0

"""IMUs: what they tell of motions that are known exactly."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from sim_action.core.geometry import Pose, Twist, quaternion_from_rpy, rotate
from sim_action.sensors import Measure, Mount
from sim_action.sensors.imu import Imu
from sim_action.state.readings import ImuReading
from sim_action.world import GRAVITY
from tests.sensors.stubs import OneLink, sight_of
from tests.traces import START, scene

RATE = 100.0


def opened(imu: Imu, pose: Pose | None = None, *, seed: int = 0, purpose: str = "imu") -> Measure:
    there = replace(scene(), seed=seed)
    return imu.open(Mount(there, "base_footprint", pose or Pose(), RATE, there.generator(purpose)))


def read(measure: Measure, time: float, probe: OneLink) -> ImuReading:
    reading = measure(sight_of(replace(START, time=time), probe))
    assert isinstance(reading, ImuReading)
    return reading


def at_rest(imu: Imu, *, readings: int = 1000, **drawn: int | str) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) turning rates and (N, 3) accelerations."""
    measure = opened(imu, **drawn)  # type: ignore[arg-type] # the keywords of `opened`
    several = [read(measure, step / RATE, OneLink()) for step in range(readings)]
    turning = np.array([reading.angular_velocity_xyz for reading in several])
    return turning, np.array([reading.linear_acceleration_xyz for reading in several])


@pytest.mark.parametrize(
    ("roll", "pitch", "felt"),
    [
        (0.0, 0.0, (0, 0, 1)),
        (0.3, 0.0, (0, math.sin(0.3), math.cos(0.3))),
        (0.0, 0.3, (-math.sin(0.3), 0, math.cos(0.3))),
        (math.pi, 0.0, (0, 0, -1)),
    ],
)
def test_at_rest_it_feels_gravity_upwards(roll: float, pitch: float, felt: tuple[float, ...]) -> None:
    tilted = quaternion_from_rpy(roll, pitch, 0.0)
    for link, own in ((Pose((1, 2, 3), tilted), Pose()), (Pose(), Pose((0.1, 0.2, 0.3), tilted))):
        measure = opened(Imu(), own)
        for step in range(3):
            reading = read(measure, step / RATE, OneLink(link))
            assert reading.time == step / RATE
            assert reading.orientation_xyzw == pytest.approx(tilted)
            assert reading.angular_velocity_xyz == (0, 0, 0)
            assert reading.linear_acceleration_xyz == pytest.approx([GRAVITY * part for part in felt], abs=1e-12)


def test_an_acceleration_is_the_mean_since_the_reading_before() -> None:
    measure = opened(Imu(), Pose(orientation_xyzw=quaternion_from_rpy(0, 0, math.pi / 2)))
    speeds = (0.5, 0.53, 0.52, 0.52)
    told = [read(measure, step / RATE, OneLink(twist=Twist((speed, 0, 0)))) for step, speed in enumerate(speeds)]
    # The sensor looks to the left: what pushes forward pushes it to its right.
    sideways = [reading.linear_acceleration_xyz[1] for reading in told]
    assert sideways == pytest.approx([0, -3, 1, 0], abs=1e-9)
    assert told[1].linear_acceleration_xyz == pytest.approx((0, -3, GRAVITY))


@pytest.mark.parametrize("turn", [-3.0, 0.5, 8.0])
def test_off_the_middle_of_a_spin_it_feels_what_holds_it(turn: float) -> None:
    measure = opened(Imu(), Pose((0.2, 0.1, 0.05)))
    turned = [Pose(orientation_xyzw=quaternion_from_rpy(0, 0, turn * step / RATE)) for step in range(50)]
    probes = [OneLink(pose, Twist.planar(angular=turn)) for pose in turned]
    told = [read(measure, step / RATE, probe) for step, probe in enumerate(probes)]
    # The mean over an arc is a little shorter than what it is everywhere on it.
    half = turn / RATE / 2
    inwards = -(turn**2) * math.sin(half) / half
    for reading in told[1:]:
        assert reading.angular_velocity_xyz == pytest.approx((0, 0, turn))
        assert reading.linear_acceleration_xyz == pytest.approx((0.2 * inwards, 0.1 * inwards, GRAVITY))


def test_it_turns_in_its_own_frame() -> None:
    lying = quaternion_from_rpy(math.pi / 2, 0, 0)
    reading = read(opened(Imu(), Pose(orientation_xyzw=lying)), 0.0, OneLink(twist=Twist((0, 0, 0), (0.1, 0.2, 0.3))))
    assert rotate(lying, reading.angular_velocity_xyz) == pytest.approx((0.1, 0.2, 0.3))
    assert reading.angular_velocity_xyz == pytest.approx((0.1, 0.3, -0.2))


def test_noise_is_as_wide_as_it_says_and_independent() -> None:
    turning, felt = at_rest(Imu(gyro_noise=0.02, accelerometer_noise=0.5), readings=4000)
    together = np.column_stack((turning / 0.02, (felt - (0, 0, GRAVITY)) / 0.5))
    # Of 4000 normal numbers: the mean within 1/16, the spread within 1/20, correlations within 1/16 (four sigma each).
    assert np.abs(together.mean(axis=0)).max() < 1 / 16
    assert together.std(axis=0) == pytest.approx(1, abs=1 / 20)
    assert np.abs(np.corrcoef(together.T) - np.eye(6)).max() < 1 / 16


def test_a_bias_stays_for_a_run_and_is_drawn_for_each() -> None:
    offsets = []
    for seed in range(100):
        turning, felt = at_rest(Imu(gyro_bias=0.01, accelerometer_bias=0.2), readings=2, seed=seed)
        assert (turning[0] == turning[1]).all()
        assert felt[0] == pytest.approx(felt[1])
        offsets.append(np.concatenate((turning[0] / 0.01, (felt[0] - (0, 0, GRAVITY)) / 0.2)))
    assert np.std(offsets) == pytest.approx(1, abs=0.12)
    assert abs(np.mean(offsets)) < 4 / math.sqrt(600)


def test_the_seed_and_the_name_decide_the_noise() -> None:
    noisy = Imu(gyro_noise=0.1)
    first, again = at_rest(noisy, readings=3)[0], at_rest(noisy, readings=3)[0]
    assert (first == again).all()
    assert (first != at_rest(noisy, readings=3, seed=1)[0]).all()
    assert (first != at_rest(noisy, readings=3, purpose="other")[0]).all()


def test_what_is_kept_is_numbers() -> None:
    columns = read(opened(Imu()), 0.0, OneLink()).columns()
    names = ("orientation_xyzw", "angular_velocity_xyz", "linear_acceleration_xyz")
    assert [(name, len(values)) for name, values in columns.items()] == list(zip(names, (4, 3, 3), strict=True))


@pytest.mark.parametrize("key", ["gyro_noise", "gyro_bias", "accelerometer_noise", "accelerometer_bias"])
@pytest.mark.parametrize(("width", "is_allowed"), [(-0.001, False), (0.0, True), (0.5, True)])
def test_noise_may_be_small_but_not_negative(key: str, width: float, is_allowed: bool) -> None:
    if is_allowed:
        assert getattr(Imu.model_validate({key: width}), key) == width
    else:
        with pytest.raises(ValidationError):
            Imu.model_validate({key: width})

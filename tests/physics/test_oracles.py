"""The references of the zoo: integrated motions against formulas, and the recorded numbers against the integration."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.physics.arms import DOUBLE_ANGLE, DOUBLE_START, DOUBLE_TIME, weak_fall
from tests.physics.bodies import FRESH_SPUN, SPUN, SpunPlate
from tests.physics.oracles import GRAVITY, corners, double_pendulum, pendulum_period, runge_kutta, sliding_plate
from tests.soak import soaked


def test_the_method_is_of_fourth_order() -> None:
    errors = [abs(runge_kutta(lambda _, y: -y, (1.0,), 2.0, steps)[-1, 0] - math.exp(-2)) for steps in (20, 40)]
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.1)


def test_a_plate_that_is_not_turned_slides_as_a_point() -> None:
    torque = (0.0, 0.01)
    figures = {"mass": 2.0, "moment": 0.1, "friction": 0.5, "height": 0.02, "steps_per_s": 500}
    end = sliding_plate(corners(0.3, 0.2), velocity=(1.0, 0.0), torque=torque, **figures)
    assert end.tolist() == pytest.approx([1 / GRAVITY, 0.0, 0.0], abs=1e-4)


def test_a_plate_that_only_turns_stops_by_its_moment_of_friction() -> None:
    # mu m g r brakes I w, r being the distance of all corners.
    reach, moment, spin, brief = math.hypot(0.3, 0.2), 0.1, 5.0, 0.01
    braking = 0.5 * 2.0 * GRAVITY * reach
    torque = moment * spin / brief
    end = sliding_plate(
        corners(0.3, 0.2),
        mass=2.0,
        moment=moment,
        friction=0.5,
        height=0.0,
        velocity=(0.0, 0.0),
        torque=(torque, brief),
        steps_per_s=2000,
    )
    first = (torque - braking) / moment
    assert end[2] == pytest.approx(first * brief**2 / 2 * (1 + first * moment / braking), rel=0.01)
    assert np.abs(end[:2]).max() < 1e-9


@pytest.mark.parametrize("plate", soaked((*SPUN, FRESH_SPUN), SPUN[2:]), ids=lambda plate: f"{plate.spin:g} rad/s")
def test_recorded_references_are_those_of_the_integration(plate: SpunPlate) -> None:
    x, y, angle = sliding_plate(
        corners(plate.HALF_LENGTH, plate.HALF_WIDTH),
        mass=plate.MASS,
        moment=plate.MOMENT,
        friction=plate.friction,
        height=plate.HEIGHT,
        velocity=(plate.speed, 0.0),
        torque=(plate.MOMENT * plate.spin / plate.BRIEF, plate.BRIEF),
        steps_per_s=2000,
    )
    assert math.hypot(x, y) == pytest.approx(plate.way, rel=5e-4)
    assert angle == pytest.approx(plate.angle, rel=5e-3)


def test_a_small_pendulum_has_the_period_of_the_textbook() -> None:
    assert pendulum_period(1.0, 1e-4) == pytest.approx(2 * math.pi * math.sqrt(1 / GRAVITY))
    # 1 + 1/16 a^2 + 11/3072 a^4 + ...
    assert pendulum_period(1.0, math.pi / 2) / pendulum_period(1.0, 1e-4) == pytest.approx(1.1803, rel=1e-4)


def test_the_double_pendulum_of_the_zoo_is_that_of_the_integration() -> None:
    one, _ = double_pendulum((DOUBLE_START, DOUBLE_START), DOUBLE_TIME, 1000)
    assert one == pytest.approx(DOUBLE_ANGLE, abs=1e-6)


def test_an_arm_without_a_brake_falls_freely_at_first() -> None:
    assert weak_fall(10.0, 0.0, 0.02) == pytest.approx(10.0 * 0.02**2 / 2, rel=1e-4)
    assert weak_fall(10.0, 10.0, 0.5) == pytest.approx(0.0, abs=1e-9)

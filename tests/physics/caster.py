"""Robots with two driven wheels and a caster that slides; the built-in burger.

The wheels carry 70 % of the weight, at friction 1. A caster of friction 1 drags with 30 % of the weight, which is less
than the grip of the wheels: by Coulomb's law they roll, and the robot is as fast as their rims. In a spin the caster is
dragged sideways; if its friction is 1, that takes 83 % of the grip of each wheel.
"""

from __future__ import annotations

import math
from typing import Final

from tests.physics.case import Case, Setup
from tests.physics.measures import apart, path_length, steady_speed, steady_turn, travelled, turned
from tests.physics.robots import caster_robot, delivery_robot

GROUP: Final = "caster"
_MASSES: Final = (1, 6, 40)
_FRICTIONS: Final = (0.0, 0.1, 0.5, 1.0)
_THIN: Final = 0.002  # a wheel turns about a point of its width; tyres as thin as these leave no doubt which


def driven(model: str, twist: dict[str, float], seconds: float, **robot: object) -> Setup:
    return Setup(model, seconds, {"commands": {"rate": 10, "twist": [twist]}}, robot)


def _name(mass: float, friction: float, what: str) -> str:
    return f"caster {mass:g} kg friction {friction:g} {what}"


def line(mass: float, friction: float) -> Case:
    name = _name(mass, friction, "line")
    setup = driven(caster_robot(mass, friction), {"linear": 0.5}, 4.0)
    measure = steady_speed(2.0, 4.0)
    return Case(name, GROUP, (setup,), measure, "m/s", "analytic", 0.5, 0.005)


def turn(mass: float, friction: float, linear: float, angular: float) -> Case:
    name = _name(mass, friction, "circle" if linear else "spin")
    model = caster_robot(mass, friction, wheels_width=_THIN)
    setup = driven(model, {"linear": linear, "angular": angular}, 4.0)
    measure = steady_turn(2.0, 4.0)
    truth = angular
    return Case(name, GROUP, (setup,), measure, "rad/s", "analytic", truth, 0.01 * truth)


def rim_distance(speed: float, seconds: float) -> float:
    """How far a rim rolls that ramps from rest to `speed` at 1 m/s^2."""
    return speed * seconds - math.copysign(speed**2 / 2, speed)


_BURGER: Final = "turtlebot3_burger"
_SEPARATION: Final = 0.160


def _burger_cases() -> tuple[Case, ...]:
    left, right = (rim_distance(0.2 + side * 0.5 * _SEPARATION / 2, 10.0) for side in (-1, 1))
    line, way = rim_distance(0.2, 10.0), (left + right) / 2
    spin, yaw = 2 * rim_distance(_SEPARATION / 2, 10.0) / _SEPARATION, (right - left) / _SEPARATION
    straight = driven(_BURGER, {"linear": 0.2}, 10.0)
    circle = driven(_BURGER, {"linear": 0.2, "angular": 0.5}, 10.0)
    turning = driven(_BURGER, {"angular": 1.0}, 10.0)
    fast = driven(_BURGER, {"linear": 1.0}, 5.0)
    rows = (
        ("burger line", straight, travelled, "m", line),
        ("burger circle way", circle, path_length, "m", way),
        ("burger circle yaw", circle, turned, "rad", yaw),
        ("burger spin yaw", turning, turned, "rad", spin),
        ("burger fast line", fast, travelled, "m", rim_distance(1.0, 5.0)),
    )
    return tuple(
        Case(name, GROUP, (setup,), measure, unit, "analytic", truth, 0.003 * truth, family="burger")
        for name, setup, measure, unit, truth in rows
    )


def _delivery_cases() -> tuple[Case, ...]:
    setup = driven(delivery_robot(), {"linear": 0.5}, 6.0)
    truth = rim_distance(0.5, 6.0)
    family = "delivery robot"
    return (
        Case("delivery robot line", GROUP, (setup,), travelled, "m", "analytic", truth, 0.01 * truth, family),
        Case("delivery robot engines", GROUP, (setup,), apart, "m", "spread", 0.0, 0.03, family, between=True),
    )


CASES: Final = (
    *(line(mass, friction) for mass in _MASSES for friction in _FRICTIONS),
    *(turn(mass, friction, 0.3, 0.5) for mass in _MASSES for friction in _FRICTIONS),
    *(turn(mass, friction, 0.0, 1.0) for mass in _MASSES for friction in (0.0, 0.5, 1.0)),
    *_burger_cases(),
    *_delivery_cases(),
)

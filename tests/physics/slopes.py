"""Bodies on slopes and in the air: what holds, slides, rolls, tips over or flies, by formulas of mechanics."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Final

import numpy as np

from sim_action.core.geometry import Vector3
from tests.physics.bodies import push, world
from tests.physics.case import RATE, Case, Setup
from tests.physics.measures import (
    GRAVITY,
    acceleration_between,
    angular_momentum,
    final_tilt,
    highest_rise,
    steady_speed,
    travelled,
)
from tests.physics.robots import ball, box, box_inertia

GROUP: Final = "slopes and flight"
_SIZE: Final = (0.2, 0.2, 0.1)
_HELD: Final = ((0.5, 20), (0.5, 24), (1.0, 40), (0.2, 9))
_SLIDING: Final = ((0.5, 35), (0.2, 15), (1.0, 50), (0.0, 5))


def slopes(held: Iterable[tuple[float, float]], sliding: Iterable[tuple[float, float]]) -> list[Case]:
    """Boxes of a friction on ground at an angle in deg; gravity is turned instead of the ground.

    What accelerates a sliding box is a small difference of two forces, weight along the slope and friction: the
    tolerance is 2 % of the former.
    """
    cases = []
    for friction, degrees in held:
        name = f"box holds on {degrees} deg at friction {friction:g}"
        setup = _on_slope(friction, degrees)
        cases.append(Case(name, GROUP, (setup,), travelled, "m", "bound", 0.0, 0.002))
    measure = acceleration_between(0.25, 1.0)
    for friction, degrees in sliding:
        name = f"box slides down {degrees} deg at friction {friction:g}"
        angle, setup = math.radians(degrees), _on_slope(friction, degrees)
        drive = GRAVITY * math.sin(angle)
        truth = drive - friction * GRAVITY * math.cos(angle)
        cases.append(Case(name, GROUP, (setup,), measure, "m/s^2", "analytic", truth, 0.02 * drive))
    return cases


def _on_slope(friction: float, degrees: float, model: str = "", seconds: float = 1.0) -> Setup:
    """Starts at rest. Nothing settles: the body finds its hold on the slope within the first moments."""
    angle = math.radians(degrees)
    gravity = [GRAVITY * math.sin(angle), 0.0, -GRAVITY * math.cos(angle)]
    return Setup(model or box(_SIZE, friction=friction), seconds, {"world": {"gravity": gravity}}, settle=0.0)


def _ramp(degrees: float, friction: float = 1.0) -> dict[str, object]:
    """A ramp that starts at x = 0."""
    ramp = {"length": 4, "width": 2, "angle": math.radians(degrees)}
    return {"name": "ramp", "ramp": ramp, "friction": friction, "pose": {"x": 2.0}}


def _on_ramp(model: str, height: float, degrees: float) -> Setup:
    """A body at x = 2 on a ramp, its centre `height` above the surface."""
    angle = math.radians(degrees)
    x, z = 2.0 - height * math.sin(angle), 2.0 * math.tan(angle) + height * math.cos(angle)
    return Setup(model, 1.0, world(objects=[_ramp(degrees)]), {"pose": {"x": x, "z": z, "pitch": -angle}}, settle=0.0)


def _ramps() -> list[Case]:
    """The same on a ramp, which is a body of the world, as on the tilted ground."""
    cases = []
    for what, shape in (("solid", 0.4), ("hollow", 2 / 3)):
        name = f"{what} ball rolls down a ramp of 10 deg"
        truth = GRAVITY * math.sin(math.radians(10)) / (1 + shape)
        measure = acceleration_between(0.2, 1.0, in_space=True)
        setup = _on_ramp(ball(0.1, 1.0, 1.0, shape), 0.1, 10)
        cases.append(Case(name, GROUP, (setup,), measure, "m/s^2", "analytic", truth, 0.02 * truth))
    held = _on_ramp(box(_SIZE, friction=0.5), 0.05, 20)
    cases.append(Case("box holds on a ramp of 20 deg", GROUP, (held,), travelled, "m", "bound", 0.0, 0.002))
    sliding = _on_ramp(box(_SIZE, friction=0.2), 0.05, 25)
    drive = GRAVITY * math.sin(math.radians(25))
    truth = drive - 0.2 * GRAVITY * math.cos(math.radians(25))
    name, measure = "box slides down a ramp of 25 deg", acceleration_between(0.2, 1.0, in_space=True)
    cases.append(Case(name, GROUP, (sliding,), measure, "m/s^2", "analytic", truth, 0.02 * drive))
    return cases


def _towers() -> list[Case]:
    """A tall box tips over where its centre of mass is beyond its edge: width / height = 0.25, which is 14 deg."""
    cases = []
    tower = box((0.1, 0.1, 0.4), 2.0, 1.0)
    for degrees, truth, tolerance in ((10, 0.0, 0.5), (12, 0.0, 0.5), (16, 90.0, 5.0), (20, 90.0, 5.0)):
        name = f"tower on {degrees} deg {'falls' if truth else 'stands'}"
        setup = _on_slope(1.0, degrees, tower, 3.0)
        cases.append(Case(name, GROUP, (setup,), final_tilt, "deg", "analytic", truth, tolerance, limit=45.0))
    return cases


def _flights() -> list[Case]:
    """A thrown ball, and bodies that turn freely, whose angular momentum a method of first order keeps within 2 %."""
    up, along = 5.0, 3.0
    thrown = Setup(ball(0.05, 0.5), 1.0, world(push((along, 0.0, up))))
    apex = up**2 / (2 * GRAVITY)
    size, mass = (0.3, 0.2, 0.1), 2.0
    half_a_step = up / (2 * RATE)
    cases = [
        Case("thrown ball: apex", GROUP, (thrown,), highest_rise, "m", "analytic", apex, half_a_step + 0.001, "thrown"),
        Case("thrown ball: speed", GROUP, (thrown,), steady_speed(0.2, 1.0), "m/s", "analytic", along, 0.003, "thrown"),
    ]
    inertia, brief = box_inertia(mass, size), 0.025
    spins: tuple[tuple[str, Vector3], ...] = (
        ("about its long axis", (3.0, 0.0, 0.0)),
        ("about its middle axis", (0.05, 4.0, 0.05)),
        ("about all axes", (2.0, 2.0, 2.0)),
    )
    for what, spin in spins:
        torque = [moment * rate / brief for moment, rate in zip(inertia, spin, strict=True)]
        momentum = float(np.linalg.norm([value * brief for value in torque]))
        keys = world({"at": 0.1, "for": brief, "torque": torque}, gravity=0)
        setup = Setup(box(size, mass), 5.0, keys, {"pose": {"z": 3.0}}, settle=0.0)
        name = f"free body turns {what}: angular momentum"
        figures: dict[str, Any] = {"unit": "N m s", "kind": "analytic", "truth": momentum, "tolerance": 0.02 * momentum}
        cases.append(Case(name, GROUP, (setup,), angular_momentum(inertia), **figures))
    return cases


CASES: Final = (*slopes(_HELD, _SLIDING), *_ramps(), *_towers(), *_flights())

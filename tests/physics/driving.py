"""Cars, mecanum wheels, ramps, pushed loads, and wheels that spin: manoeuvres whose outcome a formula gives.

A car turns at the rate that is asked; the radius of its curve is speed over turn rate, at the middle of its rear axle.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, Final

from tests.physics.case import Case, Setup
from tests.physics.caster import driven, rim_distance
from tests.physics.measures import (
    GRAVITY,
    acceleration_between,
    body_speed,
    highest_tilt,
    path_length,
    radius,
    steady_speed,
    steady_turn,
    travelled,
)
from tests.physics.robots import ROVER_SIDES, WHEEL_LOAD, box, car, caster_robot, rover
from tools.bench.robots import ROBOTS

GROUP: Final = "driving"
_RACECAR: Final = next(known for known in ROBOTS if known.name == "racecar")
_BURGER: Final = "turtlebot3_burger"


def _cars() -> list[Case]:
    cases = []
    for what, model, bundled in (
        ("car", car(0.4, 0.3), False),
        ("long car", car(0.8, 0.4, 20.0), False),
        ("racecar", _RACECAR.path, True),
    ):
        for speed, turn in ((0.5, 0.5), (0.5, -0.25), (1.0, 0.4)):
            setup = driven(model, {"linear": speed, "angular": turn}, 6.0)
            name = f"{what} at {speed:g} m/s and {turn:g} rad/s"
            figures: dict[str, Any] = {"group": GROUP, "setups": (setup,), "family": name, "bundled": bundled}
            figures |= {"kind": "analytic", "quick": what == "car" or (bundled and turn < 0)}
            rate: dict[str, Any] = {"unit": "rad/s", "truth": turn, "tolerance": 0.02 * abs(turn), "limit": 0.96 * turn}
            cases.append(Case(f"{name}: turn rate", measure=steady_turn(3.0, 6.0), **rate, **figures))
            if not bundled:
                way = speed / abs(turn)
                curve: dict[str, Any] = {"unit": "m", "truth": way, "tolerance": 0.02 * way}
                cases.append(Case(f"{name}: radius", measure=radius(3.0, 6.0), **curve, **figures))
    return cases


def _sideways() -> list[Case]:
    drive = {"drive": {"mecanum": {side: list(joints) for side, joints in ROVER_SIDES.items()}}}
    setup = driven(rover(0.4, 0.35), {"lateral": 0.3}, 5.0, **drive)
    both = driven(rover(0.4, 0.35), {"linear": 0.3, "lateral": 0.3, "angular": 0.3}, 5.0, **drive)
    arc = driven(rover(0.4, 0.35), {"linear": 0.3, "lateral": 0.3}, 5.0, **drive)
    diagonal, speed, turn = math.hypot(0.3, 0.3), steady_speed(2.0, 5.0), steady_turn(2.0, 5.0)
    return [
        Case("mecanum sideways", GROUP, (setup,), speed, "m/s", "analytic", 0.3, 0.003),
        Case("mecanum turning", GROUP, (both,), turn, "rad/s", "analytic", 0.3, 0.006, "mecanum curve"),
        Case("mecanum arc", GROUP, (arc,), speed, "m/s", "analytic", diagonal, 0.01 * diagonal),
    ]


def ramps(angles_deg: Iterable[float]) -> list[Case]:
    """The burger drives up a slope at the speed of its rims, and stays there."""
    cases = []
    for degrees in angles_deg:
        ramp = {"name": "ramp", "ramp": {"length": 2, "width": 1, "angle": math.radians(degrees)}, "friction": 1}
        objects = {"world": {"objects": [{**ramp, "pose": {"x": 1.2}}]}}
        up: Mapping[str, object] = {"commands": {"rate": 10, "twist": [{"linear": 0.2, "for": 6.0}]}, **objects}
        climb = Setup(_BURGER, 10.0, up)
        name = f"burger on a ramp of {degrees} deg"
        speed, creep = steady_speed(3.5, 5.5, axes=3), steady_speed(8.0, 10.0, axes=3)
        cases += [
            Case(f"{name}: speed", GROUP, (climb,), speed, "m/s", "analytic", 0.2, 0.004, name),
            Case(f"{name}: creep at rest", GROUP, (climb,), creep, "m/s", "bound", 0.0, 0.0005, name),
        ]
    return cases


Load = tuple[str, str, float, float, float]
"""Name, model of the robot, and mass in kg, friction and side in m of the box that it pushes."""
LOADS: Final[tuple[Load, ...]] = (
    ("burger pushes 0.5 kg", _BURGER, 0.5, 0.3, 0.15),
    ("caster robot pushes 3 kg", caster_robot(6.0, 0.0), 3.0, 0.4, 0.25),
)


def pushed(loads: Iterable[Load]) -> list[Case]:
    """A load ahead of a robot whose wheels can push it: the speed stays."""
    cases = []
    for what, model, mass, friction, size in loads:
        load = {"name": "load", "box": [size] * 3, "mass": mass, "friction": friction, "pose": {"x": 0.5}}
        setup = Setup(model, 8.0, {"commands": {"rate": 10, "twist": [{"linear": 0.2}]}, "world": {"objects": [load]}})
        figures: dict[str, Any] = {"group": GROUP, "setups": (setup,), "unit": "m/s", "family": what}
        figures |= {"kind": "analytic", "truth": 0.2, "tolerance": 0.002}
        cases.append(Case(f"{what}: its speed", measure=steady_speed(5.0, 8.0), **figures))
        cases.append(Case(f"{what}: the load's speed", measure=body_speed("load", 5.0, 8.0), **figures))
    return cases


def spinning_wheels(frictions: Iterable[float]) -> list[Case]:
    """On slippery ground, wheels that are too fast pull with full friction: a = mu N / m.

    The load on the wheels is their share of the weight less the load that the acceleration moves to the caster behind:
    N = m (0.7 g - a h / l), where h is the height of the centre of mass and l the distance of the caster. The torque
    that speeds up the wheels moves 1 % more, which the tolerance covers.
    """
    cases = []
    for friction in frictions:
        height, behind = 0.86 * 0.10 + 0.12 * 0.075 + 0.02 * 0.025, 0.25
        truth = friction * WHEEL_LOAD * GRAVITY / (1 + friction * height / behind)
        keys = {"commands": {"rate": 10, "twist": [{"linear": 6.0}]}, "world": {"ground": {"friction": friction}}}
        drive = {"diff": {"left": ["left_wheel_joint"], "right": ["right_wheel_joint"], "acceleration": 2.0}}
        setup = Setup(caster_robot(6.0, 0.0), 2.0, keys, {"drive": drive})
        name = f"wheels spin on ground of friction {friction:g}"
        measure = acceleration_between(0.5, 1.5)
        cases.append(Case(name, GROUP, (setup,), measure, "m/s^2", "analytic", truth, 0.03 * truth))
    return cases


def _stops() -> list[Case]:
    """Braking from a speed takes the way that the ramp of the wheels gives, and does not tip the robot."""
    keys = {"commands": {"rate": 10, "twist": [{"linear": 0.8, "for": 2.0}]}}
    drive = {"diff": {"left": ["left_wheel_joint"], "right": ["right_wheel_joint"], "acceleration": 2.0}}
    setup = Setup(caster_robot(6.0, 0.1), 4.0, keys, {"drive": drive})
    truth = 0.8 * 2.0
    loops = [{"linear": 0.2, "angular": 1.0, "for": 6.3}, {"linear": 0.2, "angular": -1.0}]
    eight = Setup(_BURGER, 14.0, {"commands": {"rate": 10, "twist": loops}})
    way = rim_distance(0.2, 14.0)
    return [
        Case("caster robot stops: way", GROUP, (setup,), travelled, "m", "analytic", truth, 0.01 * truth, "stop"),
        Case("caster robot stops: tilt", GROUP, (setup,), highest_tilt, "deg", "bound", 0.0, 1.0, "stop"),
        Case("burger drives an eight: way", GROUP, (eight,), path_length, "m", "analytic", way, 0.01 * way),
    ]


def _conveyed() -> list[Case]:
    """A body on a path pushes a box, which is as fast as the path."""
    pusher = {"name": "pusher", "box": [0.1, 0.4, 0.2], "pose": {"x": -0.3, "z": 0.12}}
    pusher["path"] = [{"at": 0, "x": -0.3}, {"at": 6, "x": 0.9}]
    setup = Setup(box((0.2, 0.2, 0.1), 1.0, 0.5), 6.0, {"world": {"objects": [pusher]}})
    return [Case("box pushed by a path", GROUP, (setup,), steady_speed(3.0, 6.0), "m/s", "analytic", 0.2, 0.002)]


CASES: Final = (
    *_cars(),
    *_sideways(),
    *ramps((5, 10)),
    *pushed(LOADS),
    *spinning_wheels((0.05, 0.1, 0.2)),
    *_stops(),
    *_conveyed(),
)

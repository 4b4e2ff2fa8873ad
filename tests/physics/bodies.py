"""Loose bodies that slide, are shoved, roll, fall, rest on each other, and hit walls.

Friction of the ground is 1, so that the friction of a contact is that of the body. A body slides v^2 / (2 mu g) far.
The engines integrate by the semi-implicit Euler method, whose distances are off by up to half a step at full speed,
v / (2 rate); the tolerance of distances contains that, and 2 % more.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

from sim_action.core.geometry import Vector3
from tests.physics.case import RATE, Case, Run, Setup
from tests.physics.measures import (
    GRAVITY,
    Measure,
    body_rise,
    body_travel,
    energy_gain,
    final_height,
    final_speed,
    first_time_below,
    highest_rise,
    impulse,
    rebound,
    travelled,
    turned,
)
from tests.physics.robots import ball, ball_inertia, box, box_inertia, table

GROUP: Final = "bodies"
_SIZE: Final = (0.2, 0.2, 0.1)
_INERTIA: Final = box_inertia(1.0, _SIZE)
_PUSH_AT: Final = 0.1
_SHOVES: Final = (1.0, 2.0, 4.0)
_FRICTIONS: Final = (0.2, 0.5, 1.0)


def world(*pushes: Mapping[str, object], **keys: object) -> dict[str, object]:
    return {"world": {"disturbances": list(pushes), **keys}}


def push(velocity: Vector3, at: float = _PUSH_AT, **target: str) -> dict[str, object]:
    return {"at": at, "velocity": list(velocity), **target}


def slide(speed: float, friction: float, gravity: float = GRAVITY) -> float:
    return speed**2 / (2 * friction * gravity)


def _tolerance(way: float, speed: float, rate: float = RATE) -> float:
    return 0.02 * way + speed / (2 * rate)


def shoved(speed: float, friction: float) -> list[Case]:
    way = slide(speed, friction)
    # It slides until mu g t = v.
    seconds = math.ceil(2 * (speed / (friction * GRAVITY) + 0.4)) / 2
    setup = Setup(box(_SIZE, friction=friction), seconds, world(push((speed, 0.0, 0.0))))
    name = f"box shoved at {speed:g} m/s on friction {friction:g}"
    gain = energy_gain(1.0, _INERTIA, _PUSH_AT + 1 / RATE)
    tolerance = _tolerance(way, speed)
    return [
        Case(f"{name}: distance", GROUP, (setup,), travelled, "m", "analytic", way, tolerance, name),
        Case(f"{name}: rise", GROUP, (setup,), highest_rise, "m", "bound", 0.0, 0.005, name),
        Case(f"{name}: energy", GROUP, (setup,), gain, "of v^2/2", "bound", 0.0, 0.01, name),
    ]


def _shapes_shoved() -> list[Case]:
    """Tall, heavy, small and diagonal shoves; and a body of the world, which is not the robot."""
    tall, heavy, small, flat = (0.2, 0.2, 0.3), (0.4, 0.4, 0.4), (0.04, 0.04, 0.03), (0.6, 0.4, 0.02)
    diagonal = (3 / math.sqrt(2), 3 / math.sqrt(2), 0.0)
    at = [5.0, 0.0, 0.05]
    crate = {"name": "crate", "box": list(_SIZE), "mass": 1.0, "friction": 0.5, "pose": {"x": at[0], "y": at[1]}}
    other = Setup(box(_SIZE), 2.0, world(push((2.0, 0.0, 0.0), body="crate"), objects=[crate]))
    rows: tuple[tuple[str, Setup, float, float, Measure, Measure], ...] = (
        ("tall box", _shove_of(tall, 1.0, 0.3, (2.0, 0.0, 0.0)), 2.0, 0.3, travelled, highest_rise),
        ("crate of 50 kg", _shove_of(heavy, 50.0, 0.5, (2.0, 0.0, 0.0)), 2.0, 0.5, travelled, highest_rise),
        ("block of 50 g", _shove_of(small, 0.05, 0.5, (1.0, 0.0, 0.0)), 1.0, 0.5, travelled, highest_rise),
        ("flat plate", _shove_of(flat, 3.0, 0.5, (3.0, 0.0, 0.0)), 3.0, 0.5, travelled, highest_rise),
        ("box along its diagonal", _shove_of(_SIZE, 1.0, 0.5, diagonal), 3.0, 0.5, travelled, highest_rise),
        ("crate of the world", other, 2.0, 0.5, body_travel("crate"), body_rise("crate")),
    )
    cases = []
    for what, setup, speed, friction, measured, risen in rows:
        way, name = slide(speed, friction), f"{what} shoved"
        tolerance = _tolerance(way, speed)
        cases.append(Case(f"{name}: distance", GROUP, (setup,), measured, "m", "analytic", way, tolerance, name))
        cases.append(Case(f"{name}: rise", GROUP, (setup,), risen, "m", "bound", 0.0, 0.005, name))
    return cases


def _shove_of(size: Vector3, mass: float, friction: float, velocity: Vector3) -> Setup:
    return Setup(box(size, mass, friction), 3.0, world(push(velocity)))


def _rolling() -> list[Case]:
    """A ball that is pushed slides, then rolls without a loss: v0 / (1 + I / (m r^2))."""
    cases = []
    for what, shape, speed, friction in (
        ("solid ball", 0.4, 2.0, 0.5),
        ("solid ball fast", 0.4, 5.0, 1.0),
        ("hollow ball", 2 / 3, 2.0, 0.5),
        ("slippery ball", 0.4, 1.0, 0.1),
    ):
        truth = speed / (1 + shape)
        setup = Setup(ball(0.1, 1.0, friction, shape), 2.0, world(push((speed, 0.0, 0.0))))
        name = f"{what} slides then rolls"
        gain = energy_gain(1.0, ball_inertia(1.0, 0.1, shape), _PUSH_AT + 1 / RATE)
        cases += [
            Case(f"{name}: speed", GROUP, (setup,), final_speed, "m/s", "analytic", truth, 0.01 * truth, name),
            Case(f"{name}: energy", GROUP, (setup,), gain, "of v^2/2", "bound", 0.0, 0.01, name),
        ]
    return cases


def _falls() -> list[Case]:
    cases = []
    for what, model, half in (
        ("ball", ball(0.1), 0.1),
        ("box", box(_SIZE), 0.05),
        ("box of 50 kg", box((0.4, 0.4, 0.4), 50.0), 0.2),
    ):
        for drop in (0.05, 1.0):
            setup = Setup(model, 3.0, robot={"pose": {"z": drop + half}}, settle=0.0)
            name = f"{what} dropped from {100 * drop:g} cm"
            time, bounce = math.sqrt(2 * drop / GRAVITY), 0.005 if drop < 0.1 else 0.01
            # Semi-implicit Euler falls g t dt / 2 further, which is half a step in time.
            late, below = 0.5 / RATE + 1e-4, first_time_below(half)
            cases += [
                Case(f"{name}: time", GROUP, (setup,), below, "s", "analytic", time, late, name),
                Case(f"{name}: height at rest", GROUP, (setup,), final_height, "m", "analytic", half, 0.001, name),
                Case(f"{name}: bounce", GROUP, (setup,), rebound, "m", "bound", 0.0, bounce, name),
            ]
    return cases


def stack(what: str, masses: tuple[float, ...], top: float) -> list[Case]:
    """Boxes of the world on each other, with these masses in kg, and the robot on top."""
    side = 0.2
    objects = [
        {"name": f"box{number}", "box": [side] * 3, "mass": mass, "friction": 0.7, "pose": {"z": (number + 0.5) * side}}
        for number, mass in enumerate(masses)
    ]
    model = box((side, side, side), top, 0.7)
    height = (len(masses) + 0.5) * side
    setup = Setup(model, 5.0, {"world": {"objects": objects}}, {"pose": {"z": height}})
    tolerance = 0.002 * (len(masses) + 1)
    return [
        Case(f"{what}: height", GROUP, (setup,), final_height, "m", "analytic", height, tolerance, what),
        Case(f"{what}: drift", GROUP, (setup,), travelled, "m", "bound", 0.0, 0.005, what),
    ]


@dataclass(frozen=True)
class SpunPlate:
    """A plate on four small feet that is pushed and turned at once; and where it stops, integrated in small steps.

    A push gives the plate its velocity in m/s, a torque of `BRIEF` s its turn in rad/s. It has feet so that no engine
    has to choose where a face presses.
    """

    friction: float
    speed: float
    spin: float
    way: float
    angle: float

    HALF_LENGTH: ClassVar[float] = 0.3
    HALF_WIDTH: ClassVar[float] = 0.2
    MASS: ClassVar[float] = 2.0
    MOMENT: ClassVar[float] = box_inertia(2.0, (0.6, 0.4, 0.02))[2]
    BRIEF: ClassVar[float] = 3 / RATE


SPUN: Final = (
    SpunPlate(friction=0.5, speed=2.0, spin=4.0, way=0.4428, angle=0.5549),
    SpunPlate(friction=0.3, speed=1.0, spin=8.0, way=0.3576, angle=1.5232),
    SpunPlate(friction=0.8, speed=3.0, spin=2.0, way=0.5790, angle=0.2462),
)
FRESH_SPUN: Final = SpunPlate(friction=0.6, speed=1.5, spin=5.0, way=0.2345, angle=0.4546)


def spun(plate: SpunPlate) -> list[Case]:
    name = f"plate on feet shoved at {plate.speed:g} m/s and {plate.spin:g} rad/s on friction {plate.friction:g}"
    torque = {"at": _PUSH_AT, "for": plate.BRIEF, "torque": [0, 0, plate.MOMENT * plate.spin / plate.BRIEF]}
    model = table(plate.HALF_LENGTH, plate.HALF_WIDTH, plate.MASS, plate.friction)
    setup = Setup(model, 3.0, world(push((plate.speed, 0.0, 0.0)), torque))
    way, angle = plate.way, plate.angle
    to_way, to_angle = _tolerance(way, plate.speed), 0.05 * angle + plate.spin / (2 * RATE)
    return [
        Case(f"{name}: distance", GROUP, (setup,), travelled, "m", "integrated", way, to_way, name),
        # Four feet share the load in an undetermined way: on another processor, rounding may change the turn.
        Case(f"{name}: turn", GROUP, (setup,), turned, "rad", "integrated", angle, to_angle, name, quick=False),
    ]


_BURGER_KG: Final = 1.002
_BURGER_WHEEL_INERTIA: Final = 1.55e-5
_BURGER_RADIUS: Final = 0.033


def _walls() -> list[Case]:
    """The impulse on a wall is the loss of momentum, at any rate of the steps."""
    wall = {"name": "wall", "box": [0.1, 2.0, 0.5], "pose": {"x": 0.35}}
    near = {**wall, "pose": {"x": 0.25}}
    slid = Setup(box(_SIZE, 2.0, 0.0), 1.5, world(push((0.5, 0.0, 0.0)), objects=[wall]))
    rolled = Setup("turtlebot3_burger", 2.0, world(push((0.3, 0.0, 0.0)), objects=[near]))
    mass = _BURGER_KG + 2 * _BURGER_WHEEL_INERTIA / _BURGER_RADIUS**2
    rows: tuple[tuple[str, str, Setup, Measure, str], ...] = (
        ("box hits wall", "box without friction hits a wall", slid, _impulse_less_rebound(0.0, 1.5), "N s"),
        ("burger rolls into wall", "burger rolls into a wall", rolled, _impulse_share(mass), "of the momentum"),
    )
    return [
        Case(f"{name} at {rate:g} Hz: impulse", GROUP, (setup.at(rate),), measure, unit, "analytic", 1.0, 0.05, family)
        for family, name, setup, measure, unit in rows
        for rate in (240.0, 480.0, 960.0)
    ]


def _impulse_less_rebound(start: float, end: float) -> Measure:
    """The impulse on bodies of the world, without what a rebound adds: over (1 + rebound speed / speed)."""

    def measure(run: Run) -> float:
        speeds = run.trace.base_linear_xyz[:, 0]
        return impulse(start, end)(run) / (1 + max(0.0, -float(speeds[-1])) / float(speeds.max()))

    return measure


def _impulse_share(mass: float) -> Measure:
    """The impulse within 50 ms of the first contact, over the momentum that is lost in that time.

    `mass`: in kg, with the inertia of wheels at their rims, which friction on the ground stops as well.
    """

    def measure(run: Run) -> float:
        touched = min((contact.time for contact in run.trace.contacts), default=0.0) - 1 / run.setup.rate
        speeds = run.trace.base_linear_xyz[:, 0]
        lost = float(speeds[run.row(touched)] - speeds[run.row(touched + 0.05)])
        return impulse(touched, touched + 0.05)(run) / (mass * lost) if lost else math.inf

    return measure


def _burgers() -> list[Case]:
    braked = {"commands": {"rate": 10, "twist": [{"linear": 0.0}]}}
    cases = []
    for what, velocity in (("backwards", (-0.4, 0.0, 0.0)), ("sideways", (0.0, 0.4, 0.0))):
        setup = Setup("turtlebot3_burger", 3.0, {**braked, **world(push(velocity))})
        name, family = f"braked burger pushed {what}", f"burger pushed {what}"
        cases += [
            Case(f"{name}: speed at the end", GROUP, (setup,), final_speed, "m/s", "bound", 0.0, 0.001, family),
            Case(f"{name}: rise", GROUP, (setup,), highest_rise, "m", "bound", 0.0, 0.005, family),
        ]
    return cases


CASES: Final = (
    *(case for speed in _SHOVES for friction in _FRICTIONS for case in shoved(speed, friction)),
    *_shapes_shoved(),
    *_rolling(),
    *_falls(),
    *stack("stack of 3 equal boxes", (1.0, 1.0), 1.0),
    *stack("stack with 10 kg on top", (1.0, 1.0), 10.0),
    *stack("stack of 5 boxes", (1.0, 1.0, 1.0, 1.0), 1.0),
    *(case for plate in SPUN for case in spun(plate)),
    *_walls(),
    *_burgers(),
)

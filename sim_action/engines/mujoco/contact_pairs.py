"""Contact pairs in MuJoCo: which geoms may touch, with which friction and stiffness.

MuJoCo's contacts are softer than Bullet's by design. The parameters here were measured with the burger (a line, a
circle and a spin at 60 to 1000 Hz): contacts that converge faster separate for single steps, and wheels lose grip.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from sim_action.robot.model.robot_model import Surface

FRICTION_RATIO: Final = 100.0  # ratio of friction to normal impedance, so high that robots do not creep down slopes
CONTACT_IMPEDANCE: Final = 0.9  # impedance of a contact: the share of a force that it resists

# Time constant of a contact in s and in steps.
_TIME_CONSTANT_S: Final = 0.01
_TIME_CONSTANT_STEPS: Final = 2.5
# Number of contacts that carry a body at rest; its weight then presses none of them in.
_CONTACTS: Final = 4
_MIN_FRICTION: Final = 1e-5
# Limits of MuJoCo.
_MIN_IMPEDANCE: Final = 1e-4
_MAX_IMPEDANCE: Final = 0.9999


class Collider(NamedTuple):
    """A geom that can touch others."""

    geom: str
    part: str  # name of its link or of its body of the world
    surface: Surface
    moves: bool = True
    # contype, conaffinity: the bits by which MJCF selects the geoms of a robot that may touch each other
    contype: int = 1
    conaffinity: int = 1


def pair_name(one: Collider, other: Collider) -> str:
    """Return the name of the contact pair of two geoms of the robot."""
    return f"self {one.geom} {other.geom}"


def add_pairs(
    spec: Any,
    rate: float,
    gravity: float,
    robot: Sequence[Collider],
    world: Sequence[Collider],
    *,
    own: Iterable[tuple[Collider, Collider]] = (),
) -> dict[str, Surface]:
    """Add a contact pair for all geoms except two of the robot or two static ones; return the soft pairs.

    `gravity`: m/s^2, which determines the weight on a contact. The soft pairs are the input of `soften`. `own`: pairs
    of geoms of the robot that collide.
    """
    # A map has thousands of static parts, which need no pairs among themselves.
    moving, fixed = (
        [collider for collider in world if collider.moves],
        [collider for collider in world if not collider.moves],
    )
    apart = ((one, other) for one, other in itertools.combinations(moving, 2) if one.part != other.part)
    among_others = (*apart, *itertools.product(moving, fixed))
    pairs = [(str(number), *pair) for number, pair in enumerate((*itertools.product(robot, world), *among_others))]
    pairs += [(pair_name(*pair), *pair) for pair in own]
    soft: dict[str, Surface] = {}
    hard = _hard(rate, gravity)
    for name, one, other in pairs:
        surface = _combined(one.surface, other.surface)
        names = {"name": name, "geomname1": one.geom, "geomname2": other.geom}
        dimensions, frictions = _frictions(surface)
        pair = spec.add_pair(**names, condim=dimensions, friction=frictions, **hard)
        if surface.adhesion:
            pair.adhesion, pair.gap = surface.adhesion, surface.gap
        if surface.stiffness:
            soft[name] = surface
    return soft


def soften(model: Any, rate: float, soft: Mapping[str, Surface]) -> None:
    """Turn the contacts that state a stiffness into springs, by Bullet's equations (ODE's manual, on ERP and CFM).

    For a stiffness k, a damping c and a time step h, a contact of depth x takes a force f in a step so that its speed
    afterwards is v + f / (h k + c) = k x / (h k + c). MuJoCo's constraint has the same form, with its compliance as a
    share of the bodies' own inverse inertia. A spring that would separate bodies faster than a hard contact stays hard.
    """
    for name, surface in soft.items():
        # MuJoCo sorts the pairs.
        number = model.pair(name).id
        bodies = [model.geom_bodyid[geoms[number]] for geoms in (model.pair_geom1, model.pair_geom2)]
        gives_way = sum(float(model.body_invweight0[body, 0]) for body in bodies)
        assert surface.stiffness is not None
        held = surface.stiffness / rate + surface.damping
        if surface.stiffness / held >= 1 / (2 * CONTACT_IMPEDANCE * _time(rate)):
            continue
        share = gives_way / (gives_way + rate / held)
        share = min(max(share, _MIN_IMPEDANCE), _MAX_IMPEDANCE)
        model.pair_margin[number] = 0.0
        model.pair_solimp[number, :2] = share
        model.pair_solref[number] = -share * rate * surface.stiffness / held, -share * rate


def _frictions(surface: Surface) -> tuple[int, list[float]]:
    """Return the dimensions of a contact and its coefficients: two of sliding, one of spinning, and two of rolling."""
    sliding, spinning, rolling = surface.friction, surface.spinning, surface.rolling
    # MuJoCo rejects a coefficient of 0.
    dimensions = 6 if rolling else 4 if spinning else 3
    if dimensions > 3:
        sliding, spinning = max(sliding, _MIN_FRICTION), max(spinning, _MIN_FRICTION)
    return dimensions if sliding > 0 else 1, [sliding, sliding, spinning, rolling, rolling]


def _combined(one: Surface, other: Surface) -> Surface:
    """Combine two surfaces as PyBullet does: frictions multiply, springs are in series; adhesions add, as in MuJoCo."""
    stated = [surface for surface in (one, other) if surface.stiffness]
    stiffness = 1 / sum(1 / (surface.stiffness or 1.0) for surface in stated) if stated else None
    damping = sum(surface.damping for surface in stated)
    # MuJoCo's default is the greater of the two coefficients.
    spinning, rolling = (
        mine * other.friction + its * one.friction
        for mine, its in ((one.spinning, other.spinning), (one.rolling, other.rolling))
    )
    adhesion, gap = one.adhesion + other.adhesion, max(one.gap, other.gap)
    return Surface(one.friction * other.friction, stiffness, damping, rolling, spinning, adhesion, gap)


def _time(rate: float) -> float:
    return max(_TIME_CONSTANT_S, _TIME_CONSTANT_STEPS / rate)


def _hard(rate: float, gravity: float) -> dict[str, Any]:
    """Return the parameters of the hardest contact that does not separate, with a margin that carries the weight."""
    time = _time(rate)
    depth = gravity * time**2 * (1 - CONTACT_IMPEDANCE) / CONTACT_IMPEDANCE**2
    return {
        "solref": [time, 1.0],
        "solimp": [CONTACT_IMPEDANCE, CONTACT_IMPEDANCE, 0.001, 0.5, 2.0],
        "margin": depth / _CONTACTS,
    }

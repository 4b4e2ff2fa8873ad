"""How bodies touch: which can, with how much friction, and how hard.

MuJoCo's contacts are softer than Bullet's by design. What is set here was measured with the burger (a line, a circle
and a spin at 60 to 1000 Hz): contacts that converge faster let go for single steps, and wheels lose their grip.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from sim_action.robot.robot_model import Surface

FRICTION_RATIO: Final = 100.0
"""How much less friction gives way than what presses bodies together, lest robots creep down slopes."""

# Of a contact: the share of a force that it takes up without giving way, and its time constant in s and in steps.
_IMPEDANCE: Final = 0.9
_CONVERGES_IN: Final = 0.01
_CONVERGES_IN_STEPS: Final = 2.5
# On so many contacts a body rests, when its weight is to press none of them in.
_CONTACTS: Final = 4
# What the engine allows.
_LEAST_IMPEDANCE: Final = 1e-4
_MOST_IMPEDANCE: Final = 0.9999


class Skin(NamedTuple):
    """A geom as what others touch: `part` is the name of a link or of a body of the world."""

    geom: str
    part: str
    surface: Surface
    moves: bool = True


def add_pairs(
    spec: Any, rate: float, gravity: float, robot: Sequence[Skin], world: Sequence[Skin]
) -> dict[str, Surface]:
    """Lets everything touch, but for the robot's links each other; returns pairs that are soft, for `soften`.

    `gravity`: m/s^2, that gives things a weight.
    """
    # A map has thousands of fixed parts, which touch none of each other.
    moving, fixed = [skin for skin in world if skin.moves], [skin for skin in world if not skin.moves]
    among_others = (*itertools.combinations(moving, 2), *itertools.product(moving, fixed))
    pairs = [*itertools.product(robot, world), *among_others]
    soft: dict[str, Surface] = {}
    hard = _hard(rate, gravity)
    for number, (one, other) in enumerate(pairs):
        surface, name = _combined(one.surface, other.surface), str(number)
        # The engine takes no coefficient of 0.
        dimensions = 3 if surface.friction > 0 else 1
        slides = [surface.friction, surface.friction, 0, 0, 0]
        names = {"name": name, "geomname1": one.geom, "geomname2": other.geom}
        spec.add_pair(**names, condim=dimensions, friction=slides, **hard)
        if surface.stiffness:
            soft[name] = surface
    return soft


def soften(model: Any, rate: float, soft: Mapping[str, Surface]) -> None:
    """Makes springs of the contacts that have a stiffness, by the equations of Bullet (ODE's manual, on ERP and CFM).

    With a stiffness k, a damping c and the step h, a contact that is as deep as x takes a force f in a step so that
    v + f / (h k + c) = k x / (h k + c) is its speed after it. MuJoCo's constraint has the same form, but that its
    compliance is told as a share of what the bodies themselves give way to a force. A spring that would push them
    apart faster than a hard contact stays one.
    """
    for name, surface in soft.items():
        # The engine has sorted them.
        number = model.pair(name).id
        bodies = [model.geom_bodyid[geoms[number]] for geoms in (model.pair_geom1, model.pair_geom2)]
        gives_way = sum(float(model.body_invweight0[body, 0]) for body in bodies)
        assert surface.stiffness is not None
        if surface.stiffness * gives_way >= _time(rate) ** -2:
            continue
        held = surface.stiffness / rate + surface.damping
        share = gives_way / (gives_way + rate / held)
        share = min(max(share, _LEAST_IMPEDANCE), _MOST_IMPEDANCE)
        model.pair_margin[number] = 0.0
        model.pair_solimp[number, :2] = share
        model.pair_solref[number] = -share * rate * surface.stiffness / held, -share * rate


def _combined(one: Surface, other: Surface) -> Surface:
    """What PyBullet makes of two surfaces: a product of frictions, springs in a row."""
    stated = [surface for surface in (one, other) if surface.stiffness]
    stiffness = 1 / sum(1 / (surface.stiffness or 1.0) for surface in stated) if stated else None
    damping = sum(surface.damping for surface in stated)
    # Left to itself, the engine takes the greater of two coefficients.
    return Surface(one.friction * other.friction, stiffness, damping)


def _time(rate: float) -> float:
    """The time constant of a hard contact in s."""
    return max(_CONVERGES_IN, _CONVERGES_IN_STEPS / rate)


def _hard(rate: float, gravity: float) -> dict[str, Any]:
    """As hard as a contact can be without letting go, and so much larger that a weight does not press it in."""
    time = _time(rate)
    depth = gravity * time**2 * (1 - _IMPEDANCE) / _IMPEDANCE**2
    return {
        "solref": [time, 1.0],
        "solimp": [_IMPEDANCE, _IMPEDANCE, 0.001, 0.5, 2.0],
        "margin": depth / _CONTACTS,
    }

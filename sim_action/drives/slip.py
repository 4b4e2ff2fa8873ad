"""How much wheels that cannot be steered slip when a robot turns, by where they and its mass are."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Final

# Of an interval: down to the last bits.
_HALVINGS: Final = 60


@dataclass(frozen=True, slots=True)
class Footing:
    """Where a wheel stands, in m ahead of the middle of all wheels, and its share of the load."""

    ahead: float
    load: float


def footings(aheads: Sequence[float], mass_ahead: float) -> list[Footing]:
    """The wheels of both sides of a robot whose mass is in the mean at `mass_ahead`, in m as `aheads`.

    Loads change evenly from front to rear, as they do on two axles.
    """
    middle = fmean(aheads)
    spread = sum((ahead - middle) ** 2 for ahead in aheads)
    lean = (mass_ahead - middle) / spread if spread else 0.0
    loads = [max(0.0, 1 / len(aheads) + lean * (ahead - middle)) for ahead in aheads]
    return [Footing(ahead - middle, load) for ahead, load in zip(aheads, loads, strict=True)]


def slip_factor(wheels: Sequence[Footing], separation: float) -> float:
    """By how much further apart the wheels of a turning robot seem to be: wanted rim speed over turning rate.

    A robot that turns drags its front and rear wheels sideways. Friction that is the same in all directions (Coulomb's)
    then also lets rims slip lengthwise, until its forces and moments cancel. Four wheels that carry the same load do
    so at 1 + (wheelbase / separation)^2, whatever the coefficient and the speed.
    """
    half = separation / 2
    furthest = max(abs(wheel.ahead) for wheel in wheels)

    def moment(slip: float) -> float:
        shift = _root(lambda shift: sum(_sideways(wheel, slip, shift) for wheel in wheels), -furthest, furthest)
        return sum(_moment(wheel, half, slip, shift) for wheel in wheels)

    return 1 + _root(moment, 0.0, 2 * furthest**2 / half) / half


def _sideways(wheel: Footing, slip: float, shift: float) -> float:
    """A wheel's friction to the side, for a robot that turns at 1 rad/s about a point `shift` m behind the middle."""
    return wheel.load * _over(wheel.ahead + shift, math.hypot(slip, wheel.ahead + shift))


def _moment(wheel: Footing, half: float, slip: float, shift: float) -> float:
    """The moment of its friction about the middle; `slip`: m/s of its rim, lengthwise."""
    arm = half * slip - wheel.ahead * (wheel.ahead + shift)
    return wheel.load * _over(arm, math.hypot(slip, wheel.ahead + shift))


def _over(part: float, whole: float) -> float:
    return part / whole if whole else 0.0


def _root(rising: Callable[[float], float], low: float, high: float) -> float:
    """Where a function that rises passes through zero."""
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if rising(middle) < 0 else (low, middle)
    return high

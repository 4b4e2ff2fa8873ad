"""Motions that have no closed formula, integrated in small steps of their own, without any code of the engines."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

GRAVITY: Final = 9.80665
Vector = NDArray[np.float64]


def runge_kutta(rate: Callable[[float, Vector], Vector], start: Sequence[float], seconds: float, steps: int) -> Vector:
    """The states (steps + 1, N) of an initial value problem, by the classic method of fourth order."""
    step, states = seconds / steps, [np.asarray(start, dtype=np.float64)]
    for number in range(steps):
        time, state = number * step, states[-1]
        one = rate(time, state)
        two = rate(time + step / 2, state + step / 2 * one)
        three = rate(time + step / 2, state + step / 2 * two)
        four = rate(time + step, state + step * three)
        states.append(state + step / 6 * (one + 2 * two + 2 * three + four))
    return np.array(states)


def pendulum_period(length: float, amplitude: float, gravity: float = GRAVITY) -> float:
    """The period of a mathematical pendulum, for any amplitude in rad: by the arithmetic-geometric mean."""
    one, other = 1.0, math.cos(amplitude / 2)
    while abs(one - other) > 1e-15:
        one, other = (one + other) / 2, math.sqrt(one * other)
    return 2 * math.pi * math.sqrt(length / gravity) / one

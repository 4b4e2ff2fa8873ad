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


def sliding_plate(
    points: Vector,
    *,
    mass: float,
    moment: float,
    friction: float,
    height: float,
    velocity: tuple[float, float],
    torque: tuple[float, float],
    steps_per_s: float = 4000,
) -> Vector:
    """Where a flat body comes to rest that slides on points: x, y, yaw.

    The friction of each point is opposite to its velocity, and acts `height` m below the centre of mass: loads change
    linearly over the body, so that it does not tip. Below 0.1 mm/s friction is smoothed.

    `points`: (P, 2), about the centre of mass. `torque`: in N m, from the start, and for how many seconds.
    """
    twist, brief = torque
    weight = mass * GRAVITY

    def rate(state: Vector, twist: float) -> Vector:
        yaw, x_speed, y_speed, spin = state[2:]
        cos, sin = math.cos(yaw), math.sin(yaw)
        arms = points @ np.array([[cos, sin], [-sin, cos]])
        slips = np.column_stack((x_speed - spin * arms[:, 1], y_speed + spin * arms[:, 0]))
        ways = slips / np.maximum(np.hypot(slips[:, 0], slips[:, 1]), 1e-4)[:, None]
        loads = np.full(len(points), weight / len(points))
        for _ in range(3):
            force = -friction * loads @ ways
            loads = weight / len(points) - height * arms @ np.linalg.solve(arms.T @ arms, force)
        forces = -friction * loads[:, None] * ways
        braking = float((arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0]).sum())
        turning = (braking + twist) / moment
        return np.array([x_speed, y_speed, spin, *(forces.sum(axis=0) / mass), turning])

    reach = float(np.hypot(points[:, 0], points[:, 1]).max())
    turn = twist * brief / moment
    seconds = 1.5 * (math.hypot(*velocity) + abs(turn) * reach) / (friction * GRAVITY)
    # Two parts: across the end of the torque, the method would lose its order.
    start = (0.0, 0.0, 0.0, *velocity, 0.0)
    turned = runge_kutta(lambda _, state: rate(state, twist), start, brief, round(brief * steps_per_s))[-1]
    end = runge_kutta(lambda _, state: rate(state, 0.0), turned.tolist(), seconds, round(seconds * steps_per_s))[-1]
    return np.asarray(end[:3])


def corners(half_length: float, half_width: float) -> Vector:
    """The corners of a rectangle, (4, 2)."""
    return np.array([(x * half_length, y * half_width) for x in (1, -1) for y in (1, -1)], dtype=np.float64)


def pendulum_period(length: float, amplitude: float, gravity: float = GRAVITY) -> float:
    """The period of a mathematical pendulum, for any amplitude in rad: by the arithmetic-geometric mean."""
    one, other = 1.0, math.cos(amplitude / 2)
    while abs(one - other) > 1e-15:
        one, other = (one + other) / 2, math.sqrt(one * other)
    return 2 * math.pi * math.sqrt(length / gravity) / one


def double_pendulum(start: tuple[float, float], seconds: float, steps: int = 20_000) -> tuple[float, float]:
    """The angles of two thin rods of 1 kg and 1 m, released from rest.

    The second angle is from the line of the first rod.
    """

    def rate(_: float, state: Vector) -> Vector:
        # Angles of both rods from the vertical; Lagrange's equations.
        one, two, spin_one, spin_two = state
        cos, sin = math.cos(one - two), math.sin(one - two)
        masses = np.array([[4 / 3, cos / 2], [cos / 2, 1 / 3]])
        forces = np.array(
            [
                -sin / 2 * spin_two**2 - 1.5 * GRAVITY * math.sin(one),
                sin / 2 * spin_one**2 - 0.5 * GRAVITY * math.sin(two),
            ]
        )
        return np.array([spin_one, spin_two, *np.linalg.solve(masses, forces)])

    first, second = start
    one, two = runge_kutta(rate, (first, first + second, 0.0, 0.0), seconds, steps)[-1, :2].tolist()
    return one, two - one

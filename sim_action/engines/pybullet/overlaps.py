"""What is inside what in PyBullet, at present."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import pybullet

from sim_action.state.observation import Clash, Overlap


def overlaps(client: int, robot: int, links: Mapping[int, str], bodies: Mapping[int, str]) -> tuple[Overlap, ...]:
    """Which links of a robot are inside which bodies, by the engine's numbers for both; each pair of them once."""
    deepest: dict[tuple[str, str], float] = {}
    for body, name in bodies.items():
        # Contact points are those of the last step, and there may have been none.
        for point in pybullet.getClosestPoints(robot, body, 0.0, physicsClientId=client):
            pair = links[point[3]], name
            deepest[pair] = max(deepest.get(pair, 0.0), -point[8])
    return tuple(Overlap(link, name, depth) for (link, name), depth in deepest.items() if depth > 0)


def clashes(client: int, moving: Collection[int], bodies: Mapping[int, str]) -> tuple[Clash, ...]:
    """Which of the bodies that move are inside which others; each pair once."""
    deepest: dict[tuple[str, str], float] = {}
    for number in moving:
        for other in bodies:
            if other == number or (other in moving and other < number):
                continue
            for point in pybullet.getClosestPoints(number, other, 0.0, physicsClientId=client):
                pair = bodies[number], bodies[other]
                deepest[pair] = max(deepest.get(pair, 0.0), -point[8])
    return tuple(Clash(body, other, depth) for (body, other), depth in deepest.items() if depth > 0)

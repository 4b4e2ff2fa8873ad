"""Real robots follow five waypoints, in the real engine.

The path turns by 90 deg twice, by 135 deg once, by 45 deg once, where nobody stops, and crosses itself. `off`: how far
from it the base is at the most, in m. A car cuts corners; who turns on the spot leaves the path where it does not, at
45 deg, and slips while it turns (r2d2 the most). `near`: how far from the furthest of the waypoints. `end`: how far
from the last, at rest. All are as measured, and a little.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from sim_action.commands.waypoints import Leg, Point
from sim_action.engines import ENGINES
from sim_action.simulation.loop import SimulationRun
from tests.integration.engines import on_every_engine
from tests.simulated import simulated
from tools.bench.robots import BURGER, ROBOTS

PATH: Final = ((1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.5, 0.5), (1.5, 0.5))
RATE: Final = 120


@dataclass(frozen=True)
class Follower:
    """A robot, how large its path is, how it drives, and in PyBullet and MuJoCo how well, in m."""

    name: str
    scale: float  # of the path
    figures: Mapping[str, object]
    off: tuple[float, float]
    near: tuple[float, float]
    end: tuple[float, float]
    robot: Mapping[str, object] = field(default_factory=dict)


def figures(speed: float, lookahead: float, tolerance: float, **more: float) -> dict[str, float]:
    return {"speed": speed, "lookahead": lookahead, "tolerance": tolerance, **more}


R2D2S: Final = {side: [f"{side}_front_wheel_joint", f"{side}_back_wheel_joint"] for side in ("left", "right")}
# Its wheels have the inertia of flywheels.
R2D2: Final = {"drive": {"skid": {**R2D2S, "acceleration": 0.2}}}
NEAR: Final = (0.01, 0.01)
FOLLOWERS: Final = (
    Follower("burger", 1.0, figures(0.2, 0.3, 0.05), (0.07, 0.07), NEAR, NEAR),
    Follower("husky", 2.0, figures(0.5, 0.6, 0.1, max_turn_rate=0.8), (0.17, 0.12), NEAR, NEAR),
    Follower("r2d2", 2.0, figures(0.3, 0.6, 0.1, max_turn_rate=0.5), (0.28, 0.2), (0.02, 0.015), (0.02, 0.015), R2D2),
    Follower("racecar", 2.0, figures(0.5, 0.5, 0.05), (0.22, 0.22), (0.28, 0.28), NEAR),
)
KNOWN: Final = {known.name: known for known in (BURGER, *ROBOTS)}
IN_SOAK: Final = (pytest.mark.pybullet, pytest.mark.soak)


def run(folder: Path, follower: Follower, engine: str) -> SimulationRun:
    known = KNOWN[follower.name]
    scenario = {
        "name": "five waypoints",
        "robot": {"model": known.path, **known.keys, **follower.robot},
        "commands": {"waypoints": [{"x": x, "y": y} for x, y in waypoints(follower)], **follower.figures},
        "expect": [{"upright": {"max_tilt": "10 deg"}}],
        "time_limit": "75 s",
        "trace": {"rate": RATE},
        "backend": engine,
    }
    done = simulated(folder, scenario, outside=True)
    assert all(verdict.passed for verdict in done.verdicts)
    return done


def waypoints(follower: Follower) -> list[Point]:
    return [(follower.scale * x, follower.scale * y) for x, y in PATH]


def nearest_in_turn(places: list[Point], points: list[Point], within: float) -> list[float]:
    """How near it came to each point, on its way from within some distance of the one before to the next one."""
    firsts, first = [], 0
    for point in points:
        first += next(index for index, place in enumerate(places[first:]) if math.dist(place, point) <= within)
        firsts.append(first)
    stretches = zip(points, firsts, [*firsts[1:], len(places)], strict=True)
    return [min(math.dist(place, point) for place in places[here:after]) for point, here, after in stretches]


@on_every_engine
@pytest.mark.parametrize(
    "follower", [pytest.param(each, marks=() if each.name == "burger" else IN_SOAK, id=each.name) for each in FOLLOWERS]
)
def test_it_follows_five_waypoints(follower: Follower, engine: str, tmp_path: Path) -> None:
    done = run(tmp_path, follower, engine)
    places: list[Point] = [(x, y) for x, y, _ in done.trace.base_position_xyz.tolist()]
    points = waypoints(follower)
    legs = [Leg(*ends) for ends in zip([places[0], *points], points, strict=False)]
    off = max(min(math.dist(place, leg.closest(place)) for leg in legs) for place in places)
    column = list(ENGINES).index(engine)
    assert off <= follower.off[column]
    assert max(nearest_in_turn(places, points, 0.3 * follower.scale)) <= follower.near[column]
    assert math.dist(places[-1], points[-1]) <= follower.end[column]
    assert float(np.abs(done.trace.speed[-RATE:]).max()) < 0.005
    # Nothing was asked of the drive that it cannot do.
    assert not [note for note in done.notes if "a twist asked" in note]

"""The distance of a point to the edge of the convex hull of others, against an independent construction."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.monitors.footing import Footing, support_margins
from sim_action.core.geometry import Vector3
from sim_action.state.trace_records import ContactRecord, LinkTouch
from tests.soak import examples
from tests.traces import trace

Point = tuple[float, float]
SQUARE: list[Point] = [(-1, -1), (1, -1), (1, 1), (-1, 1)]


def margin(centre: Point, points: list[Point]) -> float:
    moment = np.zeros(len(points), dtype=np.intp)
    return float(support_margins(np.array([centre]), moment, np.array(points, dtype=np.float64).reshape(-1, 2))[0])


@pytest.mark.parametrize(
    ("centre", "points", "expected"),
    [
        ((0, 0), SQUARE, 1.0),
        ((0.75, 0.5), SQUARE, 0.25),
        ((1, 0), SQUARE, 0.0),
        ((1.5, 0), SQUARE, -0.5),
        ((4, 5), SQUARE, -5.0),
        ((0, 0), [*SQUARE, (0, 0), (0.5, -0.5), (1, 1)], 1.0),
        ((0, 0), [(-1, 0), (1, 0)], 0.0),
        ((0, 2), [(-1, 0), (1, 0)], -2.0),
        ((4, 4), [(-1, 0), (1, 0)], -5.0),
        ((0, 2), [(-1, 0), (0.5, 0), (1, 0)], -2.0),
        ((3, 4), [(0, 0)], -5.0),
        ((3, 4), [(0, 0), (0, 0)], -5.0),
        ((0, 0), [(0, 0)], 0.0),
        ((0, 0), [], -math.inf),
    ],
)
def test_the_margin_is_the_distance_to_the_nearest_edge(centre: Point, points: list[Point], expected: float) -> None:
    assert margin(centre, points) == pytest.approx(expected, abs=1e-12)


def hull_of(points: list[Point]) -> list[Point]:
    """The corners of the convex hull, counterclockwise: both chains of Andrew's algorithm."""

    def chain(ordered: list[Point]) -> list[Point]:
        found: list[Point] = []
        for x, y in ordered:
            while len(found) >= 2 and cross(found[-2], found[-1], (x, y)) <= 0:
                found.pop()
            found.append((x, y))
        return found[:-1]

    ordered = sorted(set(points))
    return chain(ordered) + chain(ordered[::-1])


def cross(start: Point, end: Point, point: Point) -> float:
    return (end[0] - start[0]) * (point[1] - start[1]) - (end[1] - start[1]) * (point[0] - start[0])


def expected_margin(centre: Point, points: list[Point]) -> float:
    hull = hull_of(points)
    edges = list(zip(hull, [*hull[1:], hull[0]], strict=True))
    if all(cross(start, end, centre) >= 0 for start, end in edges):
        return min(cross(start, end, centre) / math.dist(start, end) for start, end in edges)
    return -min(to_segment(centre, start, end) for start, end in edges)


def to_segment(point: Point, start: Point, end: Point) -> float:
    (ax, ay), (bx, by), (px, py) = start, end, point
    share = ((px - ax) * (bx - ax) + (py - ay) * (by - ay)) / math.dist(start, end) ** 2
    share = min(1.0, max(0.0, share))
    return math.dist(point, (ax + share * (bx - ax), ay + share * (by - ay)))


@examples(60)
@given(st.integers(3, 12), st.integers(0, 2**32 - 1))
def test_it_is_that_of_an_independent_hull(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = [(float(x), float(y)) for x, y in rng.normal(size=(count, 2))]
    x, y = (rng.normal(size=2) * rng.choice([0.3, 2.0])).tolist()
    assert margin((x, y), points) == pytest.approx(expected_margin((x, y), points), abs=1e-9)


def test_moments_have_their_own_polygons() -> None:
    moment = np.array([0, 0, 0, 0, 2, 3, 3, 3, 3], dtype=np.intp)
    points = np.array([*SQUARE, (0, 0), *((x + 1, y) for x, y in SQUARE)], dtype=np.float64)
    centres = np.array([(0, 0), (0, 0), (0, 3), (0, 0)], dtype=np.float64)
    assert support_margins(centres, moment, points).tolist() == pytest.approx([1.0, -math.inf, -3.0, 0.0])


def footing(*bodies: str, up: Vector3 = (0.0, 0.0, 1.0)) -> Footing:
    return Footing(("left", "right"), frozenset(bodies), up)


def touching(*found: tuple[float, str, Vector3]) -> ContactRecord:
    return ContactRecord.of([(at, LinkTouch("", body, (at, 0.0, 0.0), normal, 1.0)) for at, body, normal in found])


def test_a_foot_stands_on_what_carries_it() -> None:
    steep, flat = (math.sin(1.05), 0.0, math.cos(1.05)), (math.sin(1.04), 0.0, math.cos(1.04))
    feet = {
        "left": touching(
            (0.1, "ground", (0, 0, 1)), (0.2, "wall", (1, 0, 0)), (0.3, "ramp", flat), (0.4, "ramp", steep)
        ),
        "right": touching((0.2, "box", (0, 0, 1)), (0.2, "ground", (0, 0, 1)), (0.3, "box", (0, 0, 1))),
    }
    seen = replace(trace([0.1, 0.2, 0.3, 0.4]), link_contacts=feet)
    standing = footing("ground", "wall", "ramp").standing(seen)
    assert standing.tolist() == [[True, False, True, False], [False, True, False, False]]
    assert footing("box").standing(seen).tolist() == [[False] * 4, [False, True, True, False]]
    moment, points = footing("ground").points(seen)
    assert (moment.tolist(), points[:, 0].tolist()) == ([0, 1], [0.1, 0.2])
    assert footing().is_known(seen)
    assert not footing().is_known(replace(seen, link_contacts={"left": feet["left"]}))


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, 1.0, 0.0), (0.36, 0.48, 0.8)])
def test_points_are_seen_along_gravity(up: Vector3) -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(20, 3))
    level = footing(up=up).level(points)
    along = points @ np.array(up)
    assert np.hypot(*level.T) == pytest.approx(np.sqrt((points**2).sum(axis=1) - along**2))
    assert footing(up=up).level(points + np.array(up)) == pytest.approx(level)


@pytest.mark.parametrize("points", [[(0, 0), (1, 0)], [(0, 0), (0.4, 0), (1, 0)], [(1, 0), (0, 0), (0.3, 0), (0.6, 0)]])
@pytest.mark.parametrize(("centre", "expected"), [((5, 0), -4.0), ((-2, 0), -2.0), ((0.7, 0), 0.0), ((1, 0), 0.0)])
def test_a_point_on_the_line_of_all_feet_is_outside_beyond_them(
    points: list[tuple[float, float]], centre: tuple[float, float], expected: float
) -> None:
    moment = np.zeros(len(points), dtype=np.intp)
    for turn in (0.0, 0.3):
        cos, sin = np.cos(turn), np.sin(turn)
        turned = np.array([[cos, sin], [-sin, cos]])
        found = support_margins(np.array([centre]) @ turned, moment, np.array(points, dtype=np.float64) @ turned)
        assert found.tolist() == pytest.approx([expected], abs=1e-9)

"""Ways through knots: what they are by hand, and what they must be by calculus."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sim_action.commands.joints import BLENDS, Interpolation, JointPath

STEP: Final = 1e-5

rising = st.lists(st.floats(0, 100), min_size=2, max_size=6, unique_by=lambda time: round(time, 1)).map(sorted)
numbers = st.floats(-100, 100)


@st.composite
def paths(draw: st.DrawFn, *kinds: Interpolation) -> JointPath:
    times = draw(rising)
    assume(all(later - earlier > 0.05 for earlier, later in pairwise(times)))
    values = tuple(draw(numbers) for _ in times)
    return JointPath(tuple(times), values, BLENDS[draw(st.sampled_from(kinds))])


def speed(path: JointPath, time: float) -> float:
    return (path.value(time + STEP) - path.value(time - STEP)) / (2 * STEP)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("linear", (1.0, 1.0, 1.5, 2.0, 3.0, 2.0, 1.0, 1.0)),
        # 10 / 4^3 - 15 / 4^4 + 6 / 4^5 = 106 / 1024.
        ("minimum_jerk", (1.0, 1.0, 1 + 2 * 106 / 1024, 2.0, 3.0, 2.0, 1.0, 1.0)),
        ("hold", (1.0, 1.0, 1.0, 1.0, 3.0, 3.0, 1.0, 1.0)),
    ],
)
def test_a_way_from_1_to_3_and_back(kind: Interpolation, values: tuple[float, ...]) -> None:
    path = JointPath((1.0, 3.0, 7.0), (1.0, 3.0, 1.0), BLENDS[kind])
    assert [path.value(time) for time in (0.0, 1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 9.0)] == pytest.approx(values)


def test_one_knot_is_a_constant() -> None:
    path = JointPath((1.0,), (2.5,), BLENDS["linear"])
    assert [path.value(time) for time in (0.0, 1.0, 2.0)] == [2.5, 2.5, 2.5]


@given(paths("linear", "minimum_jerk", "hold"))
def test_a_path_goes_through_its_knots(path: JointPath) -> None:
    assert [path.value(time) for time in path.times] == list(path.values)


@given(paths("linear", "minimum_jerk", "hold"), st.floats(-10, 110))
def test_a_path_stays_between_its_knots(path: JointPath, time: float) -> None:
    assert min(path.values) - 1e-9 <= path.value(time) <= max(path.values) + 1e-9


@given(paths("linear", "minimum_jerk"), st.floats(0, 100))
def test_a_path_has_no_gaps_and_is_no_faster_than_it_says(path: JointPath, time: float) -> None:
    assert path.blend.peak is not None
    fastest = max(
        abs(there - here) / (later - earlier)
        for (earlier, later), (here, there) in zip(pairwise(path.times), pairwise(path.values), strict=True)
    )
    assert abs(speed(path, time)) <= path.blend.peak * fastest * (1 + 1e-6) + 1e-6


@given(paths("minimum_jerk"))
def test_minimum_jerk_rests_in_every_knot(path: JointPath) -> None:
    """The speed near a knot goes with the square of the time, so that neither it nor the acceleration jumps."""
    for time in path.times:
        assert speed(path, time) == pytest.approx(0.0, abs=30 * 200 * STEP**2 / 0.05**3 + 1e-8)


@given(paths("minimum_jerk"))
def test_minimum_jerk_is_fastest_half_way(path: JointPath) -> None:
    for (earlier, later), (here, there) in zip(pairwise(path.times), pairwise(path.values), strict=True):
        mean = (there - here) / (later - earlier)
        assert speed(path, (earlier + later) / 2) == pytest.approx(1.875 * mean, rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 0.9])
def test_minimum_jerk_is_the_same_backwards(share: float) -> None:
    blend = BLENDS["minimum_jerk"].share
    assert blend(share) + blend(1 - share) == pytest.approx(1.0)


def test_minimum_jerk_has_the_least_squared_jerk() -> None:
    """Of all ways from rest to rest in unit time it has 720 (Flash and Hogan 1985); a quintic with more has more."""
    count = 4000
    blend = BLENDS["minimum_jerk"].share
    cells = [index / count for index in range(count + 1)]
    jerks = [(blend(d) - 3 * blend(c) + 3 * blend(b) - blend(a)) * count**3 for a, b, c, d in quadruples(cells)]
    assert math.fsum(jerk**2 for jerk in jerks) / count == pytest.approx(720.0, rel=0.01)


def quadruples(cells: list[float]) -> list[tuple[float, float, float, float]]:
    return list(zip(cells, cells[1:], cells[2:], cells[3:], strict=False))

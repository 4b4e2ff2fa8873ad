"""Robustness: against its definition, against rtamt, and what decides it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.temporal_logic.formula import Formula, Not, Signal, horizon
from sim_action.assertions.temporal_logic.parser import parse
from sim_action.assertions.temporal_logic.robustness import (
    Samples,
    cause,
    greatest_of_windows,
    least_of_windows,
    robustness,
    until,
)
from tests.assertions.temporal_logic.formulas import X, Y, meaning, plain_formulas, samples_of, walks
from tests.soak import examples

# Values of rtamt 0.4.10, StlDiscreteTimeOfflineSpecification, for "out = " and the formula as rtamt writes it, with x
# and y as "float" at 0, 1, 2, ...: its default unit and period are a second.
RTAMT: dict[str, Any] = json.loads((Path(__file__).parent / "rtamt.json").read_text())


@examples(120)
@given(plain_formulas, walks)
def test_it_is_what_the_definition_says_at_every_moment(formula: Formula, walk: list[tuple[int, int]]) -> None:
    expected = [meaning(formula, walk, at) for at in range(len(walk))]
    assert robustness(formula, samples_of(walk)).tolist() == expected
    strong = [meaning(formula, walk, at, strong=True) for at in range(len(walk))]
    assert robustness(formula, samples_of(walk), strong=True).tolist() == strong
    assert all(pessimistic <= value for pessimistic, value in zip(strong, expected, strict=True))
    opposite = [meaning(formula, walk, at, contrary=True) for at in range(len(walk))]
    assert robustness(Not(formula), samples_of(walk)).tolist() == opposite


BEYOND_RTAMT = ("eventually (always[0 s, 3 s]", "((x > 0) until[1 s, 2 s] (y > 0)) until[0 s, 5 s] (always")
"""Goals whose witness needs a finite interval. rtamt cuts it at the last step, and finds a witness there."""


@pytest.mark.parametrize("case", RTAMT["cases"], ids=lambda case: str(case["formula"]))
def test_it_is_what_rtamt_says_at_every_moment(case: dict[str, Any]) -> None:
    seen = Samples((X, Y), np.column_stack([np.arange(len(RTAMT["x"]), dtype=np.float64), RTAMT["x"], RTAMT["y"]]))
    formula, expected = parse(case["formula"]), [float(value) for value in case["robustness"]]
    found = robustness(formula, seen).tolist()
    if not case["formula"].startswith(BEYOND_RTAMT):
        assert found == expected
        return
    assert found != expected
    assert all(value <= other for value, other in zip(found, expected, strict=True))
    whole = [at for at in range(len(found)) if at + horizon(formula) < len(found)]
    assert [found[at] for at in whole] == [expected[at] for at in whole]


@examples(80)
@given(plain_formulas, walks | walks.map(lambda walk: walk[:1]), st.booleans())
def test_the_comparison_that_decides_has_the_robustness_of_the_whole(
    formula: Formula, walk: list[tuple[int, int]], strong: bool
) -> None:
    whole = meaning(formula, walk, 0, strong=strong)
    found = cause(formula, samples_of(walk), strong=strong)
    if found is None:
        assert math.isinf(whole)
    else:
        assert found.margin == whole
        moment = walk[int(found.time)]
        assert found.left == moment[0 if found.comparison.left == X else 1]


def test_an_example_by_hand() -> None:
    """Speeds at 0, 1, 2, 3 s: the margin to 0.5 is least at 2 s."""
    seen = Samples((Signal("speed"),), np.array([(0, 0.1), (1, 0.4), (2, 0.7), (3, 0.2)], dtype=np.float64))
    assert robustness(parse("always speed < 0.5 m/s"), seen).tolist() == pytest.approx([-0.2, -0.2, -0.2, 0.3])
    assert robustness(parse("eventually[1 s, 2 s] speed > 0.5 m/s"), seen).tolist() == pytest.approx(
        [0.2, 0.2, -0.3, -math.inf]
    )
    found = cause(parse("always speed < 0.5 m/s"), seen)
    assert found is not None
    assert (found.time, found.left, found.right) == (2.0, 0.7, 0.5)


def test_arithmetic() -> None:
    seen = Samples((X, Y), np.array([(0.0, 1.0, -2.0), (1.0, 3.0, 0.5)]))
    assert robustness(parse("2 * x - abs(y) - 1 < -(x + y) * 0.5"), seen).tolist() == pytest.approx([1.5, -6.25])


@given(st.integers(1, 500), st.integers(0, 40), st.integers(0, 40))
@examples(50)
def test_steps_of_240_hz_are_neither_lost_nor_doubled_by_rounding(steps: int, start: int, length: int) -> None:
    """Bounds that are whole steps apart take in the steps at both ends."""
    time = np.arange(1, steps + 1) / 240
    seen = Samples((Signal("time"),), np.column_stack([time, time]))
    last = robustness(parse(f"eventually[{start / 240!r} s, {(start + length) / 240!r} s] time > 0"), seen)
    for at, value in enumerate(last.tolist()):
        if at + start >= steps:
            assert value == -math.inf
        else:
            assert value == time[min(at + start + length, steps - 1)]


values = st.lists(st.integers(-5, 5).map(float), min_size=1, max_size=40)


@given(values, st.lists(st.tuples(st.integers(0, 40), st.integers(0, 40)), min_size=1))
def test_windows_of_any_length_anywhere(seen: list[float], ends: list[tuple[int, int]]) -> None:
    windows = [(min(a, b, len(seen)), min(max(a, b), len(seen))) for a, b in ends]
    first, last = (np.array(side, dtype=np.intp) for side in zip(*windows, strict=True))
    column = np.array(seen)
    least = [min(seen[a:b], default=math.inf) for a, b in windows]
    greatest = [max(seen[a:b], default=-math.inf) for a, b in windows]
    assert least_of_windows(column, first, last).tolist() == least
    assert greatest_of_windows(column, first, last).tolist() == greatest


@given(st.lists(st.tuples(st.integers(-5, 5), st.integers(-5, 5)), min_size=1, max_size=40))
def test_until_goes_backwards_one_by_one(pairs: list[tuple[int, int]]) -> None:
    before, then = (np.array(side, dtype=np.float64) for side in zip(*pairs, strict=True))
    expected, later = [], -math.inf
    for p, q in reversed(pairs):
        later = max(q, min(p, later))
        expected.append(later)
    assert until(before, then).tolist() == expected[::-1]


def test_what_is_given_stays_as_it_was() -> None:
    before, then = np.array([1.0, 2.0, 3.0]), np.array([3.0, 1.0, 0.0])
    until(before, then)
    assert (before.tolist(), then.tolist()) == ([1.0, 2.0, 3.0], [3.0, 1.0, 0.0])

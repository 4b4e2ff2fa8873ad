"""Comparisons that are the same in every run, bare numbers, and premises on which a formula may rest."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.temporal_logic.formula import Interval
from sim_action.assertions.temporal_logic.parser import parse
from sim_action.assertions.temporal_logic.vacuity import bare_numbers, by_name, constant_comparisons, premises

RANGES = {"tilt": (0.0, math.pi), "speed": (0.0, 10.0), "yaw": (-math.pi, math.pi)}


@pytest.mark.parametrize(
    ("formula", "found"),
    [
        ("always (tilt < 180 deg)", [True]),
        ("always (180 deg > tilt)", [True]),
        ("always (tilt < 179 deg)", []),
        ("always (speed > 0 m/s and speed < 10 m/s)", [True, True]),
        ("eventually (speed > 11 m/s)", [False]),
        ("not (abs(yaw) > 181 deg)", [False]),
        ("always (abs(yaw) <= 3.2 rad)", [True]),
        ("always (-speed > -11 m/s)", [True]),
        ("always (speed + 2 m/s < 11 m/s)", []),
        ("always (speed + 2 m/s < 12 m/s)", [True]),
        ("always (speed - speed < 5 m/s)", []),
        ("always (speed * 0.1 < 1 m/s)", [True]),
        ("always (speed * -2 < 0 m/s)", [True]),
        ("always (speed * x < 5)", []),
        ("always (x < 1000000 m and velocity(elbow) < 1000000)", []),
    ],
)
def test_comparisons_with_the_same_result_in_every_run(formula: str, found: list[bool]) -> None:
    assert [constant.is_true for constant in constant_comparisons(parse(formula), by_name(RANGES))] == found


@given(st.floats(0, 10), st.floats(-20, 20), st.sampled_from(["<", ">"]))
def test_a_constant_comparison_has_its_result_at_every_speed(speed: float, limit: float, relation: str) -> None:
    for constant in constant_comparisons(parse(f"speed {relation} {limit!r} m/s"), by_name(RANGES)):
        margin = limit - speed if relation == "<" else speed - limit
        assert constant.is_true == (margin >= 0)


def test_bare_numbers_are_found_on_both_sides() -> None:
    found = list(bare_numbers(parse("always (tilt < 20 and -30 < pitch and yaw + 5 < 90 deg and x < 3 m)")))
    assert [(each.number, [signal.name for signal in each.signals]) for each in found] == [
        (20.0, ["tilt"]),
        (30.0, ["pitch"]),
    ]


@pytest.mark.parametrize(
    ("formula", "found"),
    [
        ("x > 1 implies y > 2", [("x > 1", 0.0, 0.0)]),
        ("always (x > 1 implies y > 2)", [("x > 1", 0.0, math.inf)]),
        ("always[1 s, 2 s] (x > 1 implies eventually[0 s, 3 s] (y > 1 implies z > 1))",
         [("x > 1", 1.0, 2.0), ("y > 1", 1.0, 5.0)]),
        ("(x > 1 implies y > 1) until[2 s, 4 s] (z > 1 implies x > 0)", [("x > 1", 0.0, 4.0), ("z > 1", 2.0, 4.0)]),
        # A false premise makes these false.
        ("not (x > 1 implies y > 2)", []),
        ("(x > 1 implies y > 2) implies z > 1", [("(x > 1) implies (y > 2)", 0.0, 0.0)]),
        ("not not (x > 1 implies y > 2)", [("x > 1", 0.0, 0.0)]),
        ("always (x > 1 and y > 2)", []),
    ],
)  # fmt: skip
def test_premises_on_which_a_formula_rests(formula: str, found: list[tuple[str, float, float]]) -> None:
    told = [(str(premise.formula), premise.interval) for premise in premises(parse(formula))]
    assert told == [(str(parse(text)), Interval(start, end)) for text, start, end in found]

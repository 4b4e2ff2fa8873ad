"""The arithmetic that decides whether a formula can fail, and whether it can hold."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.temporal_logic.formula import And, Comparison, Formula, Implies, Not, parts
from sim_action.assertions.temporal_logic.intervals import by_name, can_be, constants
from sim_action.assertions.temporal_logic.parser import parse

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
        ("always (speed - speed < 5 m/s)", [True]),
        ("always (speed * 0.1 < 1 m/s)", [True]),
        ("always (speed * -2 < 0 m/s)", [True]),
        ("always (speed * x < 5)", []),
        ("always (x < 1000000 m and velocity(elbow) < 1000000)", []),
    ],
)
def test_comparisons_with_the_same_result_in_every_run(formula: str, found: list[bool]) -> None:
    assert [constant.is_true for constant in constants(parse(formula), by_name(RANGES))] == found


@given(st.floats(0, 10), st.floats(-20, 20), st.sampled_from(["<", ">"]))
def test_a_constant_comparison_has_its_result_at_every_speed(speed: float, limit: float, relation: str) -> None:
    for constant in constants(parse(f"speed {relation} {limit!r} m/s"), by_name(RANGES)):
        margin = limit - speed if relation == "<" else speed - limit
        assert constant.is_true == (margin >= 0)


@pytest.mark.parametrize(
    ("formula", "part", "is_true"),
    [
        ("always (x < 1 m or x > 0.5 m)", "(x < 1 m) or (x > 0.5 m)", True),
        ("always (x > 0.5 m or not (x > 1 m))", None, True),
        ("always (x > 1 implies x > 0.5)", None, True),
        ("always (x + y < 1 or x > 0.5 or y > 0.4)", None, True),
        ("always (abs(x) < 1 or x > 0.5 or x < -0.5)", None, True),
        ("always (abs(x - y) > -1)", "abs(x - y) > -1", True),
        ("(always x < 1) or (eventually x > 0.5)", None, True),
        ("always[0 s, 1 s] (x < 1) or eventually[0 s, 2 s] (x > 0.5)", None, True),
        ("not eventually (x > 1 and x < 0.5)", "(x > 1) and (x < 0.5)", False),
        ("eventually (2 * x > y and y > 3 and x < 1)", None, False),
        ("(always x < 1) and (eventually x > 2)", None, False),
    ],
)
def test_parts_with_the_same_result_although_no_comparison_has_one(
    formula: str, part: str | None, is_true: bool
) -> None:
    (constant,) = constants(parse(formula), by_name({}))
    assert constant.is_true == is_true
    assert part is None or str(constant.part) == part


@pytest.mark.parametrize(
    "formula",
    [
        "always (x < 1 or x > 1.5)",
        "always (x < 1 or y > 0.5)",
        "always (x > 1 implies y > 0.5)",
        "(always x < 1) or (eventually x > 1.5)",
        "always[0 s, 2 s] (x < 1) or eventually[0 s, 1 s] (x > 0.5)",
        "(eventually x < 1) and (eventually x > 2)",
        "eventually (x > 1 and eventually (x < 0.5))",
        "x < 1 until x > 2",
        "always (x * y < 1 or x * y > 2)",
        "always (abs(x) + abs(y) < 2 or x > 0.5 or y > 0.5)",
    ],
)
def test_parts_that_a_run_can_make_true_or_false(formula: str) -> None:
    assert not list(constants(parse(formula), by_name({})))


def _joined(one: st.SearchStrategy[str], words: list[str], other: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.builds("({} {} {})".format, one, st.sampled_from(words), other)


_NUMBERS = st.integers(-3, 3).map(str)
_TERMS = st.recursive(
    st.sampled_from(["x", "y"]) | _NUMBERS,
    lambda inner: _joined(inner, ["+", "-"], inner) | inner.map("abs({})".format),
    max_leaves=4,
)
_FORMULAS = st.recursive(
    _joined(_TERMS.map("x * 0 + {}".format), ["<", ">"], _NUMBERS),
    lambda inner: _joined(inner, ["and", "or", "implies"], inner) | inner.map("not {}".format),
    max_leaves=5,
)


@given(_FORMULAS)
def test_a_formula_that_cannot_be_true_or_false_is_so_on_no_point_of_a_grid(text: str) -> None:
    formula = parse(text)
    ranges = by_name({"x": (-4.0, 4.0), "y": (-4.0, 4.0)})
    grid = [step / 2 for step in range(-8, 9)]
    margins = [_margin(formula, {"x": x, "y": y}) for x, y in itertools.product(grid, grid)]
    assert can_be(formula, ranges, true=True) or max(margins) < 0
    assert can_be(formula, ranges, true=False) or min(margins) >= 0


def _margin(formula: Formula, at: dict[str, float]) -> float:
    """The robustness of a formula without temporal operators, by Python's own evaluation of its terms."""
    if isinstance(formula, Comparison):
        left, right = (eval(str(side), {"abs": abs}, at) for side in (formula.left, formula.right))
        return float(right - left if formula.relation in ("<", "<=") else left - right)
    inner = [_margin(part, at) for part in parts(formula)]
    if isinstance(formula, Not):
        return -inner[0]
    if isinstance(formula, Implies):
        return max(-inner[0], inner[1])
    return min(inner) if isinstance(formula, And) else max(inner)

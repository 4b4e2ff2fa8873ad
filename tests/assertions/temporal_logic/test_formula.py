"""What can be known of a formula by looking at it."""

from __future__ import annotations

import math

import pytest

from sim_action.assertions.temporal_logic.formula import Signal, comparisons, horizon, signals_of
from sim_action.assertions.temporal_logic.parser import parse


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("x < 1", 0.0),
        ("x < 1 and not (y > 2)", 0.0),
        ("always[1 s, 3 s] x < 1", 3.0),
        ("always[1 s, 3 s] eventually[0 s, 500 ms] x < 1", 3.5),
        ("always[1 s, 3 s] (x < 1) or eventually[0 s, 4 s] x < 1", 4.0),
        ("(always[0 s, 2 s] x < 1) until[0 s, 4 s] x > 2", 6.0),
        ("x < 1 implies eventually[2 s, 2 s] x > 1", 2.0),
        ("always x < 1", math.inf),
        ("eventually[2 s, end] x < 1", math.inf),
        ("always[0 s, 1 s] (x < 1 until y > 2)", math.inf),
    ],
)
def test_how_far_it_looks_ahead(text: str, seconds: float) -> None:
    assert horizon(parse(text)) == seconds


def test_its_signals_are_each_there_once() -> None:
    formula = parse("always (x + 2 * abs(-y) < x and effort(arm) < 1) until time > y")
    assert signals_of(formula) == (Signal("x"), Signal("y"), Signal("effort", "arm"), Signal("time"))
    texts = [str(comparison) for comparison in comparisons(formula)]
    assert texts == ["x + 2 * abs(-y) < x", "effort(arm) < 1", "time > y"]


@pytest.mark.parametrize(
    "text",
    [
        "x - (y - 1 m) < -(2 * x)",
        "(x + 1) * 2 < 0.1 rad",
        "always[0 s, end] ((x < 1) until[1 s, 2.5 s] (y > 1e-09 m/s))",
        "((x < 1) or (y > 2)) and (not (x < 1))",
        "(abs(yaw) < 190 deg) and (0.50 cm > z)",
        "(x < 1) implies ((y > 2) implies (x < 1))",
    ],
)
def test_how_it_is_printed(text: str) -> None:
    assert str(parse(text)) == text.replace("[0 s, end]", "")

"""What each assertion looked at over time: the curves, with their names, units and limits."""

from __future__ import annotations

import math

import pytest

from sim_action.assertions import Assertion
from sim_action.assertions.max_speed import MaxSpeed
from sim_action.assertions.reach import Reach
from sim_action.assertions.stay_within import StayWithin
from sim_action.assertions.travel import Travel
from sim_action.assertions.upright import Upright
from sim_action.marks import Arrow, Circle, Mark, Polygon, Polyline
from sim_action.signals import Signal
from sim_action.trace import Trace
from tests.traces import START, expectation, scene, trace

WAY = trace([0.0, 1.0, 2.0], x=[0.0, 3.0, 3.0], y=[0.0, 0.0, 4.0], yaw=[0.0, 0.5, 1.0], speed=[0.0, 3.0, 4.0])

Curve = tuple[str, str, list[float], float | None, float | None]


def signals(assertion: Assertion, seen: Trace = WAY) -> tuple[Signal, ...]:
    return assertion.signals(scene(), START, seen)


def told(signal: Signal) -> Curve:
    return signal.name, signal.unit, [round(value, 9) for value in signal.values.tolist()], signal.lower, signal.upper


@pytest.mark.parametrize(
    ("assertion", "curves"),
    [
        (Travel(at_least=2.0, at_most=6.0), [("travelled", "m", [0.0, 3.0, 5.0], 2.0, 6.0)]),
        (Reach(x=3, y=0, tolerance=0.25), [("distance to (3, 0)", "m", [3.0, 0.0, 4.0], None, 0.25)]),
        (
            Reach(x=3, y=0, yaw=0.5, tolerance=0.25, yaw_tolerance=0.125),
            [
                ("distance to (3, 0)", "m", [3.0, 0.0, 4.0], None, 0.25),
                ("heading error", "rad", [0.5, 0.0, 0.5], None, 0.125),
            ],
        ),
        (Upright(max_tilt=0.5), [("tilt", "rad", [0.0, 0.0, 0.0], None, 0.5)]),
        (
            MaxSpeed(linear=3.5, angular=1.0),
            [
                ("speed", "m/s", [0.0, 3.0, 4.0], None, 3.5),
                ("turn rate", "rad/s", [0.0, 0.0, 0.0], None, 1.0),
            ],
        ),
        (StayWithin(y=(-1.0, 2.0)), [("y", "m", [0.0, 0.0, 4.0], -1.0, 2.0)]),
    ],
    ids=lambda value: value.title if isinstance(value, Assertion) else "",
)
def test_curves_have_names_units_values_and_limits(assertion: Assertion, curves: list[Curve]) -> None:
    found = signals(assertion)
    assert [told(signal) for signal in found] == curves
    assert all(signal.time.tolist() == [0.0, 1.0, 2.0] for signal in found)


@pytest.mark.parametrize(
    ("options", "window"),
    [({}, (0.0, 2.0)), ({"after": 0.5, "before": 1.5}, (0.5, 1.5)), ({"before": 9.0}, (0.0, 2.0))],
)
def test_limits_hold_in_the_window_of_the_expectation(options: dict[str, float], window: tuple[float, float]) -> None:
    (signal,) = expectation(Upright(), **options).signals(scene(), START, WAY)
    assert (signal.start, signal.end) == window
    assert signal.time.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    ("assertion", "marks"),
    [
        (Travel(at_least=2.0, at_most=6.0), (Circle(0.0, 0.0, 2.0), Circle(0.0, 0.0, 6.0))),
        (Reach(x=3, y=0, tolerance=0.25), (Circle(3.0, 0.0, 0.25),)),
        (Reach(x=3, y=0, yaw=0.5, tolerance=0.25), (Circle(3.0, 0.0, 0.25), Arrow(3.0, 0.0, 0.5))),
        (StayWithin(x=(0, 1), y=(2, 3)), (Polygon(((0, 2), (1, 2), (1, 3), (0, 3))),)),
        (StayWithin(x=(0, 1)), (Polyline(((0, -5, 0), (0, 5, 0))), Polyline(((1, -5, 0), (1, 5, 0))))),
        (StayWithin(z=(0, 1)), ()),
        (Upright(max_tilt=math.radians(5)), ()),
    ],
    ids=lambda value: value.title if isinstance(value, Assertion) else "",
)
def test_marks_say_where_it_is(assertion: Assertion, marks: tuple[Mark, ...]) -> None:
    assert expectation(assertion).marks(scene(), START) == marks

"""How deep solids are in each other."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import Pose, Vector3, quaternion_from_rpy, rotate
from sim_action.world.overlap_depth import depth, inner_solids
from sim_action.world.parts import BoxPart, CylinderPart, HullPart, Part, SpherePart

UNIT = BoxPart((1.0, 1.0, 1.0))
BALL = SpherePart(0.5)
CAN = CylinderPart(0.5, 1.0)


def deep(one: Part, other: Part, at: Vector3, rpy: Vector3 = (0.0, 0.0, 0.0)) -> float:
    """The first stands at the origin."""
    turned = Pose(at, quaternion_from_rpy(*rpy))
    return depth(list(inner_solids([one], Pose())), list(inner_solids([other], turned)))


@pytest.mark.parametrize(
    ("one", "other", "at", "expected"),
    [
        (UNIT, UNIT, (0.9, 0.3, 0.0), 0.1),
        (UNIT, UNIT, (1.1, 0.0, 0.0), 0.0),
        (UNIT, UNIT, (0.0, 0.0, 0.0), 1.0),
        (BALL, BALL, (0.6, 0.0, 0.0), 0.4),
        (BALL, BALL, (0.6, 0.9, 0.0), 0.0),
        (UNIT, BALL, (0.9, 0.0, 0.0), 0.1),
        (UNIT, BALL, (0.5 + 0.3, 0.5 + 0.3, 0.0), 0.5 - math.hypot(0.3, 0.3)),
        (UNIT, BALL, (0.1, 0.0, 0.0), 0.9),
        (CAN, CAN, (0.9, 0.0, 0.0), 0.1),
        (CAN, BALL, (0.0, 0.0, 0.9), 0.1),
    ],
)
def test_depths_are_those_of_a_sketch(one: Part, other: Part, at: Vector3, expected: float) -> None:
    assert deep(one, other, at) == pytest.approx(expected, abs=1e-12)
    assert deep(other, one, (-at[0], -at[1], -at[2])) == pytest.approx(expected, abs=1e-12)


def test_a_box_that_is_turned_reaches_further() -> None:
    assert deep(UNIT, UNIT, (1.1, 0.0, 0.0), (0.0, 0.0, math.radians(45))) == pytest.approx(0.5 + math.sqrt(0.5) - 1.1)
    # An edge along z, before another along y: no face of either tells them apart.
    upright = Pose((0.0, 0.0, 0.0), quaternion_from_rpy(0.0, 0.0, math.radians(45)))
    for away, expected in ((1.40, math.sqrt(2) - 1.40), (1.42, 0.0)):
        lying = Pose((away, 0.0, 0.0), quaternion_from_rpy(0.0, math.radians(45), 0.0))
        found = depth(list(inner_solids([UNIT], upright)), list(inner_solids([UNIT], lying)))
        assert found == pytest.approx(expected, abs=1e-12)


def test_of_what_is_none_of_these_nothing_is_known() -> None:
    assert deep(HullPart(((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))), UNIT, (0.0, 0.0, 0.0)) == 0.0


LENGTH = st.floats(-1.5, 1.5)
TURN = st.floats(-3.0, 3.0)


@given(st.tuples(LENGTH, LENGTH, LENGTH), st.tuples(TURN, TURN, TURN))
def test_a_box_is_as_deep_as_it_takes_to_move_it_out(at: Vector3, rpy: Vector3) -> None:
    """Along some axis, moved by its depth, it is out: there is no way out that is shorter."""
    found = deep(UNIT, UNIT, at, rpy)
    own = quaternion_from_rpy(*rpy)
    axes = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    ways = [*axes, *(rotate(own, axis) for axis in axes)]
    moved = [
        deep(UNIT, UNIT, (at[0] + way * x, at[1] + way * y, at[2] + way * z), rpy)
        for x, y, z in ways
        for way in (-0.99 * found, 0.99 * found)
    ]
    assert found == 0 or min(moved) > 0

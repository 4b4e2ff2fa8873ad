"""Comparisons of `stl` that check nothing, bare numbers, and premises on which a formula may rest."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import pytest

from sim_action.assertions.temporal_logic.formula import Interval
from sim_action.assertions.temporal_logic.formula_claims import bare_numbers, premises
from sim_action.assertions.temporal_logic.parser import parse
from tests.scenarios import load
from tests.world.test_robot_reach import ARMS, refused, scenario

WORLD: Final = (
    "world: {objects: [{name: wall, box: [0.1, 1, 1], pose: {x: 9, z: 0.5}},\n"
    "  {name: ball, sphere: {radius: 0.1}, mass: 1, pose: {x: 7}},\n"
    "  {name: gate, box: [0.1, 1, 1], pose: {x: 8, z: 0.5}, path: [{at: 0}, {at: 1 s, y: 2}]}]}\n"
)
SHAPE: Final = '<collision><geometry><box size="0.01 0.01 0.01"/></geometry></collision>'


@pytest.fixture
def arms(tmp_path: Path) -> Path:
    text = ARMS.replace('<link name="trunk">', f'<link name="trunk">{SHAPE}')
    (tmp_path / "robot.urdf").write_text(text.replace('<link name="tool">', f'<link name="tool">{SHAPE}'))
    return tmp_path


@pytest.mark.parametrize(
    ("comparison", "base", "is_constant"),
    [
        ("distance(tool, tool) < 1 m", "free", True),
        ("distance(tool, lower) < 1 m", "free", True),
        ("distance(wall, wall) < 1 m", "free", True),
        ("distance(ball, ball) < 1 m", "free", True),
        ("distance(wall, trunk) < 100 m", "fixed", True),
        ("distance(wall, trunk) < 100 m", "free", False),
        ("distance(tool, upper) < 0.4 m", "free", False),
        ("distance(tool, ball) < 1 m", "fixed", False),
        ("trunk.z < 1 m", "fixed", True),
        ("trunk.tilt + trunk.yaw < 10 deg", "fixed", True),
        ("trunk.z < 1 m", "free", False),
        ("trunk.z < tool.z", "fixed", False),
        ("wall.x > 1 m", "free", True),
        ("ball.x > 1 m", "free", False),
        ("gate.y < 1 m", "free", False),
        ("z < 5 m", "fixed", True),
        ("z < 5 m", "free", False),
        ("time < 4 s", "fixed", False),
        ("position(elbow) < 1", "fixed", False),
        ("clearance(trunk, wall) > 1 cm", "fixed", True),
        ("clearance(trunk, gate) > 1 cm", "fixed", False),
        ("clearance(tool, wall) > 1 cm", "fixed", False),
        ("clearance > 1 cm", "fixed", False),
        ("force(trunk, wall) < 5 N", "fixed", True),
        ("force(wall) < 5 N", "fixed", False),
    ],
)
def test_values_that_never_change(arms: Path, comparison: str, base: str, is_constant: bool) -> None:
    found = refused(arms, scenario(f"stl: 'always ({comparison})'", base=base) + WORLD)
    assert ["[fixed-base]" in problem.message for problem in found] == [True] * is_constant
    allowed = scenario(f"stl: 'always ({comparison})'", base=base) + WORLD + "allow: [fixed-base]\n"
    assert refused(arms, allowed) == []


def test_the_message_names_the_values_and_their_place(arms: Path) -> None:
    (problem,) = refused(arms, scenario("stl: 'always (tool.z > 2.2 m and trunk.z < trunk.x)'"))
    assert problem.message == (
        "expect.0.stl: a comparison checks nothing: 'trunk.z' and 'trunk.x' never change in this scenario; name links "
        "or objects that move relative to each other; at character 28, the arrow: always (tool.z > 2.2 m and "
        "-> trunk.z < trunk.x) [fixed-base]"
    )
    # A formula of the base alone needs no model.
    assert load(arms, scenario("stl: 'always (speed < 1 m/s)'", base="free")).warnings == ()


# The shoulder is at (1, 0.1, 2.5) in the world, and at (0.1, 0, 0.5) in the base; the tool is at most 0.5 m from it.
@pytest.mark.parametrize(
    ("comparison", "base", "found"),
    [
        (f"distance(tool, trunk) < {math.hypot(0.1, 0.5) + 0.501} m", "free", True),
        (f"distance(tool, trunk) < {math.hypot(0.1, 0.5) + 0.499} m", "free", False),
        (f"distance(tool, trunk) > {math.hypot(0.1, 0.5) - 0.501} m", "free", True),
        (f"distance(tool, trunk) > {math.hypot(0.1, 0.5) - 0.499} m", "free", False),
        ("distance(tool, cart) < 100 m", "free", False),
        ("tool.x < 1.501 m", "fixed", True),
        ("tool.x < 1.499 m", "fixed", False),
        ("tool.x < 1.501 m", "free", False),
        ("abs(tool.y - 0.1 m) < 0.501 m", "fixed", True),
        ("tool.z > 1.999 m", "fixed", True),
        ("tool.z > 2.001 m", "fixed", False),
        ("tool.speed > -1 m/s", "free", True),
        ("tool.speed < 101 m/s", "free", False),
        ("distance(tool, lower) > -1 m", "free", True),
    ],
)
def test_limits_beyond_the_reach_of_a_link(arms: Path, comparison: str, base: str, found: bool) -> None:
    problems = refused(arms, scenario(f"stl: 'always ({comparison})'", base=base))
    assert ["[unreachable-limit]" in problem.message for problem in problems] == [True] * found
    negated = scenario(f"stl: 'not always ({comparison})'", base=base)
    assert len(refused(arms, negated, "unreachable-limit")) == len(problems)


def test_bare_numbers_are_found_on_both_sides() -> None:
    numbers = bare_numbers(parse("always (tilt < 20 and -30 < pitch and yaw + 5 < 90 deg and x < 3 m)"))
    names = [(bare.number, [signal.name for signal in bare.signals]) for bare in numbers]
    assert names == [(20.0, ["tilt"]), (30.0, ["pitch"])]


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

"""Text to formulas."""

from __future__ import annotations

import math
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.temporal_logic import formula as stl
from sim_action.assertions.temporal_logic.formula import Formula, Interval
from sim_action.assertions.temporal_logic.parser import MAX_CHARACTERS, MAX_DEPTH, FormulaError, parse
from tests.assertions.temporal_logic.formulas import formulas
from tests.soak import examples

X, Y = stl.Signal("x"), stl.Signal("y")
A = stl.Comparison(X, "<", stl.Number(1.0))
B = stl.Comparison(Y, ">", stl.Number(2.0))
C = stl.Comparison(stl.Signal("speed"), "<=", stl.Number(0.5, "m/s"))


def below_one(name: str, source: Literal["frame", "sensor", "pair"], *names: str) -> stl.Comparison:
    return stl.Comparison(stl.Signal(name, source=source, names=names), "<", stl.Number(1.0))


def refusal(text: str) -> str:
    with pytest.raises(FormulaError) as raised:
        parse(text)
    return str(raised.value)


@pytest.mark.parametrize(
    ("text", "formula"),
    [
        ("x < 1", A),
        ("  x<1  ", A),
        ("speed <= 50 cm/s", C),
        ("not x < 1", stl.Not(A)),
        ("x < 1 and y > 2 and speed <= 0.5 m/s", stl.And((A, B, C))),
        ("x < 1 or y > 2 and speed <= 0.5 m/s", stl.Or((A, stl.And((B, C))))),
        ("(x < 1 or y > 2) and speed <= 0.5 m/s", stl.And((stl.Or((A, B)), C))),
        ("x < 1 implies y > 2 implies x < 1", stl.Implies(A, stl.Implies(B, A))),
        ("x < 1 and y > 2 implies x < 1", stl.Implies(stl.And((A, B)), A)),
        ("always x < 1", stl.Always(A)),
        ("always (x < 1 and y > 2)", stl.Always(stl.And((A, B)))),
        ("always (x < 1) and y > 2", stl.And((stl.Always(A), B))),
        ("y > 2 and always x < 1", stl.And((B, stl.Always(A)))),
        ("always eventually[1 s, 200 ms * 0] x < 1", None),
        ("eventually[500 ms, 2] x < 1", stl.Eventually(A, Interval(0.5, 2.0))),
        ("eventually [1 s, end] x < 1", stl.Eventually(A, Interval(1.0, math.inf))),
        ("always[0 s, end] x < 1", stl.Always(A)),
        ("x < 1 until y > 2", stl.Until(A, B)),
        ("x < 1 until[0 s, 3 s] (y > 2)", stl.Until(A, B, Interval(0.0, 3.0))),
        ("not not x < 1", stl.Not(stl.Not(A))),
        (
            "x + 1 < 2 * y - x",
            stl.Comparison(
                stl.Sum((X, stl.Number(1.0))), "<", stl.Sum((stl.Product((stl.Number(2.0), Y)), stl.Negative(X)))
            ),
        ),
        (
            "abs(x - 1) >= -y",
            stl.Comparison(stl.Absolute(stl.Sum((X, stl.Negative(stl.Number(1.0))))), ">=", stl.Negative(Y)),
        ),
        ("(x + y) * 2 < 1", stl.Comparison(stl.Product((stl.Sum((X, Y)), stl.Number(2.0))), "<", stl.Number(1.0))),
        (
            "position( arm/elbow-1 ) > 20 N m",
            stl.Comparison(stl.Signal("position", "arm/elbow-1"), ">", stl.Number(20.0, "N m")),
        ),
        ("time > 1 min", stl.Comparison(stl.Signal("time"), ">", stl.Number(60.0, "s"))),
        ("x<1e1", stl.Comparison(X, "<", stl.Number(10.0))),
        ("tool0.x < 1", below_one("x", "frame", "tool0")),
        ("'left-hand'.yaw < 1", below_one("yaw", "frame", "left-hand")),
        ('"it\'s".x < 1', below_one("x", "frame", "it's")),
        ("'it''s'.x < 1", below_one("x", "frame", "it's")),
        ("imu.angular_velocity_xyz.z < 1", below_one("angular_velocity_xyz", "sensor", "imu", "z")),
        ("bumper.touching < 1", below_one("touching", "sensor", "bumper")),
        ("distance(tool0, 'a, b') < 1", below_one("distance", "pair", "tool0", "a, b")),
        ("clearance < 1", below_one("clearance", "pair")),
        ("clearance(wall) < 1", below_one("clearance", "pair", "wall")),
        ("force( tip , the box ) < 1", below_one("force", "pair", "tip", "the box")),
        ("position('a (b)') < 1", stl.Comparison(stl.Signal("position", "a (b)"), "<", stl.Number(1.0))),
    ],
)
def test_what_texts_mean(text: str, formula: Formula | None) -> None:
    if formula is None:
        refusal(text)
    else:
        assert parse(text) == formula


@examples(100)
@given(formulas)
def test_what_is_printed_is_parsed_to_the_same_formula(formula: Formula) -> None:
    text = str(formula)
    found = parse(text)
    assert found == formula
    assert str(found) == text


WORDS = ("not", "and", "until", "always", "abs", "<=", "m/s", "end", "implies", "or")
pieces = st.sampled_from([*"()[],xy12s<>+-*'", *WORDS, "position(x)", "tool0.z", "distance(a, b)"])


@st.composite
def texts(draw: st.DrawFn) -> str:
    """Return anything, or the text of a formula in which one word may be missing, or another one."""
    kind = draw(st.sampled_from(("any", "formula", "formula", "edited")))
    if kind == "any":
        return draw(st.text(max_size=60) | st.lists(pieces).map(" ".join))
    words = str(draw(formulas)).split(" ")
    if kind == "edited":
        start = draw(st.integers(0, len(words) - 1))
        words[start : start + 1] = draw(st.lists(pieces, max_size=2))
    return " ".join(words)


@examples(100)
@given(texts())
def test_any_text_is_a_formula_or_refused(text: str) -> None:
    try:
        formula = parse(text)
    except FormulaError as error:
        assert 0 <= error.at <= len(text)  # noqa: PT017 - a text may as well be a formula
    else:
        assert parse(str(formula)) == formula


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a signal, a number or a formula, found the end of the formula; at character 1, the arrow: ->"),
        ("always (sped < 1)", "unknown signal 'sped'; did you mean 'speed'?"),
        ("tool0.zz < 1", "unknown signal 'zz' of 'tool0'; did you mean 'z'?"),
        ("tool0.q < 1", "'tool0' (of a link: pitch, roll, speed, tilt, turn_rate, x, y, yaw, z; of an object: pitch, "),
        ("tool0.q < 1", "yaw, z; of a sensor: angular_velocity_xyz, "),
        ("always (left-hand.z < 1)", "unknown signal 'left'; write such a name in quotes: 'left-hand'.z"),
        ("arm/hand.z < 1", "unknown signal 'arm'; write such a name in quotes: 'arm/hand'.z"),
        ("arm.hand.z < 1", "unknown signal 'hand.z' of 'arm'; write such a name in quotes: 'arm.hand'.z"),
        ("scan.ranges < 1", "the reading has several numbers; select one with scan.ranges.WHICH: min, max, mean"),
        ("scan.ranges.mid < 1", "the reading has no 'mid'; did you mean 'min'?"),
        ("bumper.force.x < 1", "the reading is a single number"),
        ("distance(a) < 1", "expected distance(NAME, NAME), found 1 names; at character 1"),
        ("distance < 1", "expected distance(NAME, NAME), found no names"),
        ("force() < 1", "expected force(OBJECT) or force(LINK, OBJECT), found no names"),
        ("clearance(a, b, c) < 1", "expected clearance or clearance(OBJECT) or clearance(LINK, OBJECT), found 3"),
        ("distance(a, 'b) < 1", "name"),
        ("distance('a' b, c) < 1", "expected names with commas between them; at character 10"),
        ("always (sped < 1)", "at character 9, the arrow: always (-> sped < 1)"),
        ("speed < 0.5 mps", "found 'mps'; it is not a unit (allowed: s, ms,"),
        ("(x < 1", "expected ')' to close the parenthesis, found the end of the formula"),
        ("x < 1)", "expected an operator or the end, found ')'"),
        ("always[3 s, 1 s] x < 1", "[3 s, 1 s] ends before it begins; swap the two?; at character 7"),
        ("always[1 m, 2 s] x < 1", "expected a relative time such as 2 s, found '1 m'"),
        ("always[-1 s, 2 s] x < 1", "expected a relative time such as 2 s"),
        ("always[1 s 2 s] x < 1", "expected ',' between the two times"),
        ("always[1 s, 2 s x < 1", "expected ']' after the two times"),
        ("x == 1", "bound the difference: abs(x - 1 m) < 1 cm"),
        ("x = 1", "compare with <, <=, > or >="),
        ("x / 2 < 1", "division is not supported"),
        ("0 < x < 1", "comparisons cannot be chained; join two with 'and'; at character 7"),
        ("1 < 2", "'1 < 2' is not a signal"),
        ("x", "'x' is not compared with anything; write, for example, x < 1"),
        ("(x < 1) < 2", "expected a signal or a number, found the formula 'x < 1'"),
        ("position < 1", "name the joint: position(NAME)"),
        ("position() < 1", "name the joint: position(NAME)"),
        ("x & y", "'&' has no meaning in a formula"),
        ("abs x < 1", "expected '(' after 'abs'"),
        # Other notations, and words that are nearly right.
        ("x < 1 && y > 2", "'&&' has no meaning in a formula; write 'and'; at character 7"),
        ("x < 1 & y > 2", "'&' has no meaning in a formula; write 'and'"),
        ("x < 1 || y > 2", "'||' has no meaning in a formula; write 'or'"),
        ("!(x < 1)", "'!' has no meaning in a formula; write 'not'"),
        ("x != 1", "bound the difference"),
        ("x < 1 -> y > 2", "'->' has no meaning in a formula; write 'implies'"),
        ("x < 1 => y > 2", "'=>' has no meaning in a formula; write 'implies'"),
        ("x ≤ 1", "'≤' has no meaning in a formula; write '<='"),
        ("alway (x < 1)", "unknown word 'alway'; did you mean 'always'?; at character 1"),
        ("Always (x < 1)", "unknown word 'Always'; did you mean 'always'?"),
        ("G (x < 1)", "unknown word 'G'; did you mean 'always'?"),
        ("F[0, 3 s] x < 1", "unknown word 'F'; did you mean 'eventually'?"),
        ("not evently (x < 1)", "did you mean 'eventually'?"),
        ("x < 1 untill y > 2", "expected an operator or the end, found 'untill'; did you mean 'until'?"),
        ("(x < 1 AND y > 2)", "found 'AND'; did you mean 'and'?"),
        ("x < y implys y > 2", "found 'implys'; did you mean 'implies'?"),
        ("x < 1e999", "a number that is too large"),
        # Read in two ways by people.
        ("always x < 1 and y > 2", "ambiguous without parentheses: write always (... and ...) or (always ...) and ..."),
        ("eventually[0, 1] x < 1 implies y > 2", "ambiguous without parentheses: write eventually"),
        ("not always x < 1 or y > 2", "ambiguous without parentheses: write always"),
        ("always eventually x < 1 and y > 2", "ambiguous without parentheses: write eventually"),
        ("always x < 1 until y > 2", "ambiguous without parentheses: write always"),
        ("x < 1 and x < 1 until y > 2", "put parentheses around 'until' next to 'and'"),
        ("x < 1 until y > 2 or x < 1", "put parentheses around 'until' next to 'or'"),
        ("x < 1 until y > 2 until x < 1", "put parentheses around 'until' next to 'until'"),
    ],
)
def test_what_is_refused_and_where(text: str, message: str) -> None:
    assert message in refusal(text)


def test_what_ends_with_its_parenthesis_needs_no_more() -> None:
    assert parse("always eventually (x < 1) and y > 2") == stl.And((stl.Always(stl.Eventually(A)), B))
    assert parse("not always (x < 1) or y > 2") == stl.Or((stl.Not(stl.Always(A)), B))
    assert parse("y > 2 and (x < 1 until y > 2)") == stl.And((B, stl.Until(A, B)))


@pytest.mark.parametrize(
    "text",
    [
        "(" * 900 + "x < 1" + ")" * 900,
        "not " * 400 + "x < 1",
        "x < " + "-" * 900 + "1",
        "x < 1 implies " * 100 + "x < 1",
    ],
)
def test_what_is_nested_too_deep_is_refused(text: str) -> None:
    assert f"more than {MAX_DEPTH} nested operators and parentheses" in refusal(text)


def test_as_much_as_is_read_is_read_and_what_is_too_long_is_refused_unread() -> None:
    assert f"at most {MAX_CHARACTERS} are allowed" in refusal("(" * 100_000)
    text = " and ".join(["x<1"] * 250)
    assert len(text) < MAX_CHARACTERS
    formula = parse(text)
    assert isinstance(formula, stl.And)
    assert len(formula.formulas) == 250


@pytest.mark.parametrize("piece", ["(", "1", "x", " ", "1e", "position(", "[", "x<", "not ", "((x)", "x<1 until ", "-"])
def test_a_text_of_one_piece_over_and_over_ends_soon(piece: str) -> None:
    """As long as may be: an exponential search for what it could mean would never come back."""
    refusal(piece * (MAX_CHARACTERS // len(piece)))

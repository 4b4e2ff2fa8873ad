"""Answers of programs: what they mean, and why they are none."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sim_action.commands.json_protocol import AnswerError, answer_of
from sim_action.core.geometry import Twist
from sim_action.state.command import JointTargets, commands_of, is_finite

MANY = '"{}":1'


@pytest.mark.parametrize(
    ("line", "command"),
    [
        (b"{}", None),
        (b"null", None),
        (b" {} \r", None),
        (b'{"twist": {"linear": 0.2}}', Twist.planar(0.2)),
        (b'{"twist": {"linear": 1, "angular": -2, "lateral": 3e-1}}', Twist.planar(1.0, -2.0, lateral=0.3)),
        (b'{"twist": {}}', Twist()),
        (b'{"position": {"a": 1}}', JointTargets(position={"a": 1.0})),
        (
            b'{"velocity": {"a": 1}, "effort": {"b": 2}, "max_effort": {"a": 3}}',
            JointTargets(velocity={"a": 1.0}, effort={"b": 2.0}, max_effort={"a": 3.0}),
        ),
        ('{"position": {"gelenk_für_öl": 1}}'.encode(), JointTargets(position={"gelenk_für_öl": 1.0})),
        (b'{"velocity": {}}', JointTargets()),
        (
            b'{"position": {"a": 1}, "twist": {"linear": 0.2}, "max_effort": {"a": 3}}',
            (Twist.planar(0.2), JointTargets(position={"a": 1.0}, max_effort={"a": 3.0})),
        ),
    ],
)
def test_what_an_answer_means(line: bytes, command: object) -> None:
    assert answer_of(line) == command


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (b"", "is not JSON: Expecting value (column 1)"),
        (b"hello", "is not JSON: Expecting value (column 1)"),
        (b"{} {}", "is not JSON: Extra data (column 4)"),
        (b"{'twist': 1}", "is not JSON: Expecting property name"),
        (b"\xff{}", "is not UTF-8 text"),
        (b"[" * 100_000, "is nested too deep"),
        (b"1.0", "it is 1.0; expected an object, such as {}"),
        (b"[1, 2]", "it is a list of 2; expected an object"),
        (b'"forward"', "it is 'forward'; expected an object"),
        (b"true", "it is true; expected an object"),
        (b'{"twits": {}}', "it has the unknown key 'twits'; did you mean 'twist'?"),
        (b'{"twist": {"liner": 1}}', "'twist' has the unknown key 'liner'; did you mean 'linear'?"),
        (
            b'{"twist": {}, "x": 1}',
            "it has the unknown key 'x' (allowed: effort, max_effort, position, twist, velocity)",
        ),
        (b'{"twist": {"linear": 1, "linear": 2}}', "has the key 'linear' twice"),
        (b'{"a": 1, "b": 1, "b": 1, "a": 1}', "has the key 'b' twice"),
        # As many keys as a line may have: to compare each with all others would take minutes.
        (
            f"{{{','.join(map(MANY.format, range(90_000)))},{MANY.format(89_999)}}}".encode(),
            "has the key '89999' twice",
        ),
        (b'{"twist": 1}', "'twist' is 1; expected an object of numbers by name"),
        (b'{"twist": null}', "'twist' is null; expected an object of numbers by name"),
        (b'{"position": [1, 2]}', "'position' is a list of 2; expected an object of numbers by name"),
        (b'{"position": {"a": "1"}}', "'position.a' is '1'; expected a number"),
        (b'{"position": {"a": true}}', "'position.a' is true; expected a number"),
        (b'{"position": {"a": null}}', "'position.a' is null; expected a number"),
        (b'{"position": {"a": {}}}', "'position.a' is an object; expected a number"),
        (b'{"twist": {"linear": NaN}}', "has NaN, which is no number that a motor can be given"),
        (b'{"twist": {"linear": -Infinity}}', "has -Infinity, which is no number"),
        (b'{"twist": {"linear": 1e999}}', "'twist.linear' is too large a number"),
        (b'{"twist": {"linear": 1' + b"0" * 400 + b"}}", "'twist.linear' is too large a number"),
        (b'{"twist": {"linear": 1' + b"0" * 5000 + b"}}", "cannot be read: "),
    ],
)
def test_why_an_answer_is_none(line: bytes, why: str) -> None:
    with pytest.raises(AnswerError) as raised:
        answer_of(line)
    assert why in str(raised.value)


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text() | st.sampled_from(["twist", "linear", "effort"]), inner),
)


@given(json_values.map(lambda value: json.dumps(value).encode()) | st.binary())
@example(b'{"twist": {"linear": 1e308}}')
def test_whatever_is_answered_is_a_command_or_an_error(line: bytes) -> None:
    try:
        answer = answer_of(line)
    except AnswerError:
        return
    assert all(is_finite(command) for command in commands_of(answer))


numbers = st.floats(allow_nan=False, allow_infinity=False)


@given(st.dictionaries(st.text(), numbers), st.dictionaries(st.text(), numbers))
def test_targets_come_through_as_they_are(position: dict[str, float], effort: dict[str, float]) -> None:
    line = json.dumps({"position": position, "effort": effort}).encode()
    assert answer_of(line) == JointTargets(position=position, effort=effort)


@given(numbers, numbers, numbers)
def test_twists_come_through_as_they_are(linear: float, angular: float, lateral: float) -> None:
    speeds: dict[str, Any] = {"linear": linear, "angular": angular, "lateral": lateral}
    command = answer_of(json.dumps({"twist": speeds}).encode())
    assert command == Twist.planar(linear, angular, lateral=lateral)
    assert isinstance(command, Twist)
    assert math.copysign(1, command.linear_xyz[0]) == math.copysign(1, linear)

"""What is held and what is not, on traces made by hand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sim_action.assertions.grasped import Grasped
from sim_action.core.geometry import Vector3
from sim_action.state.trace import Trace
from sim_action.state.trace_records import BodyRecord, ContactRecord, LinkTouch
from sim_action.state.verdict import Judged, Verdict
from tests.traces import START, scene, trace

LEFT, RIGHT, REAR = "wheel_left_link", "wheel_right_link", "caster_back_link"
STEP = 1 / 240


def pressing(forces: Mapping[str, Vector3], steps: int = 48, slide: float = 0.0, body: str = "cube") -> Trace:
    """The burger stands, and its links press the cube with these forces in N; the cube moves with `slide` m/s."""
    seen = trace([STEP * step for step in range(steps)])
    found = {}
    for link in (LEFT, RIGHT, REAR):
        x, y, z = forces.get(link, (0.0, 0.0, 0.0))
        size = math.sqrt(x * x + y * y + z * z)
        normal = (-x / size, -y / size, -z / size) if size else (0.0, 0.0, 1.0)
        touches = [(at, LinkTouch(link, body, (0.0, 0.0, 0.0), normal, size)) for at in seen.time.tolist() if size]
        found[link] = ContactRecord.of(touches)
    places = np.outer(seen.time, [0.0, 0.0, slide])
    cube = BodyRecord(seen.time, places, np.tile([0.0, 0.0, 0.0, 1.0], (steps, 1)))
    return replace(seen, objects={"cube": cube}, link_contacts=found)


def judged(seen: Trace, **keys: Any) -> Verdict:
    spec = Grasped.model_validate({"object": "cube", "by": (LEFT, RIGHT, REAR), **keys})
    return spec.monitor(scene(), START).observe(seen).verdict()


def at_angle(degrees: float, force: float = 5.0) -> Mapping[str, Vector3]:
    """Two forces with this angle between them."""
    turn = math.radians(degrees)
    return {LEFT: (force, 0.0, 0.0), RIGHT: (force * math.cos(turn), force * math.sin(turn), 0.0)}


@pytest.mark.parametrize(
    ("forces", "holds"),
    [
        (at_angle(180), True),
        (at_angle(121), True),
        (at_angle(119), False),
        (at_angle(0), False),
        ({LEFT: (5, 0, 0)}, False),
        ({}, False),
        # The lower finger carries the weight as well: up to three times the force of the upper one.
        ({LEFT: (0, 0, 2.99), RIGHT: (0, 0, -1)}, True),
        ({LEFT: (0, 0, 3.01), RIGHT: (0, 0, -1)}, False),
        # Three fingers around it.
        ({LEFT: (2, 0, 0), RIGHT: (-1, 3**0.5, 0), REAR: (-1, -(3**0.5), 0)}, True),
    ],
)
def test_opposed_forces_of_two_links_hold_it(forces: Mapping[str, Vector3], holds: bool) -> None:
    assert judged(pressing(forces)).passed is holds


def test_the_squeeze_is_the_force_of_each_finger() -> None:
    seen = pressing(at_angle(180, 5.0))
    assert judged(seen, at_least=4.999).measured == pytest.approx(5.0)
    assert judged(seen, at_least=4.999).passed
    weak = judged(seen, at_least=5.001)
    assert (weak.passed, weak.unit) == (False, "N")
    assert weak.message.startswith("held cube too weakly, with 5 N of 5.001 N")
    # By default, a tenth of the weight of 1 kg.
    assert judged(pressing(at_angle(180, 0.99))).passed
    assert not judged(pressing(at_angle(180, 0.97))).passed


@pytest.mark.parametrize(("slide", "holds"), [(0.0, True), (0.0499, True), (0.0501, False), (0.2, False)])
def test_what_slides_along_the_links_is_not_held(slide: float, holds: bool) -> None:
    verdict = judged(pressing(at_angle(180), slide=slide), **{"for": 0.1})
    assert verdict.passed is holds


@pytest.mark.parametrize(
    ("seen", "reason"),
    [
        (pressing({}), "no link touched it"),
        (pressing({LEFT: (1, 0, 0)}), f"only {LEFT} touched it"),
        (pressing(at_angle(0, 2.0)), f"{LEFT}, {RIGHT} pressed it from one side, 4 N of 4 N did not cancel"),
        (pressing(at_angle(180), body="wall"), "no link touched it"),
    ],
)
def test_a_failure_says_why(seen: Trace, reason: str) -> None:
    assert judged(seen).message == f"did not hold cube in 0.2 s: {reason}"


def test_the_time_of_the_grip() -> None:
    seen = pressing(at_angle(180), steps=25)
    assert judged(seen, **{"for": 24 * STEP - 1e-6}).passed
    short = judged(seen, **{"for": 0.2})
    assert (short.passed, short.unit) == (False, "s")
    assert short.measured == pytest.approx(0.1)


def test_forces_are_averaged_over_50_ms() -> None:
    seen = pressing(at_angle(180, 5.0))
    gaps = dict(seen.link_contacts)
    for number, link in enumerate((LEFT, RIGHT)):
        gaps[link] = gaps[link].rows(np.arange(len(gaps[link])) % 2 == number)
    assert judged(replace(seen, link_contacts=gaps), at_least=2.4).passed


def test_without_recorded_contacts_nothing_was_judged() -> None:
    verdict = judged(trace([0.1])).counted(Judged(1, 0.1, 0.1))
    assert verdict.status == "not_exercised"


@pytest.mark.parametrize(
    ("keys", "path", "problem"),
    [
        ({"object": "cub"}, ("object",), "the world has no body 'cub'; did you mean 'cube'?"),
        ({"object": "wall"}, ("object",), "'wall' has no mass, so the robot cannot hold it"),
        ({"by": (LEFT,)}, ("by",), f"only '{LEFT}' is named, and it takes two links"),
        ({"by": (LEFT, "finger")}, ("by", 1), "the robot has no link 'finger' with a collision shape"),
    ],
)
def test_what_does_not_fit_is_refused(keys: dict[str, Any], path: tuple[str, ...], problem: str) -> None:
    spec = Grasped.model_validate({"object": "cube", "by": (LEFT, RIGHT), **keys})
    ((found, message),) = spec.problems(scene())
    assert found == path
    assert problem in message


def test_its_curve_is_the_squeeze() -> None:
    spec = Grasped.model_validate({"object": "cube", "by": (LEFT, RIGHT), "at_least": 2, "for": 0.1})
    time, squeeze = spec.signals(scene(), START, pressing(at_angle(180)))
    assert (time.name, time.unit, time.lower) == ("time holding cube", "s", 0.1)
    assert (squeeze.name, squeeze.unit, squeeze.lower) == ("squeeze of cube", "N", 2.0)
    assert squeeze.values == pytest.approx([5.0] * 48)


def test_forces_that_are_not_equal_squeeze_with_the_smaller_one() -> None:
    """10 N against 6 N: 4 N push the object away, and the other 6 N hold it from both sides."""
    seen = pressing({LEFT: (10.0, 0.0, 0.0), RIGHT: (-6.0, 0.0, 0.0)})
    assert judged(seen, at_least=5.999).measured == pytest.approx(6.0)
    assert not judged(seen, at_least=6.001).passed

"""Bodies of the world: where they are, how they stand and how far they moved, on traces made by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.windows import Window
from sim_action.assertions.object import ObjectAssertion
from sim_action.core.geometry import quaternion_from_rpy
from sim_action.state.trace import Trace
from sim_action.state.trace_records import BodyRecord
from sim_action.state.verdict import Judged, Verdict
from sim_action.world import Body, PathPoint, Sphere, World
from sim_action.world.scene import Scene
from tests.traces import START, scene, trace


def spec(**keys: Any) -> ObjectAssertion:
    return ObjectAssertion.model_validate({"name": "ball", **keys})


def where(*, appears: float | None = None, acted_on: bool = False) -> Scene:
    """A ball with a mass, a wall, and a door on a path."""
    ball = Body(name="ball", sphere=Sphere(radius=0.1), mass=1.0, appears=appears)
    path = (PathPoint(at=0.0, y=0.0), PathPoint(at=1.0, y=1.0))
    door = Body(name="door", box=(0.1, 1.0, 1.0), path=path)
    bodies = (ball, Body(name="wall", box=(0.1, 2.0, 0.5)), door)
    return replace(scene(), world=World(objects=bodies), acted_on=acted_on)


def ball(places: Sequence[tuple[float, float, float]], roll: Sequence[float] | None = None, step: float = 0.1) -> Trace:
    """The burger at (1, 0, 0), heading along y, and the ball at these places at 0 s, 0.1 s, ..."""
    count = len(places)
    time = [step * number for number in range(count)]
    seen = trace(time, x=[1.0] * count, yaw=[math.pi / 2] * count)
    turned = np.array([quaternion_from_rpy(angle, 0.0, 0.0) for angle in roll or [0.0] * count])
    return replace(seen, objects={"ball": BodyRecord(seen.time, np.array(places, dtype=np.float64), turned)})


RISING = ball([(0, 0, 0.1), (0, 0, 0.15), (0, 0, 0.25), (0.5, 0, 0.125)])


def judged(asked: ObjectAssertion, seen: Trace, at: Scene | None = None) -> Verdict:
    return asked.monitor(at or where(), START).observe(seen).verdict()


@pytest.mark.parametrize(
    ("keys", "passes"),
    [
        ({"moved": {"up": 0.15}}, True),
        ({"moved": {"up": 0.151}}, False),
        ({"moved": {"at_least": 0.5}}, True),
        ({"moved": {"at_least": 0.501}}, False),
        ({"moved": {"at_most": 0.501}}, True),
        ({"moved": {"at_most": 0.5}}, False),
        ({"reach": {"x": 0, "y": 0, "z": 0.3, "tolerance": 0.051}}, True),
        ({"reach": {"x": 0, "y": 0, "z": 0.3, "tolerance": 0.049}}, False),
        ({"stay_within": {"x": (-0.1, 0.51), "z": (0.05, 0.26)}}, True),
        ({"stay_within": {"z": (0.05, 0.24)}}, False),
        ({"upright": None}, True),
    ],
)
def test_its_pose_is_judged_with_the_words_of_the_robot(keys: dict[str, Any], passes: bool) -> None:
    assert judged(spec(**keys), RISING).passed is passes


def test_messages_name_it() -> None:
    found = judged(spec(moved={"up": 0.2}), RISING)
    assert (found.passed, found.measured, found.limit, found.unit, found.time) == (False, 0.15, 0.2, "m", 0.2)
    assert (found.message, found.judged) == ("ball rose 0.15 m of 0.2 m in 0.3 s", Judged(4, 0, 0.30000000000000004))
    assert spec(moved={"up": 0.2}).title == "object moved of ball up by 0.2 m"
    assert spec(moved={"at_most": 0.2, "frame": "base"}).title == "object moved of ball in base at most 0.2 m"
    tilted = judged(spec(upright={"max_tilt": 0.1}), ball([(0, 0, 0)] * 2, roll=[0.0, 0.2]))
    assert tilted.message.startswith("ball tilted by 11.46 deg")


def test_a_frame_sees_it_from_a_link() -> None:
    # The base is at (1, 0) and heads along y: a ball at (1, 2) is 2 m ahead of it.
    ahead = {"x": 2, "y": 0, "tolerance": 1e-6, "frame": "base"}
    assert judged(spec(reach=ahead), ball([(0, 0, 0), (1, 2, 0)])).passed
    assert not judged(spec(reach=ahead), ball([(0, 0, 0), (2, 1, 0)])).passed
    still = ball([(1, 2, 0), (1, 2, 0)])
    moved = replace(still, state=np.where(still.state == 1.0, 1.0 + 3 * still.state[:, :1], still.state))
    assert judged(spec(moved={"at_most": 0.29, "frame": "base"}), moved).measured == pytest.approx(0.3)


def test_its_speed_is_its_way_from_step_to_step() -> None:
    # 0.5 m/s, then 0.005 m/s.
    places = [(0.05 * step, 0.0, 0.0) for step in range(4)] + [(0.15 + 0.0005 * step, 0.0, 0.0) for step in range(1, 5)]
    asked = {"for": 0.29, "speed": "1 cm/s"}
    assert judged(spec(settled=asked), ball(places)).passed
    assert not judged(spec(settled={**asked, "for": 0.31}), ball(places)).passed
    assert not judged(spec(settled={**asked, "speed": "4 mm/s"}), ball(places)).passed
    turning = ball([(0, 0, 0)] * 6, roll=[0.0, 0.1, 0.2, 0.2, 0.2, 0.2])
    assert judged(spec(settled={"for": 0.2}), turning).measured == pytest.approx(0.2)
    (_, speed, rate) = spec(settled=asked).signals(where(), START, turning)
    assert rate.values == pytest.approx([1.0, 1.0, 0, 0, 0], abs=1e-9)
    assert speed.values == pytest.approx([0.0] * 5)


def test_an_object_that_comes_to_rest_has_moved() -> None:
    still, asked = ball([(0, 0, 0)] * 9), spec(settled={"for": 0.3})
    driven = replace(still, state=still.state + np.linspace(0, 1, 9)[:, None] * (np.arange(still.state.shape[1]) == 1))
    opened = asked.opened(where(acted_on=True), START)
    assert not opened.observe(driven).verdict().passed
    rolling = ball([(0.1 * min(step, 4), 0, 0) for step in range(9)])
    assert asked.opened(where(acted_on=True), START).observe(rolling).verdict().passed


LATE = ball([(math.nan,) * 3, (math.nan,) * 3, (0, 0, 1.0), (0, 0, 0.5)], roll=[math.nan, math.nan, 0.0, 0.0])


def test_an_object_is_judged_while_it_is_there() -> None:
    at = where(appears=0.2)
    within = judged(spec(stay_within={"z": (0.4, 1.1)}), LATE, at)
    assert (within.passed, within.judged) == (True, Judged(2, 0.2, 0.30000000000000004))
    assert judged(spec(moved={"at_least": 0.5}), LATE, at).passed
    assert not judged(spec(moved={"at_least": 0.501}), LATE, at).passed


@pytest.mark.parametrize(
    "keys", [{"moved": {"at_most": 1}}, {"moved": {"at_least": 1}}, {"upright": {}}, {"settled": {}}]
)
def test_an_object_that_never_appeared_was_not_judged(keys: dict[str, Any]) -> None:
    seen, at = LATE.first(2), where(appears=0.2)
    verdict = judged(spec(**keys), seen, at).counted(Judged(2, 0.0, 0.1))
    assert verdict.status == "not_exercised"
    assert verdict.message == "ball never appeared: it is due at 0.2 s, but the run ended at 0.1 s"
    opened = spec(**keys).monitor(at, START)
    assert opened.state is (State.PENDING if spec(**keys).is_goal else State.HOLDS)
    assert Window(opened, 0.0, math.inf).observe(seen).needed_until == 0.2 + 1 / at.physics.rate


def test_without_recorded_poses_nothing_was_judged() -> None:
    verdict = judged(spec(upright={}), trace([0.1])).counted(Judged(1, 0.1, 0.1))
    assert (verdict.status, verdict.message) == ("not_exercised", "no pose of ball to measure")


def test_a_window_does_not_move_the_start() -> None:
    opened = Window(spec(moved={"at_least": 0.2}).monitor(where(), START), 0.2, math.inf)
    assert opened.observe(ball([(0, 0, 0), (0.1, 0, 0), (0.15, 0, 0), (0.2, 0, 0)])).verdict().passed
    rest = Window(spec(settled={"for": 0.1}).monitor(where(), START), 0.2, math.inf)
    verdict = rest.observe(ball([(0, 0, 0), (0.1, 0, 0), (0.2, 0, 0), (0.2, 0, 0), (0.2, 0, 0)])).verdict()
    assert verdict.measured == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("keys", "path", "problem"),
    [
        ({"name": "bal"}, ("name",), "the world has no body 'bal'; did you mean 'ball'?"),
        ({"name": "ground"}, ("name",), "the world has no body 'ground'"),
        ({"name": "wall"}, ("name",), "'wall' has no mass and no path, so it never moves"),
        ({"upright": {"link": "base_link"}}, ("upright", "link"), "an object is judged, not a link"),
        ({"upright": {"frame": "base_lin"}}, ("upright", "frame"), "there is no frame 'base_lin'"),
        ({"upright": None, "settled": {"joints": True}}, ("settled", "joints"), "an object has no joints"),
    ],
)
def test_what_does_not_fit_is_refused(keys: dict[str, Any], path: tuple[str, ...], problem: str) -> None:
    keys = {"upright": {}, **keys}
    asked = spec(**{key: value for key, value in keys.items() if value is not None})
    ((found, message),) = asked.problems(where())
    assert found == path
    assert problem in message


@pytest.mark.parametrize("name", ["ball", "door"])
def test_what_can_move_is_judged(name: str) -> None:
    assert list(spec(name=name, moved={"at_least": 1}).problems(where())) == []


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ({}, "give one of reach, stay_within, upright, settled, moved; none is given"),
        ({"upright": {}, "settled": {}}, "found upright and settled: begin a second 'object'"),
        ({"moved": {}}, "give 'at_least', 'at_most' or 'up'"),
        ({"moved": {"up": 1, "at_most": 2}}, "'up' stands alone"),
        ({"moved": {"at_least": 2, "at_most": 1}}, "swap the two"),
    ],
)
def test_it_has_one_kind(keys: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        spec(**keys)


def test_the_sign_of_a_quaternion_is_no_motion() -> None:
    turning = ball([(0, 0, 0)] * 6, roll=[0.3 + 0.01 * step for step in range(6)])
    record = turning.objects["ball"]
    signs = np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0])[:, None]
    flipped = replace(turning, objects={"ball": replace(record, orientation_xyzw=signs * record.orientation_xyzw)})
    (_, _, rate) = spec(settled={"for": 0.2}).signals(where(), START, flipped)
    assert rate.values == pytest.approx([0.1] * 5)

"""Robustness: against its definition, against rtamt, and what decides it; the signals that a formula reads."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.temporal_logic.formula import Comparison, Formula, Not, Signal, horizon
from sim_action.assertions.temporal_logic.parser import parse
from sim_action.assertions.temporal_logic.robustness import (
    Samples,
    SignalReader,
    cause,
    greatest_of_windows,
    least_of_windows,
    robustness,
    until,
)
from sim_action.assertions.temporal_logic.stl_assertion import Stl
from sim_action.core.geometry import Pose, compose, quaternion_from_rpy
from sim_action.core.lazy_numpy import FloatArray
from sim_action.robot.model.kinematics import link_poses
from sim_action.state.trace import Trace
from sim_action.state.trace_records import BodyRecord, Channels, ClearanceRecord, ClearanceWatch, Nearness, SensorRecord
from sim_action.state.verdict import Verdict
from tests.assertions.temporal_logic.formulas import X, Y, meaning, plain_formulas, samples_of, walks
from tests.soak import examples
from tests.traces import START, burger, contact, monitor, piece, scene, trace

# Values of rtamt 0.4.10, StlDiscreteTimeOfflineSpecification, for "out = " and the formula as rtamt writes it, with x
# and y as "float" at 0, 1, 2, ...: its default unit and period are a second.
RTAMT: dict[str, Any] = json.loads((Path(__file__).parent / "rtamt.json").read_text())


@examples(120)
@given(plain_formulas, walks)
def test_it_is_what_the_definition_says_at_every_moment(formula: Formula, walk: list[tuple[int, int]]) -> None:
    expected = [meaning(formula, walk, at) for at in range(len(walk))]
    assert robustness(formula, samples_of(walk)).tolist() == expected
    strong = [meaning(formula, walk, at, strong=True) for at in range(len(walk))]
    assert robustness(formula, samples_of(walk), strong=True).tolist() == strong
    assert all(pessimistic <= value for pessimistic, value in zip(strong, expected, strict=True))
    opposite = [meaning(formula, walk, at, contrary=True) for at in range(len(walk))]
    assert robustness(Not(formula), samples_of(walk)).tolist() == opposite


BEYOND_RTAMT = ("eventually (always[0 s, 3 s]", "((x > 0) until[1 s, 2 s] (y > 0)) until[0 s, 5 s] (always")
"""Goals whose witness needs a finite interval. rtamt cuts it at the last step, and finds a witness there."""


@pytest.mark.parametrize("case", RTAMT["cases"], ids=lambda case: str(case["formula"]))
def test_it_is_what_rtamt_says_at_every_moment(case: dict[str, Any]) -> None:
    seen = Samples((X, Y), np.column_stack([np.arange(len(RTAMT["x"]), dtype=np.float64), RTAMT["x"], RTAMT["y"]]))
    formula, expected = parse(case["formula"]), [float(value) for value in case["robustness"]]
    found = robustness(formula, seen).tolist()
    if not case["formula"].startswith(BEYOND_RTAMT):
        assert found == expected
        return
    assert found != expected
    assert all(value <= other for value, other in zip(found, expected, strict=True))
    whole = [at for at in range(len(found)) if at + horizon(formula) < len(found)]
    assert [found[at] for at in whole] == [expected[at] for at in whole]


@examples(80)
@given(plain_formulas, walks | walks.map(lambda walk: walk[:1]), st.booleans())
def test_the_comparison_that_decides_has_the_robustness_of_the_whole(
    formula: Formula, walk: list[tuple[int, int]], strong: bool
) -> None:
    whole = meaning(formula, walk, 0, strong=strong)
    found = cause(formula, samples_of(walk), strong=strong)
    if found is None:
        assert math.isinf(whole)
    else:
        assert found.margin == whole
        moment = walk[int(found.time)]
        assert found.left == moment[0 if found.comparison.left == X else 1]


def test_an_example_by_hand() -> None:
    """Speeds at 0, 1, 2, 3 s: the margin to 0.5 is least at 2 s."""
    seen = Samples((Signal("speed"),), np.array([(0, 0.1), (1, 0.4), (2, 0.7), (3, 0.2)], dtype=np.float64))
    assert robustness(parse("always speed < 0.5 m/s"), seen).tolist() == pytest.approx([-0.2, -0.2, -0.2, 0.3])
    goal = robustness(parse("eventually[1 s, 2 s] speed > 0.5 m/s"), seen).tolist()
    assert goal == pytest.approx([0.2, 0.2, -0.3, -math.inf])
    found = cause(parse("always speed < 0.5 m/s"), seen)
    assert found is not None
    assert (found.time, found.left, found.right) == (2.0, 0.7, 0.5)
    # Arithmetic.
    seen = Samples((X, Y), np.array([(0.0, 1.0, -2.0), (1.0, 3.0, 0.5)]))
    assert robustness(parse("2 * x - abs(y) - 1 < -(x + y) * 0.5"), seen).tolist() == pytest.approx([1.5, -6.25])


@given(st.integers(1, 500), st.integers(0, 40), st.integers(0, 40))
@examples(50)
def test_steps_of_240_hz_are_neither_lost_nor_doubled_by_rounding(steps: int, start: int, length: int) -> None:
    """Bounds that are whole steps apart take in the steps at both ends."""
    time = np.arange(1, steps + 1) / 240
    seen = Samples((Signal("time"),), np.column_stack([time, time]))
    last = robustness(parse(f"eventually[{start / 240!r} s, {(start + length) / 240!r} s] time > 0"), seen)
    for at, value in enumerate(last.tolist()):
        if at + start >= steps:
            assert value == -math.inf
        else:
            assert value == time[min(at + start + length, steps - 1)]


values = st.lists(st.integers(-5, 5).map(float), min_size=1, max_size=40)


@given(values, st.lists(st.tuples(st.integers(0, 40), st.integers(0, 40)), min_size=1))
def test_windows_of_any_length_anywhere(seen: list[float], ends: list[tuple[int, int]]) -> None:
    windows = [(min(a, b, len(seen)), min(max(a, b), len(seen))) for a, b in ends]
    first, last = (np.array(side, dtype=np.intp) for side in zip(*windows, strict=True))
    column = np.array(seen)
    least = [min(seen[a:b], default=math.inf) for a, b in windows]
    greatest = [max(seen[a:b], default=-math.inf) for a, b in windows]
    assert least_of_windows(column, first, last).tolist() == least
    assert greatest_of_windows(column, first, last).tolist() == greatest


@given(st.lists(st.tuples(st.integers(-5, 5), st.integers(-5, 5)), min_size=1, max_size=40))
def test_until_goes_backwards_one_by_one(pairs: list[tuple[int, int]]) -> None:
    before, then = (np.array(side, dtype=np.float64) for side in zip(*pairs, strict=True))
    expected, later = [], -math.inf
    for p, q in reversed(pairs):
        later = max(q, min(p, later))
        expected.append(later)
    assert until(before, then).tolist() == expected[::-1]
    # The arrays stay as they were.
    assert list(zip(before.tolist(), then.tolist(), strict=True)) == pairs


STEP = 1 / 240
TIMES = [step * STEP for step in range(5)]
SEEN = trace(TIMES, x=[0.0, 0.1, 0.2, 0.3, 0.4], z=[1.0] * 5, yaw=[0.5] * 5, speed=[2.0] * 5, position=[1.0] * 5)


def read(text: str, seen: Trace) -> list[float]:
    """Return the values of a signal at the steps at which it is known."""
    formula = parse(f"{text} < 1")
    assert isinstance(formula, Comparison)
    signal: Any = formula.left
    found: list[float] = SignalReader.of((signal,), scene(), START).read(seen).of_signal(signal).tolist()
    return found


def body(places: list[tuple[float, float, float]], appears: float = 0.0) -> BodyRecord:
    turns = np.tile(quaternion_from_rpy(0.1, 0.2, 0.3), (len(places), 1))
    return BodyRecord(np.array(TIMES), np.array(places), turns).within(appears)


def test_a_link_is_where_kinematics_says() -> None:
    base = Pose((0.4, 0.0, 1.0), quaternion_from_rpy(0, 0, 0.5))
    scan = compose(base, link_poses(burger(), {})["base_scan"]).position_xyz
    found = [read(f"base_scan.{axis}", SEEN)[-1] for axis in "xyz"]
    assert found == pytest.approx(scan)
    assert read("base_scan.yaw", SEEN) == pytest.approx([0.5] * 5)
    assert read("base_scan.tilt", SEEN) == pytest.approx([0.0] * 5)
    assert read("base_scan.speed", SEEN) == pytest.approx([2.0] * 5)
    assert read("base_scan.turn_rate", SEEN) == pytest.approx([0.0] * 5)
    wheel = compose(base, link_poses(burger(), {"wheel_left_joint": 1.0})["wheel_left_link"])
    x, y, z, w = wheel.orientation_xyzw
    assert math.sin(read("wheel_left_link.pitch", SEEN)[-1]) == pytest.approx(2 * (w * y - z * x))


def test_an_object_is_known_from_when_it_appears() -> None:
    places = [(1.0, 2.0, 3.0 + row) for row in range(5)]
    seen = replace(SEEN, objects={"ball": body(places, TIMES[2])})
    assert read("ball.z", seen) == [5.0, 6.0, 7.0]
    assert read("ball.roll", seen) == pytest.approx([0.1] * 3)
    assert read("distance(ball, base_footprint)", seen)[-1] == pytest.approx(math.dist((1, 2, 7), (0.4, 0, 1)))
    never = replace(SEEN, objects={"ball": body(places, math.inf)})
    verdict = monitor(Stl(formula="always (ball.z > 0 and base_scan.z > 0)")).observe(never).verdict()
    assert verdict.status == "not_exercised"
    assert verdict.message.startswith("never checked: ball.z, base_scan.z were never all known at a step")


def test_a_clearance_is_the_one_that_is_watched_and_a_force_the_mean_of_contacts_over_50_ms() -> None:
    watch = ClearanceWatch(("base_scan",), ("wall",), always=True)
    record = ClearanceRecord.of([Nearness(time, 0.5 + time, "base_scan", "wall") for time in TIMES[1:]])
    seen = replace(SEEN, clearances={watch: record})
    assert read("clearance(base_scan, wall)", seen) == pytest.approx([0.5 + time for time in TIMES[1:]])
    assert read("clearance", seen) == []
    touches = (contact(TIMES[1], force=12.0), contact(TIMES[1], force=24.0), contact(TIMES[3], link="base_scan"))
    seen = replace(SEEN, contacts=touches)
    assert read("force(base_footprint, wall)", seen) == pytest.approx([0, 3, 3, 3, 3])
    assert read("force(wall)", seen)[-1] == pytest.approx((36 + 12.5) / 12)
    assert read("force(ball)", seen) == [0] * 5


def scans(*ranges: float) -> SensorRecord:
    return SensorRecord("lidar", np.array(TIMES[:4:2]), {"ranges": np.array(ranges).reshape(2, -1)})


def test_a_reading_lasts_until_the_next_one_and_infinite_ranges_are_far() -> None:
    seen = replace(SEEN, sensors={"scan": scans(3.0, 1.0, math.inf, math.inf)})
    # That of a step counts from the next step on; only that of t = 0 also counts at t = 0.
    assert read("scan.ranges.min", seen) == [1.0, 1.0, 1.0, 1e9, 1e9]
    assert read("scan.ranges.max", seen)[0] == 3.0
    assert read("scan.ranges.min", SEEN) == []


def judged(text: str, seen: Trace) -> Verdict:
    return monitor(Stl(formula=text)).observe(seen).verdict()


@pytest.mark.parametrize(
    ("text", "limit"),
    [
        ("always (base_scan.z < {} m)", 1.182),
        ("always (distance(ball, base_footprint) < {} m)", math.dist((1, 2, 7), (0.4, 0, 1))),
        ("always (scan.ranges.max < {} m)", 4.0),
        ("always (force(wall) < {} N)", 3.0),
    ],
)
def test_a_bound_that_is_barely_kept_and_barely_broken(text: str, limit: float) -> None:
    places = [(1.0, 2.0, 3.0 + row) for row in range(5)]
    sensors, contacts = {"scan": scans(3.0, 1.0, 4.0, 2.0)}, (contact(TIMES[1], force=36.0),)
    seen = replace(SEEN, objects={"ball": body(places)}, sensors=sensors, contacts=contacts)
    for change, passed in ((1e-9, True), (-1e-9, False)):
        whole = judged(text.format(repr(limit + change)), seen)
        assert whole.passed is passed
        pieces = monitor(Stl(formula=text.format(repr(limit + change))))
        # The moment at t = 0 comes with the first steps.
        for first, last in ((0, 2), (2, 3), (3, 4), (4, 5)):
            pieces = pieces.observe(piece(seen, first, last))
        assert pieces.verdict() == whole


def test_a_formula_asks_for_the_channels_of_its_signals() -> None:
    text = (
        "box.z > 1 and distance(a, b) < 1 and scan.ranges.min < 1 and force(box) < 1 and clearance(tip, box) > 0 "
        "and clearance > 0 and x < 1"
    )
    watches = (ClearanceWatch(("tip",), ("box",), always=True), ClearanceWatch(always=True))
    assert Stl(formula=text).channels == Channels(
        contacts=True, clearances=frozenset(watches), sensors=frozenset({"scan"}), objects=frozenset({"box", "a", "b"})
    )
    assert Stl(formula="always (x < 1)").channels == Channels()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("always (base_scn.z < 1)", "there is no link or object 'base_scn'; did you mean 'base_scan'?"),
        ("always (base_scn.z < 1)", "at character 9, the arrow: always (-> base_scn.z < 1)"),
        ("distance(base_scan, bal) < 1", "there is no link or object 'bal'; did you mean 'ball'?"),
        ("ball.speed < 1", "the speed of an object is not recorded; bound its place, such as ball.z"),
        ("force(grund) < 1", "the world has no body 'grund'"),
        ("force(wal) < 1", "the world has no body 'wal'; did you mean 'wall'?"),
        ("clearance(tip, wall) < 1", "the robot has no link 'tip' with a collision shape"),
    ],
)
def test_unknown_names_have_their_place_and_the_nearest_names(text: str, message: str) -> None:
    found = [problem for _, problem in Stl(formula=text).problems(scene())]
    assert any(message in problem for problem in found), found


def test_a_name_of_a_link_and_an_object_is_refused() -> None:
    where = scene()
    namesake = where.world.objects[0].model_copy(update={"name": "base_scan"})
    both = replace(where, world=where.world.model_copy(update={"objects": (namesake,)}))
    ((_, message),) = Stl(formula="base_scan.z > 1").problems(both)
    assert message.startswith("'base_scan' is a link of the robot and an object; rename the object; at character 1")


def test_sensors_are_checked_with_their_kinds() -> None:
    kinds = {"scan": "lidar", "imu": "imu"}
    assert [*Stl(formula="scan.ranges.min > 1").sensor_problems(kinds)] == []
    ((_, unknown),) = Stl(formula="always scn.ranges.min > 1").sensor_problems(kinds)
    assert unknown.startswith("the scenario has no sensor 'scn'; did you mean 'scan'?")
    assert "at character 8" in unknown
    ((_, other),) = Stl(formula="imu.ranges.min > 1").sensor_problems(kinds)
    assert other.startswith("a reading of 'imu' has no column 'ranges'")


def test_a_curve_has_the_values_that_are_known() -> None:
    seen = replace(SEEN, objects={"ball": body([(0.0, 0.0, float(row)) for row in range(5)], TIMES[1])})
    curves = Stl(formula="always (ball.z < 9 m)").signals(scene(), START, seen)
    curve: FloatArray = curves[0].values
    assert (curves[0].name, curve.tolist()) == ("ball.z", [1.0, 2.0, 3.0, 4.0])

"""The number of feet on the ground, and the margin of the support polygon, on traces made by hand."""

from __future__ import annotations

import math
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions import Assertion
from sim_action.assertions.legs import FeetOnGround, Footing, SupportMargin, support_margins
from sim_action.assertions.monitors import State
from sim_action.core.errors import InvalidPart
from sim_action.core.geometry import Vector3
from sim_action.robot.model.robot_model import Link
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.state.trace import Trace
from sim_action.state.trace_records import ContactRecord, LinkTouch
from sim_action.state.verdict import Judged, Verdict
from sim_action.world import Body, Physics, World
from sim_action.world.scene import Scene
from tests.soak import examples
from tests.traces import START, judged, monitor, scene, trace

FEET = ("wheel_left_link", "wheel_right_link", "caster_back_link")
PLACES = ((0.0, 0.08, 0.0), (0.0, -0.08, 0.0), (-0.081, 0.0, 0.0))


def standing(*steps: tuple[int, ...], body: str = "ground") -> Trace:
    """The burger; at each step, the feet with these numbers are on the ground."""
    seen = trace([0.1 * (step + 1) for step in range(len(steps))])
    found: dict[str, list[tuple[float, LinkTouch]]] = {foot: [] for foot in FEET}
    for at, feet in zip(seen.time.tolist(), steps, strict=True):
        for number in feet:
            touch = LinkTouch(FEET[number], body, PLACES[number], (0.0, 0.0, 1.0), 1.0)
            found[FEET[number]].append((at, touch))
    return replace(seen, link_contacts={foot: ContactRecord.of(touches) for foot, touches in found.items()})


WALK = standing((0, 1, 2), (0, 2), (2,), (0, 1, 2))


def test_too_few_feet_break_it_and_are_named() -> None:
    verdict = monitor(FeetOnGround(links=FEET, at_least=2)).observe(WALK).verdict()
    message = "1 of 3 feet on the ground at 0.30 s, at least 2 wanted; in the air: wheel_left_link, wheel_right_link"
    assert verdict == Verdict(False, 1.0, 2.0, -1.0, "", WALK.time[2], message, judged=Judged(4, 0.1, 0.4))


def test_too_many_feet_break_it() -> None:
    found = judged(FeetOnGround(links=FEET, at_most=2), WALK)
    assert (found.passed, found.measured, found.limit, found.margin, found.time) == (False, 3.0, 2.0, -1.0, 0.1)
    assert found.message == "3 of 3 feet on the ground at 0.10 s, at most 2 wanted"
    # In the air, no foot is on the ground.
    assert judged(FeetOnGround(links=FEET, at_most=0), standing((), ())).passed
    assert not judged(FeetOnGround(links=FEET, at_least=1), standing((), ())).passed


@pytest.mark.parametrize(
    ("limits", "passes"),
    [
        ({"at_least": 1}, True),
        ({"at_least": 2}, False),
        ({"at_least": 1, "at_most": 2}, False),
        ({"at_most": 0}, False),
        ({}, False),
    ],
)
def test_both_limits_hold_at_every_step(limits: dict[str, int], *, passes: bool) -> None:
    assert judged(FeetOnGround.model_validate({"links": FEET, **limits}), WALK).passed is passes


def test_without_limits_all_feet_must_stand_and_at_least_cannot_exceed_at_most() -> None:
    assert judged(FeetOnGround(links=FEET), standing((0, 1, 2), (0, 1, 2))).passed
    assert judged(FeetOnGround(links=("wheel_*",)), standing((0, 1), (0, 1))).passed
    with pytest.raises(InvalidPart, match="swap the two"):
        FeetOnGround(links=FEET, at_least=3, at_most=2)


def test_feet_stand_on_what_on_names() -> None:
    seen = standing((0, 1, 2), body="ball")  # the ball has no mass, so it is fixed
    assert judged(FeetOnGround(links=FEET), seen).passed
    assert judged(FeetOnGround(links=FEET, on=("ball",)), seen).passed
    assert not judged(FeetOnGround(links=FEET, on=("ground", "wall")), seen).passed
    loose = replace(scene(), world=World(objects=(Body(name="ball", box=(1, 1, 1), mass=1.0),)))
    assert not monitor(FeetOnGround(links=FEET), where=loose).observe(seen).verdict().passed


@pytest.mark.parametrize("spec", [FeetOnGround(links=FEET, at_most=2), SupportMargin(links=FEET)])
def test_without_recorded_contacts_nothing_was_checked(spec: Assertion) -> None:
    verdict = monitor(spec).observe(trace([0.1, 0.2])).verdict().counted(Judged(2, 0.1, 0.2))
    assert verdict.status == "not_exercised"


def test_the_first_step_without_settling_has_a_hint() -> None:
    unsettled = replace(scene(), physics=Physics(settle=0.0))
    seen = standing((), (0, 1, 2))
    seen = replace(seen, state=seen.state - seen.state[0, 0] * (seen.state == seen.state[0, 0]))
    spec = FeetOnGround(links=FEET)
    assert "set 'after'" in monitor(spec, where=unsettled).observe(seen).verdict().message
    assert "set 'after'" not in monitor(spec).observe(seen).verdict().message


def test_the_margin_is_that_of_the_robots_centre_of_mass() -> None:
    # The centre of mass of the burger is between its wheels and its caster.
    spec = SupportMargin(links=FEET, at_least=0.001)
    whole = judged(spec, standing((0, 1, 2)))
    assert whole.passed
    assert whole.measured is not None
    assert 0.001 < whole.measured < 0.06
    two = judged(spec, standing((0, 1, 2), (0, 1)))
    assert not two.passed
    assert two.measured is not None
    assert two.measured < 0
    assert "on wheel_left_link, wheel_right_link at 0.20 s, less than" in two.message


def test_without_a_foot_on_the_ground_no_margin_holds() -> None:
    found = judged(SupportMargin(links=FEET, at_least=-100.0), standing((0, 1, 2), ()))
    assert found == Verdict(False, None, -100.0, None, "m", 0.2, "no foot was on the ground at 0.20 s")


@pytest.mark.parametrize(
    ("spec", "problem"),
    [
        (FeetOnGround(links=("wheel_*", "caster")), "no link 'caster' with a collision shape; did you mean 'caster_"),
        (FeetOnGround(links=FEET, at_least=4), "'links' matches only 3 of the robot's links; lower it, or add links"),
        (FeetOnGround(links=FEET, at_most=3), "'links' matches only 3 of the robot's links, so it cannot be exceeded"),
        (FeetOnGround(links=FEET, on=("wal",)), "the world has no body 'wal'; did you mean 'wall'?"),
    ],
)
def test_what_does_not_fit_is_refused(spec: Assertion, problem: str) -> None:
    ((_, message),) = spec.problems(scene())
    assert problem in message


@pytest.mark.parametrize("kind", [FeetOnGround, SupportMargin])
def test_robots_that_do_not_stand_are_refused(kind: type[Assertion]) -> None:
    spec = kind.model_validate({"links": FEET})

    def told(where: Scene) -> str:
        return next(iter(spec.problems(where)))[1]

    bolted = replace(scene(), robot=Robot(model="turtlebot3_burger", base="fixed"))
    floating = replace(scene(), world=World(gravity=0.0))
    rooted = replace(scene(), model=replace(scene().model, links=(Link("world", None), *scene().model.links)))
    assert "the base of the robot is fixed, so it does not stand on its feet; remove 'base: fixed'" in told(bolted)
    assert "its root link is 'world', which is fixed, so it does not stand on its feet" in told(rooted)
    assert "the world has no gravity" in told(floating)


@pytest.mark.parametrize(("axis", "stands"), [("0 0 1", True), ("0.1 0 -1", True), ("1 0 0", False)])
@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_a_robot_on_an_upright_rail_stands_on_its_feet(axis: str, stands: bool, kind: str, tmp_path: Path) -> None:
    shape = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    (tmp_path / "rail.urdf").write_text(
        f"""<robot name="rail"><link name="world"/><link name="torso">{shape}</link><link name="foot">{shape}</link>
        <joint name="rail" type="{kind}"><parent link="world"/><child link="torso"/><axis xyz="{axis}"/>
          <limit lower="-1" upper="1" effort="9" velocity="9"/></joint>
        <joint name="leg" type="fixed"><parent link="torso"/><child link="foot"/></joint></robot>""",
        encoding="utf-8",
    )
    railed = replace(scene(), model=read_urdf(tmp_path / "rail.urdf"), robot=Robot(model="rail.urdf"))
    assert (not list(FeetOnGround(links=("foot",)).problems(railed))) == (stands and kind == "prismatic")


def test_curves_show_both() -> None:
    (count,) = FeetOnGround(links=FEET, at_least=2).signals(scene(), START, WALK)
    assert (count.name, count.unit, count.lower, count.upper) == ("feet on the ground", "", 2.0, None)
    assert count.values.tolist() == [3.0, 2.0, 1.0, 3.0]
    (margin,) = SupportMargin(links=FEET, at_least=0.01).signals(scene(), START, standing((0, 1, 2), ()))
    assert (margin.name, margin.unit, margin.lower) == ("support margin", "m", 0.01)
    assert margin.values[0] > 0.01
    assert margin.values[1] != margin.values[1]
    assert monitor(FeetOnGround(links=FEET)).state is State.HOLDS


Point = tuple[float, float]
SQUARE: list[Point] = [(-1, -1), (1, -1), (1, 1), (-1, 1)]


def margin(centre: Point, points: list[Point]) -> float:
    moment = np.zeros(len(points), dtype=np.intp)
    return float(support_margins(np.array([centre]), moment, np.array(points, dtype=np.float64).reshape(-1, 2))[0])


@pytest.mark.parametrize(
    ("centre", "points", "expected"),
    [
        ((0, 0), SQUARE, 1.0),
        ((0.75, 0.5), SQUARE, 0.25),
        ((1, 0), SQUARE, 0.0),
        ((1.5, 0), SQUARE, -0.5),
        ((4, 5), SQUARE, -5.0),
        ((0, 0), [*SQUARE, (0, 0), (0.5, -0.5), (1, 1)], 1.0),
        ((0, 0), [(-1, 0), (1, 0)], 0.0),
        ((0, 2), [(-1, 0), (1, 0)], -2.0),
        ((4, 4), [(-1, 0), (1, 0)], -5.0),
        ((0, 2), [(-1, 0), (0.5, 0), (1, 0)], -2.0),
        ((3, 4), [(0, 0)], -5.0),
        ((3, 4), [(0, 0), (0, 0)], -5.0),
        ((0, 0), [(0, 0)], 0.0),
        ((0, 0), [], -math.inf),
    ],
)
def test_the_margin_is_the_distance_to_the_nearest_edge(centre: Point, points: list[Point], expected: float) -> None:
    assert margin(centre, points) == pytest.approx(expected, abs=1e-12)


def hull_of(points: list[Point]) -> list[Point]:
    """The corners of the convex hull, counterclockwise: both chains of Andrew's algorithm."""

    def chain(ordered: list[Point]) -> list[Point]:
        found: list[Point] = []
        for x, y in ordered:
            while len(found) >= 2 and cross(found[-2], found[-1], (x, y)) <= 0:
                found.pop()
            found.append((x, y))
        return found[:-1]

    ordered = sorted(set(points))
    return chain(ordered) + chain(ordered[::-1])


def cross(start: Point, end: Point, point: Point) -> float:
    return (end[0] - start[0]) * (point[1] - start[1]) - (end[1] - start[1]) * (point[0] - start[0])


def expected_margin(centre: Point, points: list[Point]) -> float:
    hull = hull_of(points)
    edges = list(zip(hull, [*hull[1:], hull[0]], strict=True))
    if all(cross(start, end, centre) >= 0 for start, end in edges):
        return min(cross(start, end, centre) / math.dist(start, end) for start, end in edges)
    return -min(to_segment(centre, start, end) for start, end in edges)


def to_segment(point: Point, start: Point, end: Point) -> float:
    (ax, ay), (bx, by), (px, py) = start, end, point
    share = ((px - ax) * (bx - ax) + (py - ay) * (by - ay)) / math.dist(start, end) ** 2
    share = min(1.0, max(0.0, share))
    return math.dist(point, (ax + share * (bx - ax), ay + share * (by - ay)))


@examples(60)
@given(st.integers(3, 12), st.integers(0, 2**32 - 1))
def test_it_is_that_of_an_independent_hull(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = [(float(x), float(y)) for x, y in rng.normal(size=(count, 2))]
    x, y = (rng.normal(size=2) * rng.choice([0.3, 2.0])).tolist()
    assert margin((x, y), points) == pytest.approx(expected_margin((x, y), points), abs=1e-9)


def test_moments_have_their_own_polygons() -> None:
    moment = np.array([0, 0, 0, 0, 2, 3, 3, 3, 3], dtype=np.intp)
    points = np.array([*SQUARE, (0, 0), *((x + 1, y) for x, y in SQUARE)], dtype=np.float64)
    centres = np.array([(0, 0), (0, 0), (0, 3), (0, 0)], dtype=np.float64)
    assert support_margins(centres, moment, points).tolist() == pytest.approx([1.0, -math.inf, -3.0, 0.0])


def test_soles_with_many_corners_take_little_memory() -> None:
    """One moment of 16 meshes as feet, each with 16 corners: all triples would take 400 MB."""
    turns = np.arange(256) * (math.tau / 256)
    points = np.column_stack([np.cos(turns), np.sin(turns)])
    tracemalloc.start()
    try:
        (least,) = support_margins(np.zeros((1, 2)), np.zeros(256, dtype=np.intp), points)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert least == pytest.approx(math.cos(math.pi / 256))
    assert peak < 50e6


def footing(*bodies: str, up: Vector3 = (0.0, 0.0, 1.0)) -> Footing:
    return Footing(("left", "right"), frozenset(bodies), up)


def touching(*found: tuple[float, str, Vector3]) -> ContactRecord:
    return ContactRecord.of([(at, LinkTouch("", body, (at, 0.0, 0.0), normal, 1.0)) for at, body, normal in found])


def test_a_foot_stands_on_what_carries_it() -> None:
    steep, flat = (math.sin(1.05), 0.0, math.cos(1.05)), (math.sin(1.04), 0.0, math.cos(1.04))
    up = (0.0, 0.0, 1.0)
    left = touching((0.1, "ground", up), (0.2, "wall", (1, 0, 0)), (0.3, "ramp", flat), (0.4, "ramp", steep))
    feet = {"left": left, "right": touching((0.2, "box", up), (0.2, "ground", up), (0.3, "box", up))}
    seen = replace(trace([0.1, 0.2, 0.3, 0.4]), link_contacts=feet)
    standing = footing("ground", "wall", "ramp").standing(seen)
    assert standing.tolist() == [[True, False, True, False], [False, True, False, False]]
    assert footing("box").standing(seen).tolist() == [[False] * 4, [False, True, True, False]]
    moment, points = footing("ground").points(replace(scene().model, links=(Link("left", 1), Link("right", 1))), seen)
    assert (moment.tolist(), points[:, 0].tolist()) == ([0, 1], [0.1, 0.2])
    assert footing().is_known(seen)
    assert not footing().is_known(replace(seen, link_contacts={"left": feet["left"]}))


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, 1.0, 0.0), (0.36, 0.48, 0.8)])
def test_points_are_seen_along_gravity(up: Vector3) -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(20, 3))
    level = footing(up=up).level(points)
    along = points @ np.array(up)
    assert np.hypot(*level.T) == pytest.approx(np.sqrt((points**2).sum(axis=1) - along**2))
    assert footing(up=up).level(points + np.array(up)) == pytest.approx(level)


@pytest.mark.parametrize("points", [[(0, 0), (1, 0)], [(0, 0), (0.4, 0), (1, 0)], [(1, 0), (0, 0), (0.3, 0), (0.6, 0)]])
@pytest.mark.parametrize(("centre", "expected"), [((5, 0), -4.0), ((-2, 0), -2.0), ((0.7, 0), 0.0), ((1, 0), 0.0)])
def test_a_point_on_the_line_of_all_feet_is_outside_beyond_them(
    points: list[tuple[float, float]], centre: tuple[float, float], expected: float
) -> None:
    moment = np.zeros(len(points), dtype=np.intp)
    for turn in (0.0, 0.3):
        cos, sin = np.cos(turn), np.sin(turn)
        turned = np.array([[cos, sin], [-sin, cos]])
        found = support_margins(np.array([centre]) @ turned, moment, np.array(points, dtype=np.float64) @ turned)
        assert found.tolist() == pytest.approx([expected], abs=1e-9)

"""The invariant of the whole design: a monitor that sees a trace in pieces says what it says of the whole."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.assertions.clearance import Clearance
from sim_action.assertions.combined import AllOf, AnyOf, AtOnce, Negation
from sim_action.assertions.contact import Touch
from sim_action.assertions.distance import PathLength, Travel
from sim_action.assertions.effort import Effort, Energy
from sim_action.assertions.follow_path import FollowPath, PathEnd, PathPoint
from sim_action.assertions.grasped import Grasped
from sim_action.assertions.joint import JointReading, JointWithin
from sim_action.assertions.legs import FeetOnGround, SupportMargin
from sim_action.assertions.max_speed import MaxSpeed
from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.windows import Window
from sim_action.assertions.no_collision import NoCollision, SelfCollision
from sim_action.assertions.object import Moved, ObjectAssertion
from sim_action.assertions.odometry_error import OdometryError
from sim_action.assertions.reach import FinalPose, Reach, TargetOrientation
from sim_action.assertions.sensor import SensorReading
from sim_action.assertions.settled import Settled, StopsBefore
from sim_action.assertions.stay_within import StayWithin
from sim_action.assertions.temporal_logic.stl_assertion import Stl
from sim_action.assertions.upright import Upright
from sim_action.core.lazy_numpy import FloatArray
from sim_action.state.observation import Contact, JointState, SelfContact
from sim_action.state.trace import Trace
from sim_action.state.trace_records import (
    BodyRecord,
    Channels,
    ClearanceRecord,
    ClearanceWatch,
    ContactRecord,
    LinkTouch,
    Nearness,
    SensorRecord,
)
from tests.assertions.limits import further_specs
from tests.soak import examples
from tests.traces import START, WHEELS, contact, monitor, piece, scene

STEPS = 60
RATE = 240
EIGHT = tuple(PathPoint(x=x, y=y) for x, y in [(0, 0), (0.3, 0.3), (0.6, 0), (0.3, -0.3), (0, 0.1)])
FEET = ("wheel_left_link", "wheel_right_link", "caster_back_link")
RISING = tuple(PathPoint(x=x, y=x / 2, z=x / 3) for x in (0.0, 0.3, 0.6))
SCAN, WHEEL = "base_scan", "wheel_left_link"
READING = SensorReading(name="scan", reading="ranges", which="mean", at_most=0.5, once=True)

SPECS: list[Assertion] = [
    Travel(at_least=0.5),
    Travel(at_least=0.25, at_most=0.75),
    Travel(at_most=0.5),
    PathLength(at_least=2.0),
    PathLength(at_least=1.0, at_most=3.0),
    PathLength(at_most=2.0),
    Reach(x=0.3, y=0.3, tolerance=0.2),
    Reach(x=0.0, y=0.3, z=0.1, tolerance=0.3),
    Reach(x=0.0, y=0.3, yaw=1.0, tolerance=0.5, yaw_tolerance=0.5),
    Settled(),
    Settled.model_validate({"for": 0.01, "speed": 2.0, "turn_rate": 2.0}),
    Settled.model_validate({"for": 0.01, "speed": 3.0, "turn_rate": 3.0, "joints": True}),
    FinalPose(x=0.3, y=0.3, tolerance=0.5),
    FinalPose(z=0.1, yaw=0.5, yaw_tolerance=1.0),
    NoCollision(),
    NoCollision(allow=("wall", "base_scan")),
    SelfCollision(),
    SelfCollision(allow=(("base_*", "wheel_left_link"),)),
    Touch.model_validate({"with": "ball"}),
    Touch.model_validate({"with": "wall", "link": "base_*", "at_least": 2.0, "at_most": 12.0}),
    Touch.model_validate({"with": "wall", "impulse": {"at_most": 0.3}, "window": 0.021}),
    Touch.model_validate({"with": "ball", "impulse": {"at_least": 0.1}, "at_most": 18.0, "window": 0.01}),
    Touch.model_validate({"with": "wall", "link": "base_scan", "for": 0.008, "at_most": 6.0}),
    Touch.model_validate({"with": "wall", "for": 0.004}),
    Touch.model_validate({"with": "wall", "for": 0.02, "at_least": 3.0}),
    StopsBefore.model_validate({"body": "wall", "gap": (0.1, 0.4), "speed": 2.0, "turn_rate": 3.0, "for": 0.01}),
    StopsBefore.model_validate({"body": "ball", "gap": (0.2, 0.3), "speed": 2.0, "turn_rate": 3.0, "for": 0.02}),
    Upright(max_tilt=0.6),
    MaxSpeed(linear=2.0),
    MaxSpeed(linear=2.0, angular=2.0),
    StayWithin(x=(-0.5, 0.5), y=(-0.4, 0.4)),
    StayWithin(z=(-0.3, 0.5)),
    Reach(link=SCAN, frame=WHEEL, x=0.0, y=-0.08, z=0.15, tolerance=0.06, orientation=TargetOrientation(tolerance=2.0)),
    FinalPose(link=SCAN, x=0.3, relative=True, orientation=TargetOrientation(tolerance=1.5)),
    MaxSpeed(link=SCAN, frame=WHEEL, linear=0.3),
    PathLength(link=WHEEL, at_least=1.0, at_most=3.0),
    Settled.model_validate({"for": 0.01, "speed": 2.0, "turn_rate": 2.0, "link": SCAN}),
    FollowPath(path=EIGHT, max_error=0.3, rms=0.1),
    FollowPath(path=EIGHT, max_error=0.5, end=PathEnd(tolerance=0.3)),
    FollowPath(link=SCAN, path=RISING, max_error=0.5, end=PathEnd(tolerance=0.3)),
    FollowPath(path=EIGHT[:2], smooth=True, rms=0.1, end=PathEnd(tolerance=0.2)),
    SensorReading(name="scan", reading="ranges", which="min", at_least=0.02),
    SensorReading(name="scan", reading="ranges", which="mean", at_most=0.3, once=True),
    OdometryError(position=1.0),
    OdometryError(position=2.0, yaw=3.0, drift=1.5),
    Clearance(at_least=0.3),
    Clearance(at_most=0.2),
    Clearance(at_least=0.05, at_most=0.4),
    JointReading(name=WHEELS[0], at_least=0.5),
    JointReading(name=WHEELS[1], reading="velocity", at_most=2.0, at_least=1.0),
    JointReading(name=WHEELS[0], reading="effort", near=1.0, tolerance=0.1),
    JointWithin(position={WHEELS[0]: (-0.5, 0.5)}, velocity={"*": (-2.0, 2.0)}),
    Effort(at_most=2.0),
    Effort(joints=(WHEELS[1],), at_most=4.0, rms_at_most=1.0),
    Effort(rms_at_most=1.0),
    Energy(at_most=0.05),
    Energy(at_most=0.05, braking="costs", joints=(WHEELS[1],)),
    Energy(at_most=0.01, braking="regained"),
    FeetOnGround(links=("wheel_*", "caster_back_link"), at_least=2),
    FeetOnGround(links=("wheel_*",), at_most=1, on=("ground", "wall")),
    SupportMargin(links=FEET, at_least=-0.2),
    ObjectAssertion(name="cube", reach=Reach(x=0.3, y=0.3, tolerance=0.4, frame="base_scan")),
    ObjectAssertion(name="cube", stay_within=StayWithin(z=(-1.0, 1.0))),
    ObjectAssertion(name="cube", upright=Upright(max_tilt=1.5)),
    ObjectAssertion(name="cube", settled=Settled.model_validate({"for": 0.02, "speed": 40.0, "turn_rate": 200.0})),
    ObjectAssertion(name="cube", moved=Moved(up=0.3)),
    Grasped(object="ball", by=("wheel_*",), slip=100.0),
    Grasped.model_validate({"object": "ball", "by": FEET, "slip": 100.0, "at_least": 0.1, "for": 0.02}),
    ObjectAssertion(name="cube", moved=Moved(at_least=0.4, at_most=1.0)),
    Stl(formula="always (speed < 2 implies eventually[0 s, 50 ms] (travel > 30 cm))"),
    Stl(formula="(tilt < 1 until[20 ms, 100 ms] x > 0.2) or always (eventually (y > 0.4))"),
    Stl(formula="always (base_scan.z > 0.1 implies eventually[0 s, 50 ms] (distance(base_scan, ball) > 20 cm))"),
    Stl(formula="eventually[50 ms, 200 ms] (scan.ranges.min < 5 cm and force(wall) > 2 N)"),
    Stl(formula="always (clearance(wall) > 10 cm or force(base_scan, ball) < 3 N or wheel_left_link.z < 1)"),
    AnyOf(parts=(Reach(x=0.3, y=0.3, tolerance=0.2), NoCollision())),
    AnyOf(parts=(Travel(at_least=0.5), Travel(at_most=0.25))),
    AnyOf(parts=(READING, Reach(x=0.3, y=0.3, tolerance=0.1))),
    AllOf(parts=(PathLength(at_least=1.0, at_most=3.0), MaxSpeed(linear=2.0))),
    AllOf(parts=(READING, FinalPose(x=0.3, y=0.3, tolerance=0.5))),
    Negation(part=AllOf(parts=(Travel(at_least=0.25, at_most=0.75), NoCollision()))),
    AtOnce(parts=(Reach(x=0.3, y=0.3, tolerance=0.4), MaxSpeed(linear=2.0))),
    AtOnce(
        parts=(
            SensorReading(name="scan", reading="ranges", which="min", at_least=0.1),
            Clearance(at_least=0.3, at_most=0.5),
            PathLength(at_least=1.0),
        )
    ),
    AtOnce(parts=(Negation(part=NoCollision()), AnyOf(parts=(Upright(max_tilt=0.6), Travel(at_least=0.5))))),
    AtOnce(
        parts=(
            Reach(link=SCAN, frame=WHEEL, x=0.0, y=-0.08, tolerance=0.06),
            Negation(part=Upright(link=SCAN, frame=WHEEL, max_tilt=0.3)),
        )
    ),
    Negation(part=NoCollision()),
    Negation(part=Reach(x=0.3, y=0.3, tolerance=0.2)),
]
SPECS += further_specs(SPECS)

LINKS = ["wheel_left_link", "wheel_right_link"]
MOVABLE = replace(START, joints=dict.fromkeys(WHEELS, JointState(0.0, 0.0, 0.0)))
WATCHES = sorted(Channels.all_of(spec.channels for spec in SPECS).clearances, key=repr)


# The property tests ask all assertions about the same traces.
@lru_cache(maxsize=32)
def random_trace(seed: int, steps: int = STEPS) -> Trace:
    """A random walk, turning and swaying, with a contact now and then, or most of the time."""
    rng = np.random.default_rng(seed)
    time = np.arange(1, steps + 1) / RATE
    turn = rng.normal(size=(steps, 4)) + np.array((0.0, 0.0, 0.0, 3.0))
    density = rng.choice([0.02, 0.6])
    touches: list[Contact] = []
    for at in time.tolist():
        if rng.random() < density:
            body, link = (str(rng.choice(names)) for names in (["wall", "ball"], ["base_scan", "base_footprint"]))
            touches.append(contact(at, body, link, float(rng.uniform(10.0, 20.0))))
    seen = Trace.of_columns(
        joint_names=WHEELS,
        time=time,
        base_position_xyz=np.cumsum(rng.normal(scale=0.05, size=(steps, 3)), axis=0),
        base_orientation_xyzw=turn / np.linalg.norm(turn, axis=1)[:, None],
        base_linear_xyz=rng.normal(size=(steps, 3)),
        base_angular_xyz=rng.normal(size=(steps, 3)),
        joint_position=np.cumsum(rng.normal(scale=0.1, size=(steps, 2)), axis=0),
        joint_velocity=rng.normal(size=(steps, 2)),
        joint_effort=rng.normal(size=(steps, 2)),
        contacts=tuple(touches),
    )
    sensors = {"scan": random_scans(rng, time - 1 / RATE), "odometry": random_odometry(rng, time - 1 / RATE)}
    clearances = {watch: random_clearances(rng, watch, time) for watch in WATCHES}
    objects = {name: random_poses(rng, time) for name in ("wall", "ball", "cube")}
    feet = {foot: random_steps(rng, foot, time) for foot in FEET}
    touching = [float(at) for at in time if rng.random() < density]
    own = tuple(SelfContact(at, "base_footprint", str(rng.choice(LINKS)), (0.0, 0.0, 0.1), 1.0) for at in touching)
    seen = replace(seen, link_contacts=feet, self_contacts=own)
    return replace(seen, clearances=clearances, sensors=sensors, objects=objects)


def random_steps(rng: np.random.Generator, foot: str, time: FloatArray) -> ContactRecord:
    """On the ground most of the time, and at a wall or on the ball now and then."""
    stands = rng.random(len(time)) < rng.choice([0.9, 1.0], len(time))
    ground = [(at, "ground", (0.0, 0.0, 1.0)) for at in time[stands].tolist()]
    bodies, sides = (rng.choice(these, len(time[::7])).tolist() for these in (["wall", "ball"], [-1.0, 1.0]))
    others = [(at, body, (side, 0.0, 0.0)) for at, body, side in zip(time[::7].tolist(), bodies, sides, strict=True)]
    touches = sorted([*ground, *others])
    places, forces = rng.normal(size=(len(touches), 3)).tolist(), rng.uniform(1.0, 9.0, len(touches)).tolist()
    points = zip(touches, places, forces, strict=True)
    found = [(at, LinkTouch(foot, body, tuple(place), normal, force)) for (at, body, normal), place, force in points]
    return ContactRecord.of(found)


def random_poses(rng: np.random.Generator, time: FloatArray) -> BodyRecord:
    """Poses of a body that appears after some steps."""
    places = np.cumsum(rng.normal(scale=0.1, size=(len(time), 3)), axis=0)
    turns = np.tile((0.0, 0.0, 0.0, 1.0), (len(time), 1))
    return BodyRecord(time, places, turns).within(float(time[rng.integers(0, 5)]))


def random_scans(rng: np.random.Generator, time: FloatArray) -> SensorRecord:
    """At every third step."""
    return SensorRecord("lidar", time[::3], {"ranges": rng.uniform(size=(len(time[::3]), 4))})


def random_odometry(rng: np.random.Generator, time: FloatArray) -> SensorRecord:
    """At every other step."""
    count = len(time[::2])
    turn = rng.normal(size=(count, 4))
    columns = {"position_xyz": rng.normal(scale=0.2, size=(count, 3)), "orientation_xyzw": turn / np.linalg.norm(turn)}
    return SensorRecord("odometry", time[::2], columns)


def random_clearances(rng: np.random.Generator, watch: ClearanceWatch, time: FloatArray) -> ClearanceRecord:
    """A random walk of a distance, told as the watch wants it: always, or where it is less than ever before."""
    count = len(time)
    links, bodies = (rng.choice(names, count).tolist() for names in (["base_scan", "base_footprint"], ["wall", "ball"]))
    distances = (np.cumsum(rng.normal(scale=0.05, size=count)) + 0.4).tolist()
    found: list[Nearness] = []
    for at, distance, link, body in zip(time.tolist(), distances, links, bodies, strict=True):
        if distance <= watch.within and (watch.always or not found or distance < found[-1].distance):
            found.append(Nearness(at, distance, link, body))
    return ClearanceRecord.of(found)


cuts = st.lists(st.integers(0, STEPS), max_size=12)
seeds = st.integers(0, 2**32 - 1)
spans = st.sampled_from([None, 0.01, 0.1])
moments = st.integers(0, STEPS + 5).map(lambda step: step / RATE)


def in_pieces(opened: Monitor, seen: Trace, at: list[int]) -> Monitor:
    for start, end in pairwise(sorted([0, *at, len(seen)])):  # equal neighbours make empty blocks
        opened = opened.observe(piece(seen, start, end))
    return opened


def assert_the_same_of_pieces(opened: Monitor, seen: Trace, at: list[int]) -> None:
    whole, pieces = opened.observe(seen), in_pieces(opened, seen, at)
    assert pieces.state is whole.state
    assert pieces.verdict() == whole.verdict()


def test_every_assertion_is_among_those_that_are_cut() -> None:
    assert {spec.key for spec in SPECS} == set(ASSERTIONS) - {"assertion", "matches"}


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: f"{spec.title}")
@examples(6)
@given(seed=seeds, at=cuts)
@example(seed=1, at=list(range(STEPS)))
def test_a_monitor_says_the_same_of_the_pieces_as_of_the_whole(spec: Assertion, seed: int, at: list[int]) -> None:
    assert_the_same_of_pieces(monitor(spec), random_trace(seed), at)


@examples(100)
@given(st.sampled_from(SPECS), seeds, cuts, moments, moments | st.just(math.inf))
@example(OdometryError(position=1.0), 243353463, [48], 0.0, math.inf)
def test_windows_do_not_change_that(spec: Assertion, seed: int, at: list[int], after: float, before: float) -> None:
    assert_the_same_of_pieces(Window(monitor(spec), after, before), random_trace(seed), at)


GOALS = [spec for spec in SPECS if spec.is_goal and spec.has_truth]


@examples(200)
@given(st.sampled_from(GOALS), spans, st.booleans(), seeds, cuts, moments, moments | st.just(math.inf))
def test_a_goal_that_must_become_true_says_the_same_of_pieces(  # noqa: PLR0917 - drawn by name
    spec: Assertion, span: float | None, acted_on: bool, seed: int, at: list[int], after: float, before: float
) -> None:
    span = None if spec.hold_time else span
    opened = Window(spec.opened(replace(scene(), acted_on=acted_on), MOVABLE, span), after, before)
    assert_the_same_of_pieces(opened, random_trace(seed), at)


@pytest.mark.parametrize("at", [range(STEPS), range(0, STEPS, 7)])
def test_a_reading_counts_until_the_next_one_across_blocks(at: Sequence[int]) -> None:
    either = AnyOf(parts=(READING, Reach(x=9.0, y=9.0)))
    seen, opened = random_trace(1), either.opened(scene(), MOVABLE, 0.05)
    assert opened.observe(seen).verdict().measured == pytest.approx(0.05)
    assert in_pieces(opened, seen, list(at)).verdict() == opened.observe(seen).verdict()


@examples(20)
@given(st.sampled_from(SPECS), seeds)
def test_observing_leaves_the_earlier_monitor_as_it_was(spec: Assertion, seed: int) -> None:
    opened = monitor(spec)
    before = opened.state, opened.verdict()
    opened.observe(random_trace(seed))
    assert (opened.state, opened.verdict()) == before


def rank(state: State) -> int:
    return [State.PENDING, State.HOLDS, State.BROKEN].index(state)


@examples(100)
@given(st.sampled_from(SPECS), seeds)
def test_a_run_that_is_over_stays_over_and_what_is_decided_is_as_it_will_be_judged(spec: Assertion, seed: int) -> None:
    """What came true is not pending again, and what is broken stays so: the panel finds the moment by halving."""
    seen, opened = random_trace(seed), monitor(spec)
    last = opened.observe(seen).verdict().passed
    said = []
    for start in range(STEPS):
        opened = opened.observe(piece(seen, start, start + 1))
        said.append(rank(opened.state))
        if opened.is_decided:
            assert opened.verdict().passed == last == (opened.state is State.HOLDS)
    assert said == sorted(said)

from __future__ import annotations

import math
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions import Assertion
from sim_action.assertions.distance import Travel
from sim_action.assertions.follow_path import FollowPath, PathEnd, PathPoint
from sim_action.assertions.matches import Matches
from sim_action.assertions.reach import Reach
from sim_action.assertions.stay_within import StayWithin
from sim_action.assertions.upright import Upright
from sim_action.commands.waypoints import Waypoint, WaypointCommands
from sim_action.core.geometry import quaternion_from_rpy
from sim_action.core.records import replace
from sim_action.core.workspace import Workspace
from sim_action.recording.replay import build
from sim_action.recording.replay.columns import MAX_MOMENTS, Column
from sim_action.recording.replay.replay_data import MAX_CONTACTS, Frames
from sim_action.simulation.recorder import TWIST_NAMES
from sim_action.state.golden_trajectory import Golden
from sim_action.state.observation import Contact
from sim_action.state.trace_records import BodyRecord, CommandedValues
from sim_action.state.verdict import Signal
from tests.outcomes import like
from tests.traces import START, contact, expectation, scenario, scene, trace

RATE = 240
FILM = trace([0.0, 1.0, 2.0], x=[0.0, 1.0, 3.0])


def curve(time: list[float], values: list[float], **limits: float) -> Signal:
    return Signal("travelled", "m", np.array(time), np.array(values), **limits)


def test_curves_of_expectations() -> None:
    # Curves stand with the number of their expectation.
    expected = (expectation(Travel(at_least=2.0)), expectation(Upright(max_tilt=0.5), after=1.0))
    travelled, tilt = build.stored_signals(scenario(*expected), scene(), START, FILM)
    assert (travelled.expectation, travelled.name, travelled.unit, travelled.lower) == (0, "travelled", "m", 2.0)
    assert (tilt.expectation, tilt.name, tilt.unit, tilt.upper) == (1, "tilt", "rad", 0.5)
    assert (tilt.start, tilt.end) == (1.0, 2.0)
    assert travelled.time is None
    np.testing.assert_allclose(travelled.values.decoded(3), [0.0, 1.0, 3.0], atol=1e-3)
    # They fit the replay that they are in.
    asked = scenario(expectation(Travel(at_least=2.0)), expectation(Reach(x=1, y=0, yaw=0)))
    signals, marks = build.stored_signals(asked, scene(), START, FILM), build.stored_marks(asked, scene(), START)
    made = build.replay_of(scene(), FILM, signals, marks)
    assert (made.signals, made.marks) == (signals, marks)
    # What has moments of its own keeps them.
    stored = build.stored_signal(0, curve([0.1, 0.6], [1.0, np.nan]), FILM.time, RATE)
    assert stored.time is not None
    np.testing.assert_allclose(stored.time.decoded(2), [0.1, 0.6])
    np.testing.assert_array_equal(np.isnan(stored.values.decoded(2)), [False, True])
    # A limit that no number reaches is none.
    stored = build.stored_signal(0, curve([0.0, 1.0], [0.0, 1.0], lower=1e300), FILM.time, RATE)
    assert (stored.lower, stored.end) == (None, None)


@pytest.mark.parametrize(
    ("assertion", "kinds"),
    [
        (Travel(at_least=2.0), ["circle"]),
        (Reach(x=1, y=0, yaw=0.5), ["circle", "arrow"]),
        (StayWithin(x=(0, 1), y=(0, 1)), ["polygon"]),
        (FollowPath(path=(PathPoint(x=0, y=0), PathPoint(x=1, y=0)), end=PathEnd()), ["polyline", "circle"]),
        (Reach(x=1e12, y=0), []),
    ],
)
def test_places_are_marked(assertion: Assertion, kinds: list[str]) -> None:
    marks = build.stored_marks(scenario(expectation(Upright()), expectation(assertion)), scene(), START)
    assert [(mark.expectation, mark.kind) for mark in marks] == [(1, kind) for kind in kinds]


def test_golden_trajectories_are_kept_with_their_joints(tmp_path: Path) -> None:
    here = replace(scene(), workspace=Workspace(tmp_path, tmp_path), file="s.sim.yml")
    spec = Matches.model_validate({"trace": "x.csv", "position": 0.02, "joints": {"wheel_right_joint": "5 deg"}})
    rows = np.array([(0.0, 0.0, 0.0, 0.01, 0.0, 0.0), (0.5, 0.1, 0.2, 0.01, 3.5, 1.5)])
    Golden(spec.form_in(here), rows).write(tmp_path / "x.csv")
    [found] = build.stored_golden(scenario(expectation(Upright()), expectation(spec)), here)
    assert found.expectation == 1
    assert found.time.decoded(found.count).tolist() == [0.0, 0.5]
    assert [column.decoded(found.count)[1] for column in found.base] == pytest.approx([0.1, 0.2, 0.01, 3.5])
    [(index, turned)] = found.joints
    assert here.model.moving_joints[index].name == "wheel_right_joint"
    assert turned.decoded(found.count).tolist() == pytest.approx([0.0, 1.5])
    rewritten = replace(here, workspace=replace(here.workspace, updates_golden=True))
    assert build.stored_golden(scenario(expectation(spec)), rewritten) == ()


@pytest.mark.parametrize(("frame", "link"), [("world", None), ("base", 0), ("base_scan", 4)])
def test_a_place_in_the_frame_of_a_link_moves_with_it(frame: str, link: int | None) -> None:
    reach = Reach(link="wheel_left_link", frame=frame, x=1, y=0, yaw=0.5)
    marks = build.stored_marks(scenario(expectation(reach)), scene(), START)
    made = build.replay_of(scene(), FILM, (), marks)
    assert [mark.link for mark in marks] == [link, link]
    assert link is None or made.scene.links[link].name == {"base": "base_footprint"}.get(frame, frame)


steps = st.lists(st.integers(0, 100_000), min_size=1, max_size=300, unique=True).map(sorted)


@given(steps, st.randoms(use_true_random=False))
def test_a_coarse_curve_keeps_its_ends_and_its_extremes(at: list[int], random: Random) -> None:
    values = [random.choice([random.uniform(-1, 1), 5.0, -5.0]) for _ in at]
    whole = curve([step / RATE for step in at], values)
    kept = build.coarse(whole, RATE)
    assert (kept.time[0], kept.time[-1]) == (whole.time[0], whole.time[-1])
    assert (kept.values.min(), kept.values.max()) == (min(values), max(values))
    assert np.all(np.diff(kept.time * RATE) > 0.5)


def test_moments_of_curves() -> None:
    # A curve of every step gets few moments a second.
    time = np.arange(0, 2400) / RATE
    kept = build.coarse(Signal("gap", "m", time, np.sin(time)), RATE)
    assert len(kept.time) <= 4 * 15 * 10 + 4
    # A curve of hours fits a column.
    time = np.arange(0, 3_000_000) / RATE
    assert len(build.coarse(Signal("gap", "m", time, np.sin(1e3 * time)), RATE).time) <= 20_000
    # Gaps stay.
    kept = build.coarse(curve([0.0, 0.5, 1.0], [1.0, np.nan, 2.0]), RATE)
    np.testing.assert_array_equal(np.isnan(kept.values), [False, True, False])
    assert len(build.coarse(curve([0.0, 1e-9, 1.0], [1.0, 1.0, 2.0]), RATE).time) == 2


DRIVE = scenario(expectation(Upright()))
TIME = np.linspace(0.0, 2.0, 61)


def twists(*told: tuple[float, float, float]) -> CommandedValues:
    """Times in s with the commanded speed ahead and turn rate."""
    return CommandedValues.of([(time, {TWIST_NAMES[0]: ahead, TWIST_NAMES[5]: turn}) for time, ahead, turn in told])


def test_the_commanded_path() -> None:
    # Twists lead along an arc.
    path = build.commanded_path(DRIVE, START, twists((0.0, 1.0, math.pi), (1.0, 0.0, 0.0)), TIME)
    x, y, _ = START.pose.position_xyz
    assert path[0][:2] == pytest.approx((x, y))
    assert path[-1][:2] == pytest.approx((x, y + 2 / math.pi), abs=1e-3)
    assert path[-1] == path[-20]
    # Waypoints are the path.
    drives = WaypointCommands(waypoints=(Waypoint(x=1.0, y=0.0), Waypoint(x=1.0, y=2.0)))
    path = build.commanded_path(like(DRIVE, commands=(drives,)), START, twists((0.0, 1.0, 0.0)), TIME)
    assert [point[:2] for point in path[1:]] == [(1.0, 0.0), (1.0, 2.0)]
    # A long path has fewer points.
    path = build.commanded_path(DRIVE, START, twists((0.0, 1.0, 0.1)), np.linspace(0.0, 600.0, 18_001))
    assert len(path) == build.MAX_PATH_POINTS
    # Without twists there is no path.
    assert build.commanded_path(DRIVE, START, None, TIME) == ()
    assert build.commanded_path(DRIVE, START, twists((0.0, 1e300, 0.0)), TIME) == ()


def test_columns_of_the_motion() -> None:
    # Columns are the trace to half a step.
    time = [0.0, 0.1, 0.2]
    frames = build.frames_of(trace(time, x=[0.0, 0.12345, 0.3], position=[0.0, 1.0004, 2.0]), [], RATE, [False, True])
    assert frames.count == 3
    assert frames.time.decoded(3) == pytest.approx(time, abs=1 / RATE / 2)
    assert frames.base[0].decoded(3) == pytest.approx([0.0, 0.12345, 0.3], abs=5e-5)
    assert frames.joints[0].decoded(3) == pytest.approx([0.0, 1.0004, 2.0], abs=5e-4)
    assert frames.joints[1].scale == 1e-4
    # Turning round and round does not jump.
    yaw = np.linspace(0, 8 * np.pi, 200)
    flipped = trace(list(np.arange(200) / 10), yaw=[float(np.remainder(turn, 2 * np.pi)) for turn in yaw])
    frames = build.frames_of(flipped, [], RATE, [False, False])
    for column in frames.base[3:]:
        assert np.abs(np.diff(column.decoded(200))).max() < 0.2
    # A body is where it was last looked at and not where it waits.
    record = BodyRecord(
        np.array([0.0, 1.0, 2.0]),
        np.array([[0.0, 0.0, 1e6], [1.0, 0.0, 0.5], [2.0, 0.0, 0.1]]),
        np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)),
    )
    (track,) = build.frames_of(trace([0.0, 1.5, 2.0]), [build.Track(record, appears=0.9)], RATE, [False, False]).tracks
    assert track[0].decoded(3) == pytest.approx([1.0, 1.0, 2.0])
    assert track[2].decoded(3) == pytest.approx([0.5, 0.5, 0.1])


def test_the_end_of_a_motion() -> None:
    # The very last moment goes on as it went.
    turned = np.array([quaternion_from_rpy(0.0, 0.0, yaw) for yaw in (0.0, 0.1, 0.2)])
    record = BodyRecord(np.array([0.0, 0.1, 0.2]), np.outer([0.0, 1.0, 2.0], [1.0, 0.0, 0.0]), turned)
    (track,) = build.frames_of(trace([0.0, 0.1, 0.2, 0.25]), [build.Track(record)], RATE, [False, False]).tracks
    assert track[0].decoded(4) == pytest.approx([0.0, 1.0, 2.0, 2.5])
    assert 2 * np.arcsin(track[5].decoded(4)) == pytest.approx([0.0, 0.1, 0.2, 0.25], abs=3e-4)
    # What lasts for hours is thinned and keeps its ends.
    long = trace([step / 30 for step in range(2 * MAX_MOMENTS)])
    kept = build.thinned(long)
    assert len(kept) == MAX_MOMENTS
    assert (kept.time[0], kept.time[-1]) == (long.time[0], long.time[-1])
    frames = build.frames_of(kept, [], RATE, [False, False])
    assert Frames.model_validate_json(frames.model_dump_json(exclude_defaults=True)) == frames


def test_steps_of_one_pair_are_one_contact_with_its_largest_mean_force_and_its_impulse() -> None:
    steps = [contact(1.0 + step / RATE, force=12.0 if 40 <= step < 60 else 6.0) for step in range(100)]
    (touch,) = build.joined_touches(steps)
    assert (touch.first, touch.until) == (steps[0], steps[-1].time)
    assert (touch.force(RATE), touch.impulse(RATE)) == pytest.approx((12.0, (80 * 6 + 20 * 12) / RATE))


@pytest.mark.parametrize("rate", [120, 240, 960])
def test_the_force_of_an_impact_does_not_depend_on_the_rate(rate: int) -> None:
    (touch,) = build.joined_touches([contact(1.0, force=0.25 * rate), contact(1.0, force=0.25 * rate)])
    assert (touch.force(rate), touch.impulse(rate)) == pytest.approx((10.0, 0.5))


def test_contacts_of_pairs() -> None:
    # A step longer than the window is its own mean.
    (touch,) = build.joined_touches([contact(1.0, force=4.0), contact(13 / 12, force=6.0)])
    assert touch.force(12) == pytest.approx(6.0)
    # Points of a step add up.
    points = [contact(1.0, force=30.0), contact(1.0, force=40.0), contact(1.01, force=50.0), contact(1.02, force=5.0)]
    assert [touch.force(100) for touch in build.joined_touches(points)] == pytest.approx([(70 + 50 + 5) / 5])
    assert [touch.until for touch in build.joined_touches([contact(1.0), contact(1.05), contact(1.5)])] == [1.05, 1.5]
    # Pairs are told apart.
    found = build.joined_touches(
        [contact(1.0), contact(1.0, body="ball"), contact(1.01), contact(1.01, link="caster_back_link")]
    )
    assert [(touch.first.link, touch.first.body) for touch in found] == [
        ("base_footprint", "wall"),
        ("base_footprint", "ball"),
        ("caster_back_link", "wall"),
    ]


def test_contacts_that_are_kept() -> None:
    # Of many the strongest are kept in the order of time.
    many = [contact(float(number), force=float(number % 100)) for number in range(3 * MAX_CONTACTS)]
    kept, left_out = build.strongest_touches(build.joined_touches(many), {"base_footprint": 0}, {"wall": 0}, RATE)
    assert (len(kept), left_out) == (MAX_CONTACTS, 2 * MAX_CONTACTS)
    assert min(touch.force or 0.0 for touch in kept) >= 66 / 12
    assert [touch.time for touch in kept] == sorted(touch.time for touch in kept)
    # What touches something unknown is passed over.
    assert build.strongest_touches(
        build.joined_touches([contact(1.0, body="ground")]), {"base_footprint": 0}, {"wall": 0}, RATE
    ) == ((), 0)
    # A contact without a force is kept before weak ones.
    stuck = contact(0.5, force=0.0)._replace(has_force=False)
    many = [contact(float(number), force=float(number)) for number in range(1, 3 * MAX_CONTACTS)]
    kept, _ = build.strongest_touches(build.joined_touches([stuck, *many]), {"base_footprint": 0}, {"wall": 0}, RATE)
    assert (kept[0].time, kept[0].force) == (0.5, None)
    assert all(touch.force is not None for touch in kept[1:])


def test_the_course_of_a_force() -> None:
    # The force on the link has a direction and a course.
    steps = [
        contact(step / RATE, force=6.0 if step < 8 else 12.0)._replace(normal_xyz=(0.0, -0.6, 0.8))
        for step in range(16)
    ]
    ((found,), _) = build.strongest_touches(build.joined_touches(steps), {"base_footprint": 0}, {"wall": 0}, RATE)
    assert found.normal == pytest.approx((0.0, -0.6, 0.8))
    assert found.period == pytest.approx(1 / 30)
    assert found.forces == Column(scale=0.01, first=600, deltas=(600,))
    # A long contact has fewer forces.
    steps = [contact(step / RATE)._replace(normal_xyz=(1.0, 0.0, 0.0)) for step in range(100 * RATE)]
    ((found,), _) = build.strongest_touches(build.joined_touches(steps), {"base_footprint": 0}, {"wall": 0}, RATE)
    assert found.period == pytest.approx(80 / RATE)
    assert found.forces is not None
    # Each period has as many steps, so a constant force is a straight line.
    assert found.forces.decoded(300) == pytest.approx([12.5] * 300)
    assert found.forces.deltas == ()
    # A contact without a direction has no course.
    ((found,), _) = build.strongest_touches(
        build.joined_touches([contact(1.0)]), {"base_footprint": 0}, {"wall": 0}, RATE
    )
    assert (found.normal, found.period, found.forces, found.places) == (None, None, None, None)


def test_the_place_of_a_force_moves_with_it() -> None:
    def at(step: int, x: float, y: float, force: float) -> Contact:
        return contact(step / RATE, force=force)._replace(position_xyz=(x, y, 0.1), normal_xyz=(1.0, 0.0, 0.0))

    # Two points of each step, one with three times the force of the other; in between, a period without contact.
    steps = [at(step, x, y, 1.0 + y) for step, x in ((0, 1.0), (1, 1.2), (24, 4.0)) for y in (0.0, 2.0)]
    ((found,), _) = build.strongest_touches(build.joined_touches(steps), {"base_footprint": 0}, {"wall": 0}, RATE)
    assert found.places is not None
    x, y, z = (column.decoded(4) for column in found.places)
    assert x == pytest.approx([1.1, 2.067, 3.033, 4.0], abs=1e-3)
    assert (y.tolist(), z.tolist()) == ([1.5] * 4, [0.1] * 4)
    assert found.is_whole
    assert not like(found, period=None).is_whole
    short = like(found.places[0], deltas=(1,))
    assert not like(found, places=(short, *found.places[1:])).is_whole

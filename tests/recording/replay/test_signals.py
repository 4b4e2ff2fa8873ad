"""What expectations looked at, as a replay stores it."""

from __future__ import annotations

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
from sim_action.core.records import replace
from sim_action.core.workspace import Workspace
from sim_action.recording.replay.build import (
    coarse,
    replay_of,
    stored_golden,
    stored_marks,
    stored_signal,
    stored_signals,
)
from sim_action.state.golden_trajectory import Golden
from sim_action.state.verdict import Signal
from tests.traces import START, expectation, scenario, scene, trace

RATE = 240.0
FILM = trace([0.0, 1.0, 2.0], x=[0.0, 1.0, 3.0])


def curve(time: list[float], values: list[float], **limits: float) -> Signal:
    return Signal("travelled", "m", np.array(time), np.array(values), **limits)


def test_curves_stand_with_the_number_of_their_expectation() -> None:
    expected = (expectation(Travel(at_least=2.0)), expectation(Upright(max_tilt=0.5), after=1.0))
    travelled, tilt = stored_signals(scenario(*expected), scene(), START, FILM)
    assert (travelled.expectation, travelled.name, travelled.unit, travelled.lower) == (0, "travelled", "m", 2.0)
    assert (tilt.expectation, tilt.name, tilt.unit, tilt.upper) == (1, "tilt", "rad", 0.5)
    assert (tilt.start, tilt.end) == (1.0, 2.0)
    assert travelled.time is None
    np.testing.assert_allclose(travelled.values.decoded(3), [0.0, 1.0, 3.0], atol=1e-3)


def test_they_fit_the_replay_that_they_are_in() -> None:
    expected = scenario(expectation(Travel(at_least=2.0)), expectation(Reach(x=1, y=0, yaw=0)))
    signals, marks = stored_signals(expected, scene(), START, FILM), stored_marks(expected, scene(), START)
    made = replay_of(scene(), FILM, signals, marks)
    assert (made.signals, made.marks) == (signals, marks)


def test_what_has_moments_of_its_own_keeps_them() -> None:
    stored = stored_signal(0, curve([0.1, 0.6], [1.0, np.nan]), FILM.time, RATE)
    assert stored.time is not None
    np.testing.assert_allclose(stored.time.decoded(2), [0.1, 0.6])
    np.testing.assert_array_equal(np.isnan(stored.values.decoded(2)), [False, True])


def test_a_limit_that_no_number_reaches_is_none() -> None:
    stored = stored_signal(0, curve([0.0, 1.0], [0.0, 1.0], lower=1e300), FILM.time, RATE)
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
    marks = stored_marks(scenario(expectation(Upright()), expectation(assertion)), scene(), START)
    assert [(mark.expectation, mark.kind) for mark in marks] == [(1, kind) for kind in kinds]


def test_golden_trajectories_are_kept_with_their_joints(tmp_path: Path) -> None:
    here = replace(scene(), workspace=Workspace(tmp_path, tmp_path), file="s.sim.yml")
    spec = Matches.model_validate({"trace": "x.csv", "position": 0.02, "joints": {"wheel_right_joint": "5 deg"}})
    rows = np.array([(0.0, 0.0, 0.0, 0.01, 0.0, 0.0), (0.5, 0.1, 0.2, 0.01, 3.5, 1.5)])
    Golden(spec.form_in(here), rows).write(tmp_path / "x.csv")
    [found] = stored_golden(scenario(expectation(Upright()), expectation(spec)), here)
    assert found.expectation == 1
    assert found.time.decoded(found.count).tolist() == [0.0, 0.5]
    assert [column.decoded(found.count)[1] for column in found.base] == pytest.approx([0.1, 0.2, 0.01, 3.5])
    [(index, turned)] = found.joints
    assert here.model.moving_joints[index].name == "wheel_right_joint"
    assert turned.decoded(found.count).tolist() == pytest.approx([0.0, 1.5])
    rewritten = replace(here, workspace=replace(here.workspace, updates_golden=True))
    assert stored_golden(scenario(expectation(spec)), rewritten) == ()


@pytest.mark.parametrize(("frame", "link"), [("world", None), ("base", 0), ("base_scan", 4)])
def test_a_place_in_the_frame_of_a_link_moves_with_it(frame: str, link: int | None) -> None:
    reach = Reach(link="wheel_left_link", frame=frame, x=1, y=0, yaw=0.5)
    marks = stored_marks(scenario(expectation(reach)), scene(), START)
    made = replay_of(scene(), FILM, (), marks)
    assert [mark.link for mark in marks] == [link, link]
    assert link is None or made.scene.links[link].name == {"base": "base_footprint"}.get(frame, frame)


steps = st.lists(st.integers(0, 100_000), min_size=1, max_size=300, unique=True).map(sorted)


@given(steps, st.randoms(use_true_random=False))
def test_a_coarse_curve_keeps_its_ends_and_its_extremes(at: list[int], random: Random) -> None:
    values = [random.choice([random.uniform(-1, 1), 5.0, -5.0]) for _ in at]
    whole = curve([step / RATE for step in at], values)
    kept = coarse(whole, RATE)
    assert (kept.time[0], kept.time[-1]) == (whole.time[0], whole.time[-1])
    assert (kept.values.min(), kept.values.max()) == (min(values), max(values))
    assert np.all(np.diff(kept.time * RATE) > 0.5)


def test_a_curve_of_every_step_gets_few_moments_a_second() -> None:
    time = np.arange(0, 2400) / RATE
    kept = coarse(Signal("gap", "m", time, np.sin(time)), RATE)
    assert len(kept.time) <= 4 * 15 * 10 + 4


def test_a_curve_of_hours_fits_a_column() -> None:
    time = np.arange(0, 3_000_000) / RATE
    assert len(coarse(Signal("gap", "m", time, np.sin(1e3 * time)), RATE).time) <= 20_000


def test_gaps_stay() -> None:
    kept = coarse(curve([0.0, 0.5, 1.0], [1.0, np.nan, 2.0]), RATE)
    np.testing.assert_array_equal(np.isnan(kept.values), [False, True, False])


def test_two_moments_at_one_step_are_one() -> None:
    assert len(coarse(curve([0.0, 1e-9, 1.0], [1.0, 1.0, 2.0]), RATE).time) == 2

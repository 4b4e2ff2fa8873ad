"""What recordings are made from, of what was kept of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim_action.assertions.upright import Upright
from sim_action.core.geometry import Twist
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.state.trace_records import CommandedTwists
from tests.recording.export.runs import MOMENTS, TIME, appearing, rolling, run, sensing_run
from tests.traces import expectation, scenario, trace


@pytest.mark.parametrize(("stored", "moments"), [([0.0, 0.5], MOMENTS), ([step / 60 for step in range(31)], 31)])
def test_whichever_has_more_moments_is_recorded_with_all_that_is_known(stored: list[float], moments: int) -> None:
    film, readings = run().trace, sensing_run().trace.sensors
    kept = replace(trace(stored), sensors=readings)
    made = RecordedRun.of(run().scene, film, kept, scenario(expectation(Upright())), CommandedTwists())
    assert len(made.trace) == moments
    assert made.trace.contacts == film.contacts
    assert made.trace.sensors == readings
    assert made.bodies["ball"].shape == (moments, 7)


def test_a_body_is_where_it_was_seen_last() -> None:
    made, ball = run(), rolling()
    seen = ball.rows(np.array([3, 8]))
    tracks = replace(made, trace=replace(made.trace, bodies={"ball": seen})).bodies
    expected = [TIME[3]] * 8 + [TIME[8]] * (MOMENTS - 8)
    assert tracks["ball"][:, 1].tolist() == expected


def test_a_body_is_nowhere_until_it_appears() -> None:
    made = appearing(TIME[5])
    assert list(made.bodies) == ["ball", "wall"]
    for poses in made.bodies.values():
        assert np.isnan(poses[:5]).all()
    assert made.bodies["ball"][5:, 1].tolist() == TIME[5:]
    assert made.bodies["wall"][5:, 0].tolist() == [2.0] * (MOMENTS - 5)


def test_twists_are_kept_as_they_were_told() -> None:
    told = CommandedTwists.of([(0.0, Twist.planar(1.0, 2.0)), (0.5, Twist.planar(lateral=3.0))])
    assert told.time.tolist() == [0.0, 0.5]
    assert told.values.tolist() == [[1.0, 0, 0, 0, 0, 2.0], [0, 3.0, 0, 0, 0, 0]]
    assert len(CommandedTwists.of([])) == len(CommandedTwists()) == 0
    assert CommandedTwists.of([]).values.shape == (0, 6)

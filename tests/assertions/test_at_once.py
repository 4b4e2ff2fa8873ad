"""Several conditions at the same moment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim_action.assertions.combined import AllOf, AnyOf, AtOnce, Negation
from sim_action.assertions.distance import Travel
from sim_action.assertions.final_pose import FinalPose
from sim_action.assertions.monitors import State
from sim_action.assertions.no_collision import NoCollision
from sim_action.assertions.reach import Reach
from sim_action.assertions.sensor import SensorReading
from sim_action.assertions.settled import Settled
from sim_action.assertions.temporal_logic.stl_assertion import Stl
from sim_action.assertions.upright import Upright
from sim_action.state.trace_records import SensorRecord
from tests.traces import START, contact, judged, monitor, scene, trace

HERE, THERE = Reach(x=0.5, y=0.0), Reach(x=1.5, y=0.0)
WAY = trace([0.0, 1.0, 2.0, 3.0], x=[0.0, 0.5, 1.0, 1.5], speed=[1.0, 1.0, 1.0, 0.0])


def at_once(*parts: Reach | Travel | Upright | NoCollision | Settled | SensorReading | Negation | AnyOf) -> AtOnce:
    return AtOnce(parts=parts)


def test_places_that_are_never_reached_together_fail_although_each_is_reached() -> None:
    assert judged(AllOf(parts=(HERE, THERE)), WAY).passed
    verdict = judged(at_once(HERE, THERE), WAY)
    assert not verdict.passed
    assert (verdict.measured, verdict.limit, verdict.margin, verdict.time) == (1.0, 2.0, -1.0, 1.0)
    assert verdict.message == (
        "at most 1 of 2 were true at the same moment in 3.0 s, first at 1.00 s; "
        "not true then: reach (1.5, 0) within 0.05 m"
    )


def test_it_comes_true_at_the_first_moment_at_which_all_are_true() -> None:
    verdict = judged(at_once(Travel(at_least=1.0), Upright(), NoCollision()), WAY)
    assert (verdict.passed, verdict.time) == (True, 2.0)
    assert verdict.message == "all 3 were true at 2.00 s"


def test_nothing_true_is_said_in_words() -> None:
    assert judged(at_once(Reach(x=9, y=9), Reach(x=8, y=8)), WAY).message.startswith("at most none of 2")


def test_an_invariant_that_broke_before_may_be_true_again() -> None:
    seen = trace([0.0, 1.0, 2.0, 3.0], x=[0.0, 0.5, 1.0, 1.5], contacts=(contact(1.0),))
    assert not judged(at_once(HERE, NoCollision()), seen).passed
    assert judged(at_once(THERE, NoCollision()), seen).passed
    assert judged(at_once(HERE, Negation(part=NoCollision())), seen).passed


def test_the_robot_is_at_rest_at_a_moment_without_a_time_to_hold() -> None:
    assert judged(at_once(THERE, Settled()), WAY).passed
    assert not judged(at_once(HERE, Settled()), WAY).passed


def test_one_of_several_at_the_same_moment() -> None:
    assert judged(at_once(HERE, AnyOf(parts=(THERE, Travel(at_most=0.6)))), WAY).passed
    assert not judged(at_once(HERE, AnyOf(parts=(THERE, Travel(at_least=0.6)))), WAY).passed


def test_a_reading_counts_until_the_next_one() -> None:
    near = SensorReading(name="scan", reading="ranges", which="min", at_most=1.0)
    readings = SensorRecord("lidar", np.array([0.5, 2.5]), {"ranges": np.array([[0.8, 2.0], [3.0, 4.0]])})
    seen = replace(WAY, sensors={"scan": readings})
    assert judged(at_once(near, HERE), seen).passed
    assert not judged(at_once(near, THERE), seen).passed
    assert not judged(at_once(near, Reach(x=0, y=0)), seen).passed


def test_a_reading_before_the_block_counts() -> None:
    near = SensorReading(name="scan", reading="ranges", which="min", at_most=1.0)
    readings = SensorRecord("lidar", np.array([0.0]), {"ranges": np.array([[0.8]])})
    opened = monitor(at_once(near, THERE)).observe(replace(WAY.first(2), sensors={"scan": readings}))
    assert opened.state is State.PENDING
    assert opened.observe(WAY.rows(slice(2, 4))).state is State.HOLDS


def test_parts_without_a_truth_at_a_moment_are_refused() -> None:
    spec = AtOnce(parts=(HERE, FinalPose(x=1.0, y=0.0), Stl(formula="eventually (x > 1)"), AllOf(parts=(HERE,))))
    assert [path for path, _ in spec.problems(scene())] == [(1,), (2,), (3,)]
    assert next(message for _, message in spec.problems(scene())) == (
        "'final_pose' is not true or false at a moment; use all_of, or another assertion"
    )


def test_the_number_of_true_conditions_is_drawn() -> None:
    count, *_ = at_once(HERE, Travel(at_least=1.0), Upright()).signals(scene(), START, WAY)
    assert (count.name, count.lower, count.values.tolist()) == ("conditions that are true", 3.0, [1.0, 2.0, 2.0, 2.0])


@pytest.mark.parametrize("part", [HERE, Travel(at_most=1.0)])
def test_it_is_a_goal_whatever_its_parts_are(part: Reach | Travel) -> None:
    assert at_once(part).is_goal
    assert monitor(at_once(part)).state is State.PENDING

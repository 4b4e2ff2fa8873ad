"""Goals and invariants as folds over margins."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.goals import ClosestApproach, Goal, Invariant, joined

TIME = np.array([1.0, 2.0, 3.0, 4.0])


def margins(*values: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array(values, dtype=np.float64)


@pytest.mark.parametrize(
    ("margin", "goal"),
    [
        ((-3, -2, 1, 2), Goal(1.0, 3.0, State.HOLDS)),
        ((0, 5, 5, 5), Goal(0.0, 1.0, State.HOLDS)),
        ((-3, -1, -2, -1), Goal(-1.0, 2.0, State.PENDING)),
    ],
)
def test_a_goal_keeps_the_moment_it_came_true_or_its_best(margin: tuple[float, ...], goal: Goal) -> None:
    assert Goal().observe(TIME, margins(*margin)) == goal


@pytest.mark.parametrize(
    ("margin", "invariant"),
    [
        ((3, 1, 2, 1), Invariant(1.0, 2.0, State.HOLDS)),
        ((0, 0, 0, 0), Invariant(0.0, 1.0, State.HOLDS)),
        ((3, -1, -2, 5), Invariant(-1.0, 2.0, State.BROKEN)),
    ],
)
def test_an_invariant_keeps_the_moment_it_broke_or_its_worst(margin: tuple[float, ...], invariant: Invariant) -> None:
    assert Invariant().observe(TIME, margins(*margin)) == invariant


def test_what_is_decided_stays_decided() -> None:
    met = Goal().observe(TIME, margins(1, 1, 1, 1))
    assert met.observe(TIME, margins(9, 9, 9, 9)) is met
    broken = Invariant().observe(TIME, margins(-1, 1, 1, 1))
    assert broken.observe(TIME, margins(-9, -9, -9, -9)) is broken


def test_no_moments_change_nothing() -> None:
    goal, invariant = Goal(), Invariant()
    assert goal.observe(TIME[:0], margins()) is goal
    assert invariant.observe(TIME[:0], margins()) is invariant


def test_what_is_not_a_number_neither_meets_a_goal_nor_holds() -> None:
    assert Goal().observe(TIME, margins(*[math.nan] * 4)).state is State.PENDING
    broken = Invariant().observe(TIME, margins(1, 1, math.nan, 1))
    assert (broken.state, broken.time) == (State.BROKEN, 3.0)


@pytest.mark.parametrize(
    ("states", "all_of_them"),
    [
        ((), State.HOLDS),
        ((State.HOLDS, State.HOLDS), State.HOLDS),
        ((State.HOLDS, State.PENDING), State.PENDING),
        ((State.PENDING, State.BROKEN), State.BROKEN),
    ],
)
def test_several_states_join_to_the_worst(states: tuple[State, ...], all_of_them: State) -> None:
    assert joined(*states) is all_of_them


DISTANCE_TIME = np.array([1.0, 2.0, 3.0])
ELBOW = ClosestApproach("elbow came", "90 deg", "rad", 0.25)


def test_the_first_moment_within_the_tolerance_counts() -> None:
    seen = ELBOW.observe(DISTANCE_TIME, np.array([0.5, 0.25, 0.0]))
    assert (seen.state, seen.distance, seen.goal.time) == (State.HOLDS, 0.25, 2.0)
    assert seen.observe(DISTANCE_TIME + 3, np.zeros(3)).verdict() == seen.verdict()


def test_a_heading_counts_as_a_part_of_its_tolerance() -> None:
    turned = ClosestApproach("came", "(2, 0)", "m", 0.5, angle_tolerance=0.25)
    seen = turned.observe(DISTANCE_TIME, np.array([0.0, 0.25, 2.0]), np.array([1.0, 0.5, 0.0]))
    # Twice the angle that is allowed, at the second moment, is the least of what is too much.
    assert (seen.goal.margin, seen.distance, seen.angle_error, seen.goal.time) == (-0.5, 0.25, 0.5, 2.0)
    assert seen.verdict().message == (
        "came no closer than 0.25 m to (2, 0), 28.65 deg off its heading, in 3.0 s; closest at 2.00 s"
    )


def test_without_a_moment_nothing_came_near() -> None:
    assert ELBOW.observe(DISTANCE_TIME[:0], DISTANCE_TIME[:0]) is ELBOW
    assert ELBOW.verdict().message == "no physics step to measure"

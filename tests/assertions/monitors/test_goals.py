"""Goals and invariants as folds over margins."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.goals import Goal, Invariant, joined

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

"""How near something came to where it should get."""

from __future__ import annotations

import numpy as np

from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.goals import ClosestApproach

TIME = np.array([1.0, 2.0, 3.0])
ELBOW = ClosestApproach("elbow came", "90 deg", "rad", 0.25)


def test_the_first_moment_within_the_tolerance_counts() -> None:
    seen = ELBOW.observe(TIME, np.array([0.5, 0.25, 0.0]))
    assert (seen.state, seen.distance, seen.goal.time) == (State.HOLDS, 0.25, 2.0)
    assert seen.observe(TIME + 3, np.zeros(3)).verdict() == seen.verdict()


def test_a_heading_counts_as_a_part_of_its_tolerance() -> None:
    turned = ClosestApproach("came", "(2, 0)", "m", 0.5, yaw_tolerance=0.25)
    seen = turned.observe(TIME, np.array([0.0, 0.25, 2.0]), np.array([1.0, 0.5, 0.0]))
    # Twice the angle that is allowed, at the second moment, is the least of what is too much.
    assert (seen.goal.margin, seen.distance, seen.yaw_error, seen.goal.time) == (-0.5, 0.25, 0.5, 2.0)
    assert seen.verdict().message == (
        "came no nearer than 0.25 m to (2, 0), 28.65 deg off its heading, in 3.0 s; nearest at 2.00 s"
    )


def test_without_a_moment_nothing_came_near() -> None:
    assert ELBOW.observe(TIME[:0], TIME[:0]) is ELBOW
    assert ELBOW.verdict().message == "no moment to measure"

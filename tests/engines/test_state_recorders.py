"""The states of a robot are the same however they are collected."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from tests import traces
from tests.integration.engines import running
from tests.soak import examples

TURN = JointTargets(velocity={"wheel_left_joint": 3.0, "wheel_right_joint": 9.0})
STEPS = 40


@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
@examples(4)
@given(cuts=st.sets(st.integers(1, STEPS - 1)), ticks=st.sets(st.integers(1, STEPS - 1)))
def test_states_are_the_same_however_they_are_collected(engine: str, cuts: set[int], ticks: set[int]) -> None:
    pytest.importorskip(engine, reason=f"{engine} is not installed")

    def states(cuts: set[int]) -> list[Trace]:
        parts = []
        with running(engine, traces.scene()) as backend:
            assert not len(backend.collect())
            moments = sorted({0, STEPS} | cuts | ticks)
            for first, last in pairwise(moments):
                backend.advance(first, [None if first else TURN, *[None] * (last - first - 1)])
                # The last kept row is the present state.
                seen = Trace.of_observation(backend.observe(last, contacts=False)).state
                if last in cuts or last == STEPS:
                    parts.append(backend.collect())
                    assert np.array_equal(parts[-1].state[-1:], seen)
        return parts

    whole, pieces = states(set()), states(cuts)
    assert [len(whole), len(pieces)] == [1, len(cuts) + 1]
    assert np.array_equal(whole[0].state, Trace.concatenate(pieces).state)

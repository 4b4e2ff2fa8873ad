"""What is kept of a run while it lasts: the moments of every so many steps, and the very last."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sim_action.assertions.upright import Upright
from sim_action.simulation.recorder import RunRecorder
from sim_action.state.observation import JointState
from tests import traces

RATE = 240
STRIDE = 24


@pytest.mark.parametrize("steps", [1, 23, 24, 25, 240, 241])
@pytest.mark.parametrize("cut", [1, 24, 100, 239])
def test_however_a_run_is_cut_all_moments_of_its_rate_are_kept_and_the_last(steps: int, cut: int) -> None:
    footage = RunRecorder(traces.scenario(traces.expectation(Upright())))
    footage.begin(replace(traces.START, joints=dict.fromkeys(traces.WHEELS, JointState(0, 0, 0))))
    for first in range(1, steps + 1, cut):
        last = min(first + cut - 1, steps)
        seen = traces.trace([step / RATE for step in range(first, last + 1)])
        footage.add(seen, judged={}, is_last=last == steps)
    kept = footage.trace()
    assert kept is not None
    assert [round(time * RATE) for time in kept.time] == sorted({*range(0, steps + 1, STRIDE), steps})

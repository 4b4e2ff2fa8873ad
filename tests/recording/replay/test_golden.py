"""The golden trajectory in a replay: what is no whole one is refused."""

from __future__ import annotations

import pytest

from sim_action.recording.replay.columns import Column
from sim_action.recording.replay.replay_data import GoldenData

STILL = Column(scale=1.0, first=0)
TIMES = Column(scale=0.1, first=0, deltas=(1, 1))


@pytest.mark.parametrize(
    ("time", "column", "index", "fits"),
    [
        (TIMES, STILL, 0, True),
        (TIMES, Column(scale=1.0, first=0, deltas=(1, -1)), 0, True),
        (TIMES, Column(scale=1.0, first=0, deltas=(1,)), 0, False),
        (TIMES, STILL, 1, False),
        (TIMES, Column(scale=1e300, first=2**53), 0, False),
        (TIMES, Column(scale=1.0, first=0, gaps=((1, 1),)), 0, False),
        (Column(scale=1e9, first=0, deltas=(1, 1)), STILL, 0, False),
        (Column(scale=0.1, first=0, deltas=(1, 0)), STILL, 0, False),
        (Column(scale=0.1, first=0, deltas=(1, 1), gaps=((0, 1),)), STILL, 0, False),
    ],
)
def test_its_columns_fit_its_times_and_its_joints_those_of_the_run(
    time: Column, column: Column, index: int, fits: bool
) -> None:
    golden = GoldenData(expectation=0, time=time, base=(STILL, STILL, STILL, column), joints=((index, STILL),))
    assert golden.fits(joints=1) is fits

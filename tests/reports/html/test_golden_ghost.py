"""A golden trajectory as a ghost."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_action.recording.replay.columns import Column, TextColumn
from sim_action.recording.replay.replay_data import ChannelData, GoldenData, Replay
from sim_action.reports.html.ghosts import golden_replay, motion_of
from sim_action.reports.html.parting import parting
from tests.outcomes import like
from tests.replays import drive

TIMES = Column(scale=1.0, first=0, deltas=(1, 1))
STILL = Column(scale=1.0, first=0)


def golden(metres_a_second: float, yaw: float = 0.0, joints: tuple[tuple[int, Column], ...] = ()) -> GoldenData:
    ahead = Column(scale=metres_a_second, first=0, deltas=(1, 1))
    heading = Column(scale=yaw or 1.0, first=int(yaw > 0))
    return GoldenData(expectation=0, time=TIMES, base=(ahead, STILL, STILL, heading), joints=joints)


def test_it_has_the_motion_of_the_file_and_is_a_valid_replay() -> None:
    replay = drive()
    found = golden_replay(replay, golden(0.5, yaw=1.0))
    count = found.frames.count
    assert found.frames.base[0].decoded(count).tolist() == [0.0, 0.5, 1.0]
    assert found.frames.base[5].decoded(count)[0] == pytest.approx(math.sin(0.5), abs=1e-5)
    assert found.scene.bodies == ()
    assert Replay.model_validate_json(motion_of(found, drive()).model_dump_json()) is not None


def test_joints_that_the_file_does_not_have_stay_as_at_the_start() -> None:
    replay = drive()
    assert golden_replay(replay, golden(0.5)).frames.joints[0].decoded(3).tolist() == [0.0, 0.0, 0.0]
    turning = Column(scale=0.1, first=0, deltas=(1, 1))
    assert golden_replay(replay, golden(0.5, joints=((0, turning),))).frames.joints == (turning,)


def test_a_run_parts_from_it() -> None:
    replay = drive()
    assert parting(replay, golden_replay(replay, golden(0.5))) is None
    found = parting(replay, golden_replay(replay, golden(0.6)))
    assert found is not None
    assert found.time == 1.0


def test_a_channel_that_only_one_run_has_is_zero_in_the_ghost() -> None:
    def turning(name: str, *, group: str = "base", commanded: bool = False) -> ChannelData:
        values = TextColumn.encoded(np.full(61, 0.5), 1e-3)
        return ChannelData(group=group, name=name, unit="rad/s", values=values, commanded=commanded)

    named = (turning("angular z"), turning("linear x", commanded=True), turning("range", group="front"))
    ours = like(drive(), channels=named)
    theirs = like(drive(), channels=(turning("linear y"),))
    found = motion_of(theirs, ours).channels
    assert [(channel.group, channel.name) for channel in found] == [("base", "linear y"), ("base", "angular z")]
    assert found[1].values.decoded(61).tolist() == [0.0] * 61
    # Nothing is known of the channels of a golden trajectory.
    assert motion_of(golden_replay(ours, golden(0.5)), ours).channels == ()

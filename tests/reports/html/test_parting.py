"""The moment at which two runs part."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_action.core.errors import Location
from sim_action.recording.replay.columns import Column, TextColumn
from sim_action.recording.replay.replay_data import ChannelData, Replay
from sim_action.reports.html.parting import Parting, Tolerance, commands_until, parting, same_motion_text
from sim_action.results.outcome import ExpectationOutcome
from sim_action.state.verdict import Verdict
from tests.outcomes import like, outcome
from tests.replays import drive


def with_frames(replay: Replay, **changed: object) -> Replay:
    return like(replay, frames=like(replay.frames, **changed))


def turned(yaw: float, sign: float = 1.0) -> Replay:
    """A drive that turns from 0 to `yaw`; at half of the time, the quaternion changes its sign."""
    replay = drive(distance=0.0)
    angles = np.linspace(0, yaw, replay.frames.count)
    signs = np.where(np.arange(replay.frames.count) < replay.frames.count / 2, 1.0, sign)
    still = replay.frames.base[1]
    z, w = (Column.encoded(signs * part(angles / 2), 1e-5) for part in (np.sin, np.cos))
    return with_frames(replay, base=(still, still, still, still, still, z, w))


def test_runs_that_move_alike_do_not_part() -> None:
    assert parting(drive(), drive()) is None
    assert parting(drive(), drive(distance=1.004)) is None


def test_the_first_moment_beyond_the_tolerance_counts() -> None:
    # After 1 s of 2 s, 10 mm more are 5 mm.
    found = parting(drive(), drive(distance=1.0101))
    assert found is not None
    assert found.time == pytest.approx(1.0, abs=0.04)
    assert found.words == "by more than 5 mm"


def test_a_heading_counts_and_a_quaternion_is_its_negative() -> None:
    found = parting(turned(0.0), turned(math.radians(2)))
    assert found is not None
    assert found.time == pytest.approx(0.5, abs=0.04)
    assert found.words == "by more than 0.5 deg"
    assert parting(turned(1.0), turned(1.0, sign=-1.0)) is None
    # Between two moments of the change of sign, too.
    once = turned(0.5, sign=-1.0)
    moments = once.frames.time
    shifted = with_frames(once, time=like(moments, first=moments.first + 167))
    assert parting(turned(0.5), shifted) is None


def test_runs_that_end_apart_part_there() -> None:
    short = drive(seconds=1.0, distance=0.5)
    assert parting(short, drive()) == Parting(1.0, "where this run ends", is_end=True)
    assert parting(drive(), short) == Parting(1.0, "where the other run ends", is_end=True)
    # Some moments of the replay are too many.
    assert parting(drive(), drive(seconds=1.8, distance=0.9)) is not None


def test_other_moments_of_the_same_motion_do_not_part() -> None:
    replay, coarse = drive(), drive()
    times = np.linspace(0, 2, 11)
    still = coarse.frames.base[1]
    ahead = Column.encoded(times / 2, 1e-4)
    coarse = with_frames(
        coarse, time=Column.encoded(times, 1e-4), base=(ahead, *coarse.frames.base[1:]), joints=(still,), speed=still
    )
    assert parting(replay, coarse) is None
    assert parting(coarse, replay) is None


def test_joints_count_where_no_base_moves() -> None:
    arm = drive(distance=0.0)
    bent = with_frames(arm, joints=(Column.encoded(np.linspace(0, 0.1, arm.frames.count), 1e-4),))
    found = parting(arm, bent)
    assert found is not None
    assert found.words == "by more than 0.5 deg"
    (wheel, *rest) = arm.scene.links[::-1]
    assert wheel.joint is not None
    slider = like(wheel, joint=like(wheel.joint, type="prismatic"))
    slid = like(arm, scene=like(arm.scene, links=(*rest[::-1], slider)))
    found = parting(slid, bent)
    assert found is not None
    assert found.words == "by more than 5 mm"
    renamed = like(bent, joint_names=("other",))
    assert parting(arm, renamed) is None


def test_what_was_not_compared_is_not_said_to_move_alike() -> None:
    assert (
        same_motion_text(drive(), drive(), Tolerance())
        == "The motions of the bases are the same, up to 5 mm or 0.5 deg"
    )
    arm = drive(distance=0.0)
    assert same_motion_text(arm, arm, Tolerance()) == "The motions are the same, up to 5 mm or 0.5 deg"
    body = with_frames(like(drive(), joint_names=()), joints=())
    assert same_motion_text(body, body, Tolerance()) == "The motions are the same, up to 5 mm or 0.5 deg"


def test_a_larger_tolerance_of_the_scenario_counts() -> None:
    def agreed(limit: float, unit: str) -> ExpectationOutcome:
        verdict = Verdict(True, 0.0, limit, limit, unit, 1.0, "")
        return ExpectationOutcome(
            name="agreement", assertion="agreement", severity="error", location=Location("a"), verdict=verdict
        )

    made = like(outcome("a.sim.yml"), expectations=(agreed(0.2, "m"), agreed(1e-4, "rad")))
    tolerance = Tolerance.of(made)
    assert tolerance.words == "200 mm or 0.5 deg"
    assert Tolerance.of(outcome("a.sim.yml")) == Tolerance()
    assert parting(drive(), drive(distance=1.1), tolerance) is None
    assert Tolerance(position=2.0).words == "2 m or 0.5 deg"


def told(values: list[float], commanded: float, *, name: str = "linear x", unit: str = "m/s") -> Replay:
    """A drive whose joint command is that of `commanded`, with a channel of commands, one a second."""
    replay = drive()
    count = replay.frames.count
    channel = ChannelData(
        group="base",
        name=name,
        unit=unit,
        time=TextColumn.encoded(np.arange(len(values), dtype=float), 1e-3),
        values=TextColumn.encoded(np.array(values), 1e-3),
        commanded=True,
    )
    aim = Column.encoded(np.full(count, commanded), 1e-3)
    return like(with_frames(replay, commanded=(aim,)), channels=(channel,))


@pytest.mark.parametrize(
    ("ours", "theirs", "until", "words"),
    [
        (([0.5, 0.3, 0.3], 1.0), ([0.5, 0.5, 0.5], 1.0), 2.0, "linear x 0.3 m/s, before 0.5 m/s, at 1.00 s"),
        # The motions parted before.
        (([0.5, 0.3, 0.3], 1.0), ([0.5, 0.5, 0.5], 1.0), 0.9, ""),
        # The same, up to one percent.
        (([0.5, 0.5, 0.5], 1.0), ([0.5, 0.504, 0.5], 1.005), 2.0, ""),
        # At a single moment.
        (([0.5, 0.3, 0.5], 1.0), ([0.5, 0.5, 0.5], 1.0), 2.0, ""),
        # Of two that differ, the first.
        (
            ([0.5, 0.3, 0.3], 1.2),
            ([0.5, 0.5, 0.5], 1.0),
            2.0,
            "wheel_joint position 68.75 deg, before 57.3 deg, at 0.00 s",
        ),
        (([0.5, math.nan, 0.3], 1.0), ([0.5, 0.5, 0.3], 1.0), 2.0, ""),
    ],
)
def test_the_first_command_that_differs_is_named(
    ours: tuple[list[float], float], theirs: tuple[list[float], float], until: float, words: str
) -> None:
    assert commands_until(told(*ours), told(*theirs), until) == words


def test_a_part_of_a_twist_that_is_not_stored_is_zero() -> None:
    straight, turning = told([0.5, 0.5, 0.5], 1.0), told([0.1, 0.1, 0.1], 1.0, name="angular z", unit="rad/s")
    both = like(straight, channels=(*straight.channels, *turning.channels))
    assert commands_until(both, straight, 2.0) == "angular z 5.73 deg/s, before 0 deg/s, at 0.00 s"
    assert commands_until(straight, both, 2.0) == "angular z 0 deg/s, before 5.73 deg/s, at 0.00 s"


def test_commands_that_only_one_run_has_are_not_compared() -> None:
    bare = with_frames(drive(), commanded=())
    assert commands_until(bare, drive(), 2.0) is None
    # The commands that both have are the same, and nothing is known of the other.
    assert commands_until(with_frames(told([0.5, 0.5], 1.0), commanded=()), drive(), 2.0) is None
    assert commands_until(told([0.5, 0.5], 1.0), with_frames(told([0.5, 0.5], 1.0), commanded=()), 2.0) is None


def test_the_first_of_several_differences_counts() -> None:
    replay = drive()
    angles = np.where(np.arange(replay.frames.count) >= 10, 0.05, 0.0)
    z, w = (Column.encoded(part(angles / 2), 1e-5) for part in (np.sin, np.cos))
    # The heading differs at 0.33 s, the position from 1 s on.
    other = drive(distance=1.0101)
    found = parting(replay, with_frames(other, base=(*other.frames.base[:5], z, w)))
    assert found is not None
    assert found.time == pytest.approx(1 / 3, abs=0.01)
    assert found.words == "by more than 0.5 deg"

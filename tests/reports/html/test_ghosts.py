"""The ghosts of a page: the base run, the other engine and a repetition."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.recording.replay.columns import Column, TextColumn
from sim_action.recording.replay.replay_data import ChannelData, GoldenData, Replay
from sim_action.recording.replay.scene_data import BodyData, SceneData
from sim_action.reports import ReportOptions
from sim_action.reports.html.document import Page
from sim_action.reports.html.ghosts import (
    Parting,
    Tolerance,
    commands_until,
    golden_replay,
    motion_of,
    parting,
    same_motion_text,
    world_changes,
)
from sim_action.reports.html.report import page, write_html
from sim_action.results.outcome import ExpectationOutcome, Outcome, Repeats
from sim_action.results.shard_results import EarlierRun
from sim_action.state.verdict import Verdict
from tests.outcomes import gate_results, like, outcome, planned_gate, report_options, results, runs_of_gate
from tests.replays import drive, kept


def run(folder: Path, name: str, distance: float, *, holds: bool = True, **stated: object) -> Outcome:
    replay = kept(drive(distance=distance), folder, name)
    known = {"name": name, "replay": replay, "digest": f"{distance}", "engine": "PyBullet 3"}
    return like(outcome("a.sim.yml", holds=holds), **{**known, **stated})


def options(folder: Path, *old: Outcome) -> ReportOptions:
    against = EarlierRun("old", old, {id(each): folder / "old" for each in old}) if old else None
    return report_options(folder, against=against)


def ghosts(found: Page) -> list[list[dict[str, Any]]]:
    return [entry["ghosts"] for entry in json.loads(found.index)["scenarios"]]


def body(found: Page) -> str:
    return b"".join(found.body).decode()


def test_the_base_run_is_a_ghost_drawn_at_once_if_the_verdict_changed(tmp_path: Path) -> None:
    old = [run(tmp_path / "old", "a", 1.0), run(tmp_path / "old", "b", 1.0)]
    new = [run(tmp_path, "a", 0.5, holds=False), run(tmp_path, "b", 1.1)]
    found = page(results(*new), options(tmp_path, *old))
    [[ours], [theirs]] = ghosts(found)
    assert (ours["label"], ours["replay"], ours["shown"]) == ("base run", "ghost-s0", True)
    assert ours["parting"]["time"] == pytest.approx(0.0333, abs=1e-3)
    assert ours["parting"]["words"] == "The motions part at 0.03 s, by more than 5 mm"
    assert (theirs["replay"], theirs["shown"]) == ("ghost-s1", False)
    assert list(found.blocks)[:4] == ["replay-s0", "ghost-s0", "replay-s1", "ghost-s1"]
    # One command of the drive is wrong from the start on.
    text = body(found)
    assert "in its world, <b>wall starts 0.5 m elsewhere</b>; another command, <b>wheel_joint position " in text
    assert ", at 0.03 s</b>; the motions part at 0.03 s, by more than 5 mm; newly fails." in text
    assert "Compared with the base run (old): 1 newly fails, 1 still passes" in text


def test_ghosts_come_after_the_runs_that_failed_and_before_those_that_passed(tmp_path: Path) -> None:
    names = ["a", "b", "c"]
    old = [run(tmp_path / "old", name, 1.0) for name in names]
    new = [run(tmp_path, name, 0.5, holds=name == "c") for name in names]
    found = page(results(*new), options(tmp_path, *old))
    assert list(found.blocks)[:5] == ["replay-s0", "replay-s1", "ghost-s0", "ghost-s1", "replay-s2"]


def test_a_ghost_takes_no_room_from_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old = [run(tmp_path / "old", name, 1.0) for name in "ab"]
    new = [run(tmp_path, name, 0.5, holds=False) for name in "ab"]
    size = sum(len(block) for block in page(results(*new), options(tmp_path)).blocks.values())
    monkeypatch.setattr("sim_action.reports.html.document.MAX_REPLAY_BYTES", size + 300)
    found = page(results(*new), options(tmp_path, *old))
    assert list(found.blocks) == ["replay-s0", "replay-s1", "meshes"]
    assert [each["replay"] for [each] in ghosts(found)] == [None, None]


def test_the_same_motion_is_no_ghost(tmp_path: Path) -> None:
    found = page(results(run(tmp_path, "a", 1.0)), options(tmp_path, run(tmp_path / "old", "a", 1.0)))
    assert ghosts(found) == [[]]
    assert "Since the base run: it still passes." in body(found)
    # A world that changed is named all the same.
    old, new = run(tmp_path / "old", "a", 1.0), run(tmp_path, "a", 1.0)
    kept(drive(distance=1.0, body="pallet"), tmp_path, "a")
    found = page(results(new), options(tmp_path, old))
    assert ghosts(found) == [[]]
    assert "Since the base run: in its world, <b>pallet is new, wall is gone</b>; it still passes." in body(found)


def test_a_run_that_ends_earlier_does_not_part(tmp_path: Path) -> None:
    old, new = run(tmp_path / "old", "a", 1.0), run(tmp_path, "a", 0.5)
    short = drive(distance=0.5, seconds=1.0)
    kept(short, tmp_path, "a")
    found = page(results(new), options(tmp_path, old))
    [[ghost]] = ghosts(found)
    assert ghost["parting"]["words"] == "The motions are the same up to 1.00 s, where this run ends"
    assert "the motions are the same up to 1.00 s" in body(found)


@pytest.mark.parametrize("content", [None, b"", b"no replay"])
def test_a_replay_that_cannot_be_read_is_left_out_with_a_line(tmp_path: Path, content: bytes | None) -> None:
    old = run(tmp_path / "old", "a", 1.0)
    path = tmp_path / "old" / str(old.replay)
    path.unlink()
    if content is not None:
        path.write_bytes(content)
    found = page(results(run(tmp_path, "a", 0.5)), options(tmp_path, old))
    assert ghosts(found) == [[]]
    assert "The motion of the base run is not drawn: the replay " in body(found)


def test_no_scenario_in_common(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    new = results(run(tmp_path, "a", 0.5))
    write_html(new, options(tmp_path, run(tmp_path / "old", "a", 1.0)))
    assert capsys.readouterr().err == ""
    write_html(new, options(tmp_path, run(tmp_path / "old", "b", 1.0, file="b.sim.yml")))
    assert "--against old: no scenario has the file and name of one in this run" in capsys.readouterr().err
    several = results(run(tmp_path, "a", 0.5, holds=False), run(tmp_path, "c", 0.5))
    text = body(page(several, options(tmp_path, run(tmp_path / "old", "b", 1.0, file="b.sim.yml"))))
    assert "Nothing to compare: no scenario of old has the name of one here" in text
    assert "newly fails" not in text


def test_golden_trajectories_are_ghosts(tmp_path: Path) -> None:
    made = run(tmp_path, "a", 1.0)
    kept(like(drive(), golden=(golden(0.6), like(golden(0.6), position=0.25, yaw=0.1))), tmp_path, "a")
    found = page(results(made), options(tmp_path))
    [[one, other]] = ghosts(found)
    assert (one["label"], one["replay"], other["label"]) == ("golden trajectory", "golden-s0-1", "golden trajectory 2")
    assert one["parting"] == {"time": 1.0, "words": "The motions part at 1.00 s, by more than 5 mm"}
    # Its expectation allows more.
    assert other["parting"] is None
    assert other["alike"] == "The motions of the bases are the same, up to 250 mm or 5.73 deg"
    assert {"golden-s0-1", "golden-s0-2"} <= set(found.blocks)


def test_a_gate_says_what_changed(tmp_path: Path) -> None:
    planned = planned_gate(runs=3, passes={"at_least": "10 %", "confidence": "60 %"})
    old, new = (gate_results(planned, *runs_of_gate(planned, **counts)) for counts in ({"passed": 3}, {"failed": 3}))
    found = page(new, options(tmp_path, *old.outcomes))
    assert "Since the base run: newly fails" in body(found)
    # It says so if it claims less.
    strict, loose = (planned_gate(runs=3, passes={"at_least": rate, "confidence": "60 %"}) for rate in ("50 %", "10 %"))
    old, new = (gate_results(planned, *runs_of_gate(planned, passed=3)) for planned in (strict, loose))
    before = EarlierRun("old", old.outcomes, {}, old.gates)
    text = body(page(new, replace(options(tmp_path), against=before)))
    assert "Since the base run: weaker limit: passes: at least 10 %, was at least 50 %." in text


def test_a_scenario_in_another_engine_is_a_ghost_that_takes_no_room(tmp_path: Path) -> None:
    both = [
        run(tmp_path, "a [pybullet]", 1.0, number=1),
        run(tmp_path, "a [mujoco]", 1.1, number=1, engine="MuJoCo 3"),
        run(tmp_path, "b [mujoco]", 1.1, number=2, engine="MuJoCo 3"),
    ]
    found = page(results(*both), options(tmp_path))
    [[one], [other], alone] = ghosts(found)
    assert (one["label"], one["replay"]) == ("MuJoCo 3", "replay-s1")
    assert (other["label"], other["replay"]) == ("PyBullet 3", "replay-s0")
    assert one["parting"] == other["parting"]
    assert alone == []
    assert set(found.blocks) == {"replay-s0", "replay-s1", "replay-s2", "meshes"}


def test_the_first_repetition_that_differs_is_a_ghost_drawn_at_once(tmp_path: Path) -> None:
    other = kept(drive(distance=1.2), tmp_path, "a-run-2")
    repeats = Repeats(count=3, agreed=2, digests=2, replay=other)
    flaky = run(tmp_path, "a", 1.0, repeats=repeats)
    gone = run(tmp_path, "b", 1.0, repeats=like(repeats, replay="replays/gone.json.gz"))
    found = page(results(flaky, gone), options(tmp_path))
    [[ghost], none] = ghosts(found)
    shown = [ghost[key] for key in ("label", "replay", "shown", "repetition")]
    assert shown == ["another repetition", "repetition-s0", True, False]
    assert none == []


def parted(ours: Replay, theirs: Replay) -> Parting:
    found = parting(ours, theirs)
    assert found is not None
    return found


TIMES = Column(scale=1.0, first=0, deltas=(1, 1))
STILL = Column(scale=1.0, first=0)


def golden(metres_a_second: float, yaw: float = 0.0, joints: tuple[tuple[int, Column], ...] = ()) -> GoldenData:
    ahead = Column(scale=metres_a_second, first=0, deltas=(1, 1))
    heading = Column(scale=yaw or 1.0, first=int(yaw > 0))
    return GoldenData(expectation=0, time=TIMES, base=(ahead, STILL, STILL, heading), joints=joints)


def test_it_has_the_motion_of_the_file_and_is_a_valid_replay() -> None:
    """Joints that the file does not have stay as at the start."""
    replay = drive()
    found = golden_replay(replay, golden(0.5, yaw=1.0))
    count = found.frames.count
    assert found.frames.base[0].decoded(count).tolist() == [0.0, 0.5, 1.0]
    assert found.frames.base[5].decoded(count)[0] == pytest.approx(math.sin(0.5), abs=1e-5)
    assert found.scene.bodies == ()
    assert Replay.model_validate_json(motion_of(found, drive()).model_dump_json()) is not None
    assert golden_replay(replay, golden(0.5)).frames.joints[0].decoded(3).tolist() == [0.0, 0.0, 0.0]
    turning = Column(scale=0.1, first=0, deltas=(1, 1))
    assert golden_replay(replay, golden(0.5, joints=((0, turning),))).frames.joints == (turning,)
    # A run parts from it.
    assert parting(replay, golden_replay(replay, golden(0.5))) is None
    assert parted(replay, golden_replay(replay, golden(0.6))).time == 1.0


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


SCENE = drive().scene
WALL, *OTHERS = SCENE.bodies


def with_bodies(*bodies: BodyData) -> SceneData:
    return like(SCENE, bodies=bodies)


def named(*names: str) -> list[BodyData]:
    return [like(WALL, name=name) for name in names]


MOVED = like(WALL, pose=(WALL.pose[0] + 0.2, *WALL.pose[1:]))
PAINTED = tuple(like(shape, color=(0.1, 0.2, 0.3)) for shape in WALL.shapes)
TURNED = like(WALL, pose=(*WALL.pose[:3], 0.0, 0.0, 0.7071, 0.7071))


@pytest.mark.parametrize(
    ("ours", "theirs", "words"),
    [
        (SCENE, SCENE, ""),
        (SCENE, with_bodies(*OTHERS), "wall is new"),
        (with_bodies(*OTHERS), SCENE, "wall is gone"),
        (with_bodies(*named(*"abcde")), with_bodies(*named("a")), "b, c, d and 1 more are new"),
        (with_bodies(MOVED), with_bodies(WALL), "wall starts 0.2 m elsewhere"),
        (with_bodies(TURNED), with_bodies(WALL), "wall starts turned by 90 deg"),
        (with_bodies(like(WALL, shapes=())), with_bodies(WALL), "wall has another shape"),
        (drive(robot="husky").scene, SCENE, "the robot is husky, not cart"),
        (like(SCENE, links=SCENE.links[:1]), SCENE, "the model of the robot differs"),
        (with_bodies(*named("a\n<b>\u202e" + 60 * "c")), with_bodies(), f"a <b>{34 * 'c'}… is new"),
        # Below the tolerance of a motion, and only another colour.
        (with_bodies(like(WALL, pose=(WALL.pose[0] + 0.004, *WALL.pose[1:]))), with_bodies(WALL), ""),
        (with_bodies(like(WALL, shapes=PAINTED)), with_bodies(WALL), ""),
    ],
)
def test_what_differs_is_named(ours: SceneData, theirs: SceneData, words: str) -> None:
    assert world_changes(ours, theirs) == words


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


def test_motions_that_part() -> None:
    # The first moment beyond the tolerance counts.
    assert parting(drive(), drive()) is None
    assert parting(drive(), drive(distance=1.004)) is None
    # After 1 s of 2 s, 10 mm more are 5 mm.
    found = parted(drive(), drive(distance=1.0101))
    assert found.time == pytest.approx(1.0, abs=0.04)
    assert found.words == "by more than 5 mm"
    # A heading counts and a quaternion is its negative.
    found = parted(turned(0.0), turned(math.radians(2)))
    assert found.time == pytest.approx(0.5, abs=0.04)
    assert found.words == "by more than 0.5 deg"
    assert parting(turned(1.0), turned(1.0, sign=-1.0)) is None
    # Between two moments of the change of sign, too.
    once = turned(0.5, sign=-1.0)
    moments = once.frames.time
    shifted = with_frames(once, time=like(moments, first=moments.first + 167))
    assert parting(turned(0.5), shifted) is None
    # Runs that end apart part there.
    short = drive(seconds=1.0, distance=0.5)
    assert parting(short, drive()) == Parting(1.0, "where this run ends", is_end=True)
    assert parting(drive(), short) == Parting(1.0, "where the other run ends", is_end=True)
    # Some moments of the replay are too many.
    assert parting(drive(), drive(seconds=1.8, distance=0.9)) is not None


def test_motions_that_do_not_part() -> None:
    # Other moments of the same motion do not part.
    replay, coarse = drive(), drive()
    times = np.linspace(0, 2, 11)
    still = coarse.frames.base[1]
    ahead = Column.encoded(times / 2, 1e-4)
    coarse = with_frames(
        coarse, time=Column.encoded(times, 1e-4), base=(ahead, *coarse.frames.base[1:]), joints=(still,), speed=still
    )
    assert parting(replay, coarse) is None
    assert parting(coarse, replay) is None
    # What was not compared is not said to move alike.
    words = same_motion_text(drive(), drive(), Tolerance())
    assert words == "The motions of the bases are the same, up to 5 mm or 0.5 deg"
    for whole in (drive(distance=0.0), with_frames(like(drive(), joint_names=()), joints=())):
        words = same_motion_text(whole, whole, Tolerance())
        assert words == "The motions are the same, up to 5 mm or 0.5 deg"

    # A larger tolerance of the scenario counts.
    def agreed(limit: float, unit: str) -> ExpectationOutcome:
        (expected,) = outcome("a.sim.yml").expectations
        return like(expected, assertion="agreement", verdict=Verdict(True, 0.0, limit, limit, unit, 1.0, ""))

    made = like(outcome("a.sim.yml"), expectations=(agreed(0.2, "m"), agreed(1e-4, "rad")))
    tolerance = Tolerance.of(made)
    assert tolerance.words == "200 mm or 0.5 deg"
    assert Tolerance.of(outcome("a.sim.yml")) == Tolerance()
    assert parting(drive(), drive(distance=1.1), tolerance) is None
    assert Tolerance(position=2.0).words == "2 m or 0.5 deg"


def test_joints_count_where_no_base_moves() -> None:
    arm = drive(distance=0.0)
    bent = with_frames(arm, joints=(Column.encoded(np.linspace(0, 0.1, arm.frames.count), 1e-4),))
    assert parted(arm, bent).words == "by more than 0.5 deg"
    (wheel, *rest) = arm.scene.links[::-1]
    assert wheel.joint is not None
    slider = like(wheel, joint=like(wheel.joint, type="prismatic"))
    slid = like(arm, scene=like(arm.scene, links=(*rest[::-1], slider)))
    assert parted(slid, bent).words == "by more than 5 mm"
    assert parting(arm, like(bent, joint_names=("other",))) is None


def commanding(values: list[float], commanded: float, *, name: str = "linear x", unit: str = "m/s") -> Replay:
    """A drive whose joint command is that of `commanded`, with a channel of commands, one a second."""
    replay = drive()
    count = replay.frames.count
    time, speeds = (TextColumn.encoded(np.array(row, float), 1e-3) for row in (range(len(values)), values))
    channel = ChannelData(group="base", name=name, unit=unit, time=time, values=speeds, commanded=True)
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
        (([0.5, 0.3, 0.3], 1.2), ([0.5] * 3, 1.0), 2.0, "wheel_joint position 68.75 deg, before 57.3 deg, at 0.00 s"),
        (([0.5, math.nan, 0.3], 1.0), ([0.5, 0.5, 0.3], 1.0), 2.0, ""),
    ],
)
def test_the_first_command_that_differs_is_named(
    ours: tuple[list[float], float], theirs: tuple[list[float], float], until: float, words: str
) -> None:
    assert commands_until(commanding(*ours), commanding(*theirs), until) == words


def test_commands_that_differ() -> None:
    # A part of a twist that is not stored is zero.
    straight, turning = commanding([0.5] * 3, 1.0), commanding([0.1] * 3, 1.0, name="angular z", unit="rad/s")
    both = like(straight, channels=(*straight.channels, *turning.channels))
    assert commands_until(both, straight, 2.0) == "angular z 5.73 deg/s, before 0 deg/s, at 0.00 s"
    assert commands_until(straight, both, 2.0) == "angular z 0 deg/s, before 5.73 deg/s, at 0.00 s"
    # Commands that only one run has are not compared.
    bare = with_frames(drive(), commanded=())
    assert commands_until(bare, drive(), 2.0) is None
    # The commands that both have are the same, and nothing is known of the other.
    alone = with_frames(commanding([0.5, 0.5], 1.0), commanded=())
    assert commands_until(alone, drive(), 2.0) is None
    assert commands_until(commanding([0.5, 0.5], 1.0), alone, 2.0) is None
    # The first of several differences counts.
    replay = drive()
    angles = np.where(np.arange(replay.frames.count) >= 10, 0.05, 0.0)
    z, w = (Column.encoded(part(angles / 2), 1e-5) for part in (np.sin, np.cos))
    # The heading differs at 0.33 s, the position from 1 s on.
    other = drive(distance=1.0101)
    found = parted(replay, with_frames(other, base=(*other.frames.base[:5], z, w)))
    assert found.time == pytest.approx(1 / 3, abs=0.01)
    assert found.words == "by more than 0.5 deg"

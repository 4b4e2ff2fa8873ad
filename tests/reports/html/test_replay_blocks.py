"""The packed replays of a page: what fits, and what several share."""

from __future__ import annotations

import base64
import gzip
import json
from pathlib import Path

import pytest

from sim_action.recording.replay.replay_data import Replay, ReplayReader
from sim_action.recording.replay.scene_data import MAX_TEXT_LENGTH
from sim_action.reports.html.replay_blocks import ReplayBlocks, packed, page_json, stored_replay
from tests.outcomes import like, outcome
from tests.replays import MESH, drive, kept


def unpacked(block: str) -> bytes:
    return gzip.decompress(base64.b64decode(block))


def test_a_block_comes_apart_again_and_is_always_the_same() -> None:
    assert unpacked(packed(b"data")) == b"data"
    assert packed(b"data" * 100) == packed(b"data" * 100)


def test_a_replay_of_another_scenario_is_left_out(tmp_path: Path) -> None:
    ran = outcome("a.sim.yml")
    for name in (None, ran.name, "another one"):
        file = kept(like(drive(), scenario=name), tmp_path, "a")
        replay, missing = stored_replay(like(ran, replay=file), tmp_path, ReplayReader())
        assert (replay is None) == (name == "another one")
        assert ("it is of another scenario, 'another one'" in missing) == (replay is None)


def test_a_long_name_of_a_scenario_is_compared_as_far_as_it_is_stored(tmp_path: Path) -> None:
    ran = like(outcome("a.sim.yml"), name="n" * 2 * MAX_TEXT_LENGTH)
    file = kept(like(drive(), scenario=ran.name[:MAX_TEXT_LENGTH]), tmp_path, "a")
    replay, _ = stored_replay(like(ran, replay=file), tmp_path, ReplayReader())
    assert replay is not None


def test_json_ends_no_element_and_no_line() -> None:
    text = page_json({"a": "</script><!--\u2028"})
    assert "<" not in text
    assert text.isascii()
    assert json.loads(text) == {"a": "</script><!--\u2028"}


def test_a_replay_is_told_whole_but_for_its_meshes_which_stand_apart() -> None:
    replay_blocks, replay = ReplayBlocks(), drive()
    assert replay_blocks.add("replay-s0", replay)
    told_replay, meshes = (
        json.loads(unpacked(replay_blocks.blocks["replay-s0"])),
        json.loads(unpacked(replay_blocks.shared)),
    )
    assert set(meshes) == {MESH}
    told_replay["scene"]["meshes"] = meshes
    assert Replay.model_validate_json(json.dumps(told_replay)) == replay


def test_what_is_in_several_replays_is_there_once() -> None:
    replay_blocks = ReplayBlocks()
    for number in range(3):
        replay_blocks.add(f"replay-s{number}", drive())
    assert list(json.loads(unpacked(replay_blocks.shared))) == [MESH]


def test_beyond_the_room_that_there_is_nothing_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    replay_blocks = ReplayBlocks()
    replay_blocks.add("first", drive())
    monkeypatch.setattr("sim_action.reports.html.replay_blocks.MAX_REPLAY_BYTES", replay_blocks.size + 10)
    assert not replay_blocks.add("second", drive())
    assert list(replay_blocks.blocks) == ["first"]


def test_meshes_take_of_the_room_but_once(monkeypatch: pytest.MonkeyPatch) -> None:
    replay = drive()
    rough = like(replay.scene.meshes[MESH], points=tuple(i * i % 7919 for i in range(30_000)))
    large = like(replay, scene=like(replay.scene, meshes={MESH: rough}))
    replay_blocks = ReplayBlocks()
    assert replay_blocks.add("first", large)
    assert (
        replay_blocks.size
        >= len(replay_blocks.blocks["first"]) + len(replay_blocks.shared)
        > 10 * len(replay_blocks.blocks["first"])
    )
    monkeypatch.setattr(
        "sim_action.reports.html.replay_blocks.MAX_REPLAY_BYTES",
        replay_blocks.size + len(replay_blocks.blocks["first"]),
    )
    assert not ReplayBlocks(meshes={"0" * 16: rough}, size=len(replay_blocks.shared)).add("other", large)
    assert replay_blocks.add("second", large)


def test_ten_seconds_cost_little() -> None:
    replay_blocks = ReplayBlocks()
    replay_blocks.add("replay-s0", drive(seconds=10.0))
    assert replay_blocks.size < 25_000

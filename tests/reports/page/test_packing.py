from __future__ import annotations

import base64
import gzip
import json

import pytest

from sim_action.recording.replay import Replay
from sim_action.reports.page import packing
from sim_action.reports.page.packing import Parcel, packed, told
from tests.replays import MESH, drive


def unpacked(block: str) -> bytes:
    return gzip.decompress(base64.b64decode(block))


def test_a_block_comes_apart_again_and_is_always_the_same() -> None:
    assert unpacked(packed(b"data")) == b"data"
    assert packed(b"data" * 100) == packed(b"data" * 100)


def test_json_ends_no_element_and_no_line() -> None:
    text = told({"a": "</script><!--\u2028"})
    assert "<" not in text
    assert text.isascii()
    assert json.loads(text) == {"a": "</script><!--\u2028"}


def test_a_replay_is_told_whole_but_for_its_meshes_which_stand_apart() -> None:
    parcel, replay = Parcel(), drive()
    assert parcel.takes("replay-s0", replay)
    told_replay, meshes = json.loads(unpacked(parcel.blocks["replay-s0"])), json.loads(unpacked(parcel.shared))
    assert set(meshes) == {MESH}
    told_replay["scene"]["meshes"] = meshes
    assert Replay.model_validate_json(json.dumps(told_replay)) == replay


def test_what_is_in_several_replays_is_there_once() -> None:
    parcel = Parcel()
    for number in range(3):
        parcel.takes(f"replay-s{number}", drive())
    assert list(json.loads(unpacked(parcel.shared))) == [MESH]


def test_beyond_the_room_that_there_is_nothing_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    parcel = Parcel()
    parcel.takes("first", drive())
    monkeypatch.setattr(packing, "MOST_BYTES", parcel.size + 10)
    assert not parcel.takes("second", drive())
    assert list(parcel.blocks) == ["first"]


def test_meshes_take_of_the_room_but_once(monkeypatch: pytest.MonkeyPatch) -> None:
    replay = drive()
    rough = replay.scene.meshes[MESH].model_copy(update={"points": tuple(i * i % 7919 for i in range(30_000))})
    large = replay.model_copy(update={"scene": replay.scene.model_copy(update={"meshes": {MESH: rough}})})
    parcel = Parcel()
    assert parcel.takes("first", large)
    assert parcel.size >= len(parcel.blocks["first"]) + len(parcel.shared) > 10 * len(parcel.blocks["first"])
    monkeypatch.setattr(packing, "MOST_BYTES", parcel.size + len(parcel.blocks["first"]))
    assert not Parcel(meshes={"0" * 16: rough}, size=len(parcel.shared)).takes("other", large)
    assert parcel.takes("second", large)


def test_ten_seconds_cost_little() -> None:
    parcel = Parcel()
    parcel.takes("replay-s0", drive(seconds=10.0))
    assert parcel.size < 25_000

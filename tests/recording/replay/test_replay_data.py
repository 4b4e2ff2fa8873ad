"""Replay files: what is written is read, and whatever a stranger wrote is read within bounds, or not at all."""

from __future__ import annotations

import gzip
import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sim_action.recording.replay import replay_data
from sim_action.recording.replay.build import replay_of
from sim_action.recording.replay.columns import Column
from sim_action.recording.replay.replay_data import GoldenData
from tests.soak import soaked
from tests.traces import SEEN, contact, scene, trace

Change = Callable[[dict[str, Any]], object]


def written(path: Path) -> dict[str, Any]:
    """A replay on disk, and what is in it."""
    seen = trace([0.0, 0.1, 0.2], x=[0.0, 0.1, 0.3], contacts=[contact(0.1)])
    replay_data.write_replay(replay_of(scene(), seen), path)
    found: dict[str, Any] = json.loads(gzip.decompress(path.read_bytes()))
    return found


def test_what_is_written_is_read_and_the_same_each_time(tmp_path: Path) -> None:
    # What is written is read.
    path = tmp_path / "replays" / "a.json.gz"
    replay = replay_of(scene(), SEEN)
    replay_data.write_replay(replay, path)
    assert replay_data.read_replay(path) == replay
    # The same run is the same file.
    for name in ("a", "b"):
        replay_data.write_replay(replay_of(scene(), SEEN), tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@pytest.mark.parametrize("version", [0, 3])
def test_a_file_of_another_version_says_so(tmp_path: Path, version: int) -> None:
    found = written(tmp_path / "a") | {"version": version}
    (tmp_path / "a").write_bytes(gzip.compress(json.dumps(found).encode()))
    words = rf"another version of sim-action \(format {version}; this one reads 1 and 2\)"
    with pytest.raises(replay_data.ReplayError, match=words):
        replay_data.read_replay(tmp_path / "a")


def test_a_truncated_file_says_so(tmp_path: Path) -> None:
    written(tmp_path / "a")
    whole = (tmp_path / "a").read_bytes()
    (tmp_path / "a").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(replay_data.ReplayError, match="the file is truncated"):
        replay_data.read_replay(tmp_path / "a")


def at(*steps: str | int, value: Any) -> Change:
    """Puts a value where these keys and places lead."""

    def change(replay: dict[str, Any]) -> None:
        inside: Any = replay
        for step in steps[:-1]:
            inside = inside[step]
        inside[steps[-1]] = value

    return change


SHAPE = {"kind": "box", "size": [1, 1, 1], "pose": [0, 0, 0, 0, 0, 0, 1], "color": [0, 0, 0]}
MESH = {"scale": 1.0, "points": [0] * 9, "triangles": [0, 1, 2]}  # three points, in differences
SIGNAL = {"expectation": 0, "name": "a", "unit": "m", "values": {"scale": 1.0, "first": 0}}
CHANNEL = {"group": "a", "name": "a", "unit": "m", "values": {"scale": 1.0, "first": 0, "deltas": "$"}}
STILL = {"scale": 1.0, "first": 0}
SCAN = {
    "sensor": "front",
    "link": 0,
    "pose": SHAPE["pose"],
    "first_angle": 0,
    "increment": 1,
    "rays": 1,
    "range": 5,
    "time": STILL,
    "scale": 0.01,
    "ranges": [100],
}
MANY_SCANS = {**SCAN, "rays": 360, "time": {**STILL, "deltas": [1] * 399}, "ranges": [100] * 144_000}
MANY_TRACKS = {
    "time": {**STILL, "deltas": [1] * 19_999},
    "base": [STILL] * 7,
    "joints": [STILL] * 2,
    "speed": STILL,
    "tilt": STILL,
    "tracks": [[STILL] * 7] * 400,
}
HOSTILE: dict[str, Change] = {
    "an unknown key": at("script", value="alert(1)"),
    "no link": at("scene", "links", value=[]),
    "a base with a parent": at("scene", "links", 0, "parent", value=0),
    "a parent after its child": at("scene", "links", 1, "parent", value=3),
    "a parent that is not there": at("scene", "links", 1, "parent", value=999_999),
    "a joint without a column": at("scene", "links", 1, "joint", "column", value=2),
    "an unknown shape": at("scene", "links", 0, "shapes", value=[{**SHAPE, "kind": "script"}]),
    "a size of two": at("scene", "links", 0, "shapes", value=[{**SHAPE, "size": [1, 1]}]),
    "a colour beyond white": at("scene", "links", 0, "shapes", value=[{**SHAPE, "color": [2, 0, 0]}]),
    "more than opaque": at("scene", "links", 0, "shapes", value=[{**SHAPE, "opacity": 1.5}]),
    "less than invisible": at("scene", "links", 0, "shapes", value=[{**SHAPE, "opacity": -0.1}]),
    "an opacity that is no number": at("scene", "links", 0, "shapes", value=[{**SHAPE, "opacity": "none"}]),
    "a note without an end": at("scene", "notes", value=["a" * 301]),
    "notes without an end": at("scene", "notes", value=["a"] * 9),
    "a ground of two colours of three": at("scene", "ground", value={"color": [0, 0]}),
    "a ground beyond white": at("scene", "ground", value={"color": [0, 0, 2]}),
    "squares of no size": at("scene", "ground", value={"color": [0, 0, 0], "checker": [1, 1, 1], "square": 0}),
    "a million shapes": at("scene", "links", 0, "shapes", value=[SHAPE] * 200_000),
    "a body that is nowhere": at("scene", "bodies", 0, "pose", value=[1e300, 0, 0, 0, 0, 0, 1]),
    "a track that is not there": at("scene", "bodies", 0, "track", value=0),
    "a mesh that is not there": at("scene", "links", 0, "shapes", value=[{**SHAPE, "kind": "mesh", "mesh": "0" * 16}]),
    "a triangle without a point": at("scene", "meshes", value={"0" * 16: {**MESH, "triangles": [0, 1, 3]}}),
    "a triangle before the first point": at("scene", "meshes", value={"0" * 16: {**MESH, "triangles": [2, -3, 0]}}),
    "half a triangle": at("scene", "meshes", value={"0" * 16: {**MESH, "triangles": [0, 1, 2, 0]}}),
    "a mesh with a name of its own": at("scene", "meshes", value={"<script>": MESH}),
    "a column that is too short": at("frames", "base", 0, "deltas", value=[1]),
    "a column of words": at("frames", "base", 0, "deltas", value=["1", "2"]),
    "a number beyond JavaScript's": at("frames", "base", 0, "first", value=2**60),
    "time that stands": at("frames", "time", "deltas", value=[8, 0]),
    "time that never ends": at("frames", "time", "scale", value=1e300),
    "a base that is nowhere for a moment": at("frames", "base", 0, "gaps", value=[[0, 1]]),
    "a base beyond all numbers": at("frames", "base", 0, "scale", value=1e300),
    "a joint beyond all numbers": at("frames", "joints", 0, "scale", value=1e300),
    "gaps that overlap": at("frames", "speed", "gaps", value=[[0, 2]] * 3),
    "four hundred bodies that never move, for eleven minutes": at("frames", value=MANY_TRACKS),
    "a gap beyond the end": at("frames", "base", 0, "gaps", value=[[1, 5]]),
    "a contact of no link": at("contacts", 0, "link", value=99),
    "a contact of no body": at("contacts", 0, "body", value=99),
    "forces without a period": at("contacts", 0, "forces", value={"scale": 1.0, "first": 0}),
    "a period of nothing": at("contacts", 0, "period", value=0),
    "a thousand contacts": lambda replay: replay.update(contacts=replay["contacts"] * 1000),
    "a signal that is too short": at(
        "signals", value=[{**SIGNAL, "values": {"scale": 1.0, "first": 0, "deltas": [1]}}]
    ),
    "a scan of no link": at("scans", value=[{**SCAN, "link": 99}]),
    "a scan with too few rays": at("scans", value=[{**SCAN, "rays": 2}]),
    "scans whose times stand": at("scans", value=[{**SCAN, "time": {**STILL, "deltas": [0]}, "ranges": [1, 1]}]),
    "more scans than fit": at("scans", value=[{**MANY_SCANS, "sensor": name} for name in ("a", "b", "c")]),
    "an obstacle of no body": at("obstacles", value=[{"body": 99}]),
    "an obstacle seen without a sensor": at("obstacles", value=[{"body": 0, "seen": [{"sensor": "", "time": 0}]}]),
    "a mark of no kind": at("marks", value=[{"kind": "image", "x": 0, "y": 0}]),
    "a mark of no link": at("marks", value=[{"kind": "circle", "x": 0, "y": 0, "radius": 1, "link": 99}]),
    "a name without an end": at("joint_names", value=["a" * 10_000, "b"]),
    "names that are too few": at("joint_names", value=["a"]),
    "commands of too few joints": at("frames", "commanded", value=[None]),
    "a channel of another length": at("channels", value=[CHANNEL]),
    "a channel whose times do not rise": at(
        "channels", value=[{**CHANNEL, "time": {"scale": 1.0, "first": 0, "deltas": " "}}]
    ),
    "a command of another length": at("frames", "commanded", value=[None, {"scale": 1.0, "first": 0, "deltas": [1]}]),
}


def refusal(before: Path, path: Path) -> str:
    """Why a replay is refused: the same after one with its scene."""
    reader = replay_data.ReplayReader()
    reader.read(before)
    with pytest.raises(replay_data.ReplayError) as alone:
        replay_data.read_replay(path)
    with pytest.raises(replay_data.ReplayError) as after:
        reader.read(path)
    assert str(after.value) == str(alone.value)
    return str(alone.value)


@pytest.mark.parametrize("name", soaked(HOSTILE, short=set(HOSTILE) - {"a million shapes"}))
def test_what_does_not_fit_together_is_refused(name: str, tmp_path: Path) -> None:
    before, path = tmp_path / "before", tmp_path / "a.json.gz"
    written(before)
    content = written(path)
    replay_data.read_replay(path)
    HOSTILE[name](content)
    path.write_bytes(gzip.compress(json.dumps(content, separators=(",", ":")).encode(), 1))
    assert re.match(r"a\.json\.gz: not a valid replay: (?!Value error)", refusal(before, path))


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"no gzip",
        gzip.compress(b"{"),
        gzip.compress(b"\xff\xfe"),
        gzip.compress(b"[" * 1_000_000),
        gzip.compress(b'{"scene":' * 100_000),
        gzip.compress(b'{"version": 1, "version": 2}'),
        gzip.compress(b"[" + b"9" * 100_000 + b"]"),
        gzip.compress(b'{"version": NaN}'),
        gzip.compress(b"{}")[:-9],
    ],
    ids=["empty", "plain", "half", "no text", "deep", "deep maps", "twice", "digits", "NaN", "cut off"],
)
def test_what_is_no_replay_is_refused(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.json.gz"
    path.write_bytes(data)
    with pytest.raises(replay_data.ReplayError):
        replay_data.read_replay(path)


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_what_is_no_number_is_refused(number: str, tmp_path: Path) -> None:
    path = tmp_path / "a.json.gz"
    found = written(path)
    found["scene"]["bodies"][0]["pose"][0] = "here"
    path.write_bytes(gzip.compress(json.dumps(found).replace('"here"', number).encode()))
    with pytest.raises(replay_data.ReplayError):
        replay_data.read_replay(path)


def test_a_small_file_that_holds_much_and_a_link_are_refused(tmp_path: Path) -> None:
    # A small file that holds much is not unpacked.
    path = tmp_path / "a.json.gz"
    path.write_bytes(gzip.compress(b" " * (replay_data.MAX_UNPACKED_BYTES + 1), 1))
    with pytest.raises(replay_data.ReplayError, match="the unpacked data has more than 24 MB"):
        replay_data.read_replay(path)
    # A link is not followed.
    written(tmp_path / "b.json.gz")
    path.unlink()
    path.symlink_to("b.json.gz")
    # A report that others read has no path of this machine.
    with pytest.raises(replay_data.ReplayError, match=r"^a\.json\.gz: not a valid replay: [^/]*$"):
        replay_data.read_replay(tmp_path / "a.json.gz")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes of this kind here")
def test_a_pipe_holds_nobody_up(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.json.gz")
    with pytest.raises(replay_data.ReplayError):
        replay_data.read_replay(tmp_path / "a.json.gz")


def test_replays_of_equal_scenes_share_the_scene_and_are_equal_to_those_read_alone(tmp_path: Path) -> None:
    moved = trace([0.0, 0.1, 0.2], x=[0.0, 0.2, 0.6], contacts=[contact(0.1)])
    for name, seen in (("a", SEEN), ("b", moved), ("c", SEEN)):
        replay_data.write_replay(replay_of(scene(), seen), tmp_path / name)
    reader = replay_data.ReplayReader()
    found = [reader.read(tmp_path / name) for name in ("a", "b", "c")]
    assert found == [replay_data.read_replay(tmp_path / name) for name in ("a", "b", "c")]
    assert found[0].scene is found[1].scene is found[2].scene


def test_a_second_scene_in_a_file_counts_as_without_a_reader_that_knows_the_first_one(tmp_path: Path) -> None:
    before, path = tmp_path / "before", tmp_path / "replay"
    written(before)
    data = gzip.decompress(before.read_bytes())
    other = b'"scene":{"robot":"other","links":[{"name":"base"}]}'
    path.write_bytes(gzip.compress(data[:-1] + b"," + other + b"}"))
    assert refusal(before, path)


AT_REST = Column(scale=1.0, first=0)
TIMES = Column(scale=0.1, first=0, deltas=(1, 1))


@pytest.mark.parametrize(
    ("time", "column", "index", "fits"),
    [
        (TIMES, AT_REST, 0, True),
        (TIMES, Column(scale=1.0, first=0, deltas=(1, -1)), 0, True),
        (TIMES, Column(scale=1.0, first=0, deltas=(1,)), 0, False),
        (TIMES, AT_REST, 1, False),
        (TIMES, Column(scale=1e300, first=2**53), 0, False),
        (TIMES, Column(scale=1.0, first=0, gaps=((1, 1),)), 0, False),
        (Column(scale=1e9, first=0, deltas=(1, 1)), AT_REST, 0, False),
        (Column(scale=0.1, first=0, deltas=(1, 0)), AT_REST, 0, False),
        (Column(scale=0.1, first=0, deltas=(1, 1), gaps=((0, 1),)), AT_REST, 0, False),
    ],
)
def test_columns_fit_times_and_joints_those_of_the_run(time: Column, column: Column, index: int, fits: bool) -> None:
    golden = GoldenData(expectation=0, time=time, base=(AT_REST, AT_REST, AT_REST, column), joints=((index, AT_REST),))
    assert golden.fits(joints=1) is fits

"""."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.recording.replay.replay_data import Replay, ReplayReader
from sim_action.recording.replay.scene_data import MAX_TEXT_LENGTH
from sim_action.reports.escaping import plain_text
from sim_action.reports.html.document import (
    LIVE_SCRIPT,
    SCRIPTS,
    Html,
    Page,
    ReplayBlocks,
    element,
    packed,
    page_json,
    page_script,
    policy,
    stored_replay,
    text,
)
from tests.outcomes import like, outcome
from tests.replays import MESH, drive, kept


def hash_of(content: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()}"


def page_text() -> str:
    body, blocks = [b"<main></main>"], {"a": "QQ=="}
    return Page("title </title><script>", failed=True, body=body, index="{}", blocks=blocks, has_replays=True).text()


def test_the_policy_and_the_title_of_a_page() -> None:
    # What runs and what styles is allowed by its hash.
    [script] = re.findall(r"<script>(.*?)</script>", page_text(), re.DOTALL)
    [style] = re.findall(r"<style>(.*?)</style>", page_text(), re.DOTALL)
    allowed = re.findall(r"sha256-[A-Za-z0-9+/=]+", page_text())
    assert {hash_of(script), hash_of(style)} <= set(allowed)
    # Nothing else may be done.
    told = policy("'sha256-a'", ["'sha256-b'"])
    assert told.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe" not in told
    assert told.count("sha256-") == 2
    assert "<title>title &lt;/title&gt;&lt;script&gt;</title>" in page_text()


def test_the_script_of_the_page() -> None:
    # The script is made of all its parts and ends no element.
    assert "</script" not in page_script().lower()
    assert "<!--" not in page_script()
    assert len(set(SCRIPTS)) == len(SCRIPTS)
    # Every script beside the page is in it.
    from importlib.resources import files

    folder = Path(str(files("sim_action.reports") / "viewer"))
    assert {file.relative_to(folder).as_posix() for file in folder.rglob("*.js")} == {*SCRIPTS, LIVE_SCRIPT}


class Seen(HTMLParser):
    """What a reader of HTML finds."""

    def __init__(self, markup: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, list[tuple[str, str | None]]]] = []
        self.text = ""
        self.feed(markup)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, attrs))

    def handle_data(self, data: str) -> None:
        self.text += data


@given(st.text(), st.text())
def test_whatever_text_is_it_stays_text(words: str, title: str) -> None:
    seen = Seen(element("p", words, title=title))
    assert seen.text == plain_text(words)
    assert seen.tags == [("p", [("title", plain_text(title))])]


def test_texts_and_attributes_of_elements() -> None:
    assert element("p", element("b", "<"), Html("&amp;")) == "<p><b>&lt;</b>&amp;</p>"
    assert text("a\u202eb") == "ab"
    # False and none omit an attribute and zero does not.
    made = element("span", hidden=True, title=None, open=False, data_time=0.0, x=0)
    assert made == '<span hidden data-time="0.0" x="0"></span>'


def unpacked(block: str) -> bytes:
    return gzip.decompress(base64.b64decode(block))


def test_blocks_and_json_of_a_page() -> None:
    # A block comes apart again and is always the same.
    assert unpacked(packed(b"data")) == b"data"
    assert packed(b"data" * 100) == packed(b"data" * 100)
    # Json ends no element and no line.
    text = page_json({"a": "</script><!--\u2028"})
    assert "<" not in text
    assert text.isascii()
    assert json.loads(text) == {"a": "</script><!--\u2028"}
    # Ten seconds cost little.
    replay_blocks = ReplayBlocks()
    replay_blocks.add("replay-s0", drive(seconds=10.0))
    assert replay_blocks.size < 25_000


def test_replays_of_other_scenarios(tmp_path: Path) -> None:
    # A replay of another scenario is left out.
    ran = outcome("a.sim.yml")
    for name in (None, ran.name, "another one"):
        file = kept(like(drive(), scenario=name), tmp_path, "a")
        replay, missing = stored_replay(like(ran, replay=file), tmp_path, ReplayReader())
        assert (replay is None) == (name == "another one")
        assert ("it is of another scenario, 'another one'" in missing) == (replay is None)
    # A long name of a scenario is compared as far as it is stored.
    ran = like(outcome("a.sim.yml"), name="n" * 2 * MAX_TEXT_LENGTH)
    file = kept(like(drive(), scenario=ran.name[:MAX_TEXT_LENGTH]), tmp_path, "a")
    replay, _ = stored_replay(like(ran, replay=file), tmp_path, ReplayReader())
    assert replay is not None


def test_a_replay_is_told_whole_but_for_its_meshes_which_stand_apart() -> None:
    replay_blocks, replay = ReplayBlocks(), drive()
    assert replay_blocks.add("replay-s0", replay)
    whole = json.loads(unpacked(replay_blocks.blocks["replay-s0"]))
    whole["scene"]["meshes"] = json.loads(unpacked(replay_blocks.shared))
    assert set(whole["scene"]["meshes"]) == {MESH}
    assert Replay.model_validate_json(json.dumps(whole)) == replay
    # What is in several replays is there once.
    replay_blocks = ReplayBlocks()
    for number in range(3):
        replay_blocks.add(f"replay-s{number}", drive())
    assert list(json.loads(unpacked(replay_blocks.shared))) == [MESH]


def test_beyond_the_room_that_there_is_nothing_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    replay_blocks = ReplayBlocks()
    replay_blocks.add("first", drive())
    monkeypatch.setattr("sim_action.reports.html.document.MAX_REPLAY_BYTES", replay_blocks.size + 10)
    assert not replay_blocks.add("second", drive())
    assert list(replay_blocks.blocks) == ["first"]


def test_meshes_take_of_the_room_but_once(monkeypatch: pytest.MonkeyPatch) -> None:
    replay = drive()
    rough = like(replay.scene.meshes[MESH], points=tuple(i * i % 7919 for i in range(30_000)))
    large = like(replay, scene=like(replay.scene, meshes={MESH: rough}))
    replay_blocks = ReplayBlocks()
    assert replay_blocks.add("first", large)
    first = len(replay_blocks.blocks["first"])
    assert replay_blocks.size >= first + len(replay_blocks.shared) > 10 * first
    monkeypatch.setattr("sim_action.reports.html.document.MAX_REPLAY_BYTES", replay_blocks.size + first)
    assert not ReplayBlocks(meshes={"0" * 16: rough}, size=len(replay_blocks.shared)).add("other", large)
    assert replay_blocks.add("second", large)

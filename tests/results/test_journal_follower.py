"""A journal is followed while a call writes it, and after another call has replaced it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sim_action.results import journal_follower
from sim_action.results.events import Finished, Started
from sim_action.results.journal import JOURNAL_FILE, read_journal
from sim_action.results.journal_follower import JournalFollower
from tests.results.test_journal import begun, outcome


def finished(follower: JournalFollower) -> list[int]:
    follower.look()
    assert follower.recorded is not None
    return sorted(follower.recorded.finished)


def test_each_look_finds_what_is_new(tmp_path: Path) -> None:
    follower = JournalFollower(tmp_path)
    follower.look()
    assert (follower.recorded, follower.call, follower.problem) == (None, 0, "")
    journal = begun(tmp_path)
    assert finished(follower) == []
    journal(Started(1, 1, "b"))
    journal(Finished(1, outcome("b")))
    assert finished(follower) == [1]
    assert not follower.is_over
    journal(Finished(0, outcome("a")))
    journal.close()
    assert finished(follower) == [0, 1]
    assert follower.is_over
    assert follower.call == 1
    assert follower.recorded is not None
    assert follower.recorded.results() == read_journal(tmp_path).results()


def test_results_so_far_are_those_that_are_final(tmp_path: Path) -> None:
    journal = begun(tmp_path)
    journal(Finished(2, outcome("c")))
    journal(Finished(1, outcome("b")))
    recorded = read_journal(tmp_path)
    assert [each.name for each in recorded.results_so_far().outcomes] == ["b", "c"]


def test_an_unfinished_line_is_read_once_it_is_finished(tmp_path: Path) -> None:
    journal = begun(tmp_path)
    journal(Finished(0, outcome("a")))
    path = tmp_path / JOURNAL_FILE
    whole = path.read_bytes()
    follower = JournalFollower(tmp_path)
    path.write_bytes(whole[:-20])
    assert finished(follower) == []
    with path.open("ab") as file:
        file.write(whole[-20:])
    assert finished(follower) == [0]


def test_the_journal_of_another_call_is_read_from_its_beginning(tmp_path: Path) -> None:
    follower = JournalFollower(tmp_path)
    begun(tmp_path)(Finished(0, outcome("a")))
    assert finished(follower) == [0]
    begun(tmp_path)(Finished(1, outcome("b")))
    assert finished(follower) == [1]
    assert follower.call == 2


def test_another_call_with_the_same_inode_is_noticed(tmp_path: Path) -> None:
    """The file keeps its inode, and is as long: only its content differs."""
    path = tmp_path / JOURNAL_FILE
    begun(tmp_path)(Finished(0, outcome("a")))
    follower = JournalFollower(tmp_path)
    assert finished(follower) == [0]
    other = (
        path.read_bytes()
        .replace(b'"place":0', b'"place":2')
        .replace(b'"name":"a","file":"s.sim.yml","status', b'"name":"c","file":"s.sim.yml","status')
    )
    with path.open("r+b") as file:
        file.write(other)
    assert finished(follower) == [2]


def test_a_journal_that_is_removed_is_forgotten(tmp_path: Path) -> None:
    begun(tmp_path)
    follower = JournalFollower(tmp_path)
    follower.look()
    (tmp_path / JOURNAL_FILE).unlink()
    follower.look()
    assert follower.recorded is None
    assert follower.problem == ""


@pytest.mark.parametrize("line", [b"{}\n", b"[" * 100_000 + b"\n", b"\xff\xfe\n", b'{"journal": 2}\n'])
def test_a_file_that_is_no_journal_is_told(tmp_path: Path, line: bytes) -> None:
    (tmp_path / JOURNAL_FILE).write_bytes(line)
    follower = JournalFollower(tmp_path)
    follower.look()
    assert follower.recorded is None
    assert follower.problem.startswith(f"{JOURNAL_FILE} is not a valid journal: ")
    assert "\n" not in follower.problem


def test_hostile_lines_are_left_out(tmp_path: Path) -> None:
    begun(tmp_path)(Finished(0, outcome("a")))
    with (tmp_path / JOURNAL_FILE).open("ab") as file:
        file.write(b'{"at": 1e999, "event": "ended"}\n{"at": 0, "event": "started", "place": 99}\nnull\n\xff\n')
    follower = JournalFollower(tmp_path)
    assert finished(follower) == [0]
    assert not follower.is_over


@pytest.mark.skipif(not hasattr(os, "O_NOFOLLOW"), reason="links need rights there")
def test_a_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    begun(tmp_path / "other")
    (tmp_path / JOURNAL_FILE).symlink_to(tmp_path / "other" / JOURNAL_FILE)
    follower = JournalFollower(tmp_path)
    follower.look()
    assert follower.recorded is None
    assert "cannot be read" in follower.problem


def test_a_large_journal_is_read_in_several_looks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = begun(tmp_path)
    for place, name in enumerate("abc"):
        journal(Finished(place, outcome(name)))
    monkeypatch.setattr(journal_follower, "_MAX_BYTES_OF_LOOK", 300)
    follower = JournalFollower(tmp_path)
    looks = 0
    while not looks or follower.has_more:
        follower.look()
        looks += 1
    assert looks > 2
    assert finished(follower) == [0, 1, 2]

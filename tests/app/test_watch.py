"""What `run --watch` waits for, and what it then runs; the whole of it is in integration/test_watch.py."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from sim_action.app import watch
from sim_action.app.watch import _wait, _Watched
from sim_action.core.process import Interruption
from sim_action.scenario.watched_files import stamps


@pytest.fixture
def interruption() -> Iterator[Interruption]:
    with Interruption() as entered:
        yield entered


@pytest.fixture
def watched(tmp_path: Path) -> _Watched:
    """One file in a folder."""
    file = tmp_path / "a.sim.yml"
    file.write_text("name: a\n")
    return _Watched({file: frozenset({file})}, frozenset({tmp_path}), stamps([file, tmp_path]))


def saved(pieces: list[str], file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each time that it sleeps, the next piece is written to the file."""
    left = iter(pieces)

    def sleep(_seconds: float, _interruption: Interruption) -> None:
        if piece := next(left, None):
            file.write_text(file.read_text() + piece)

    monkeypatch.setattr(watch, "_sleep", sleep)


def test_saved_pieces_are_awaited(
    watched: _Watched, interruption: Interruption, monkeypatch: pytest.MonkeyPatch
) -> None:
    (file,) = watched.files
    saved(["", "", "robot: ", "{model: ", "turtlebot3_burger}\n"], file, monkeypatch)
    assert _wait(watched, interruption) == {file}
    assert file.read_text() == "name: a\nrobot: {model: turtlebot3_burger}\n"


def test_nothing_is_left_to_do_once_it_is_interrupted(
    watched: _Watched, interruption: Interruption, monkeypatch: pytest.MonkeyPatch
) -> None:
    (file,) = watched.files

    def sleep(_seconds: float, noticing: Interruption) -> None:
        file.write_text("name: b\n")
        noticing.happened = True

    monkeypatch.setattr(watch, "_sleep", sleep)
    assert _wait(watched, interruption) == set()


def test_a_change_that_was_undone_meanwhile_touches_nothing(
    watched: _Watched, interruption: Interruption, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (file,) = watched.files
    first = stamps(watched.seen)
    looks = iter([{**first, file: None}, first, first])
    monkeypatch.setattr(watch, "_sleep", lambda *_: None)
    monkeypatch.setattr(watch, "stamps", lambda _paths: next(looks))
    assert _wait(watched, interruption) == {tmp_path}
    assert watched.touched({tmp_path}) == []


def test_a_scenario_is_touched_by_all_that_it_is_made_of(tmp_path: Path) -> None:
    first, second, shared, own = (tmp_path / name for name in ("1.sim.yml", "2.sim.yml", "shared.urdf", "own.stl"))
    watched = _Watched({first: frozenset({first, shared}), second: frozenset({second, shared, own})})
    assert watched.touched({shared}) == [first, second]
    assert watched.touched({own, tmp_path}) == [second]
    assert watched.touched({tmp_path}) == []

"""Which program is meant, and what is said if there is none."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from sim_action.commands.process import program_of
from sim_action.core.workspace import PathError, Workspace


def found(folder: Path, word: str) -> Path:
    return program_of(word, Workspace(folder, folder))


def test_a_word_is_looked_for_on_path(tmp_path: Path) -> None:
    there = shutil.which("sh")
    assert there is not None
    assert found(tmp_path, "sh") == Path(there)


def test_a_word_with_a_slash_is_a_file_of_the_workspace(tmp_path: Path) -> None:
    program = tmp_path / "bin/controller"
    program.parent.mkdir()
    program.touch(0o700)
    assert found(tmp_path, "./bin/controller") == found(tmp_path, "bin/controller") == program


def test_a_link_is_run_under_its_own_name(tmp_path: Path) -> None:
    # By which a Python knows its virtual environment, and busybox its applet.
    (tmp_path / "program").touch(0o700)
    (tmp_path / "link").symlink_to("program")
    assert found(tmp_path, "./link") == tmp_path / "link"


@pytest.mark.parametrize(
    ("word", "why"),
    [
        ("no-such-program", "no program 'no-such-program' is on PATH"),
        ("controller", "no program 'controller' is on PATH; the file beside the scenario is './controller'"),
        ("./controller", "'./controller' may not be executed; chmod +x, or begin with what runs it"),
        ("./absent", "'./absent' does not exist"),
        ("../out", "outside the workspace"),
        ("/bin/sh", "outside the workspace"),
        ("./", "is a folder"),
    ],
)
def test_what_is_no_program(word: str, why: str, tmp_path: Path) -> None:
    (tmp_path / "controller").touch(0o600)
    with pytest.raises(PathError) as raised:
        found(tmp_path, word)
    assert why in str(raised.value)

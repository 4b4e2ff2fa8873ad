"""Python files of the user's, as text and as code; what controllers and assertions make of them is tested there."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from sim_action.errors import ScriptError
from sim_action.python_files import ScriptProblem, read_script, run_file, script_error


def names(folder: Path, text: str) -> set[str]:
    (folder / "a.py").write_text(text, encoding="utf-8")
    return set(read_script(folder / "a.py").names)


def test_names_are_those_outside_of_functions_and_classes(tmp_path: Path) -> None:
    text = "import os\nfrom x import y as z\nclass A:\n    b = 1\ndef c():\n    d = 2\nif A:\n    e = 3\n"
    assert names(tmp_path, text) == {"os", "z", "A", "c", "e"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def f(:\n", "^:1: not valid Python"),
        ("x = 1\0", "not valid Python"),
        ("#" * 1_000_001, "more than 1000 kB"),
        ("(" * 5000, "not valid Python"),
    ],
)
def test_what_is_no_python(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ScriptProblem, match=message):
        names(tmp_path, text)


def test_running_gives_what_is_left_and_errors_their_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", list(sys.path))
    file = tmp_path / "a.py"
    file.write_text("x = 1\n")
    assert run_file(file, "it")["x"] == 1
    file.write_text("x = 1\nraise ValueError('no')\n")
    with pytest.raises(ScriptError, match="it raised ValueError: no") as raised:
        run_file(file, "it")
    assert raised.value.location is not None
    assert raised.value.location.line == 2


def test_an_error_from_elsewhere_has_no_line(tmp_path: Path) -> None:
    error = script_error(ValueError("no"), tmp_path / "a.py", "it")
    assert error.location is not None
    assert error.location.line is None


def test_a_text_is_parsed_once_whoever_asks(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("def control(observation): ...\n")
    (tmp_path / "b.py").write_bytes((tmp_path / "a.py").read_bytes())
    first = read_script(tmp_path / "a.py")
    assert read_script(tmp_path / "b.py") is first
    (tmp_path / "a.py").write_text("def other(observation): ...\n")
    assert read_script(tmp_path / "a.py").names == {"other"}

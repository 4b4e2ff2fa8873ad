"""Places and messages of tracebacks."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import Location
from sim_action.ros.program_failures import exception_line, traceback_location

WAY = """\
  File "/usr/lib/python3/unittest/case.py", line 57, in run
    yield
  File "{file}", line 20, in test_it
    assert self.travelled <= 0.5
  File "/usr/lib/python3/rospy/timer.py", line 9, in sleep
    raise Gone
"""


def test_the_place_is_the_innermost_in_the_users_own_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "src").mkdir()
    (tmp_path / "src/test_it.py").touch()
    (tmp_path / "seen").symlink_to(tmp_path / "src")
    monkeypatch.chdir(tmp_path)
    text = WAY.format(file=tmp_path / "seen/test_it.py")

    assert traceback_location(text, Path()) == Location("src/test_it.py", 20)
    assert traceback_location(text, tmp_path / "other") is None


def test_what_only_looks_like_a_place_is_none(tmp_path: Path) -> None:
    (tmp_path / "round").symlink_to(tmp_path / "round")
    for file, line in (("a.py", "9" * 5000), ("\0.py", "1"), (f"{tmp_path}/round", "1"), ("x" * 5000, "1")):
        assert traceback_location(f'  File "{file}", line {line}, in test\n', tmp_path) is None


def test_what_was_wrong_is_the_message_or_the_line_that_raised() -> None:
    frames = 'File "x.py", line 1, in test\n    assert far\n'
    assert exception_line("AssertionError", f"0 != 1\n  {frames}") == "AssertionError: 0 != 1"
    assert exception_line("AssertionError", f"\n  {frames}") == "AssertionError: assert far"
    assert exception_line("KeyError", "") == "KeyError"

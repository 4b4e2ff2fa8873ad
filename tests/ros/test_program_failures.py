"""Places and messages of tracebacks."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import Location
from sim_action.ros.program_failures import Ending, ending_of, exception_line, traceback_location

WAY = """\
  File "/usr/lib/python3/unittest/case.py", line 57, in run
    yield
  File "{file}", line 20, in test_it
    assert self.travelled <= 0.5
  File "/usr/lib/python3/rospy/timer.py", line 9, in sleep
    raise Gone
"""

RCLPY = "/opt/ros/jazzy/lib/python3.12/site-packages/rclpy/executors.py"

TRACEBACK = """\
[INFO] [1.5] [mover]: up
Traceback (most recent call last):
  File "{mover}", line 30, in <module>
    rclpy.spin(Mover())
  File "{mover}", line 12, in on_timer
    self.publisher.publish(twist)
  File "{folder}/.venv/lib/python3.12/site-packages/rclpy/publisher.py", line 70, in publish
    self.__publisher.publish(msg)
rclpy._rclpy_pybind11.RCLError: Failed to publish
bye
"""

SYNTAX = """\
  File "{mover}", line 7
    def f(:
          ^
SyntaxError: invalid syntax
"""

CRASH = """\
Fatal Python error: Segmentation fault

Thread 0x00007f0000000001 (most recent call first):
  File "{mover}", line 3 in hear

Current thread 0x00007f0000000000 (most recent call first):
  File "/usr/lib/python3.12/ctypes/__init__.py", line 519 in string_at
  File "{mover}", line 18 in on_timer
  File "{rclpy}", line 111 in await_or_execute
  File "{mover}", line 28 in <module>

Extension modules: yaml._yaml (total: 1)
"""

ABORTED = """\
terminate called after throwing an instance of 'std::runtime_error'
  what():  no map
"""

LOGGED = """\
[ERROR] [1795455286.406107999] [mover]: no plan
[INFO] [1795455286.406107999] [mover]: giving up
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


@pytest.mark.parametrize(
    ("output", "said", "line"),
    [
        (TRACEBACK, ": rclpy._rclpy_pybind11.RCLError: Failed to publish", 12),
        (SYNTAX, ": SyntaxError: invalid syntax", 7),
        (CRASH, ": Segmentation fault", 18),
        (ABORTED, ": std::runtime_error: no map", None),
        (LOGGED, " after it logged the error: no plan", None),
        ("the end\n", "", None),
        ("", "", None),
    ],
)
def test_the_reason_and_the_line(tmp_path: Path, output: str, said: str, line: int | None) -> None:
    mover = tmp_path / "mover.py"
    text = output.format(mover=mover, folder=tmp_path, rclpy=RCLPY)
    found = ending_of(text, tmp_path)
    assert found.said == said
    assert (found.location.line if found.location else None) == line


FIRST = 'Traceback (most recent call last):\n  File "/a.py", line 1, in f\n'
THEN = "KeyError: 1\n\nDuring handling of the above exception, another exception occurred:\n\n"
NO_LIBRARY = "/ws/node: error while loading shared libraries: librclcpp.so: cannot open it\n"


@pytest.mark.parametrize(
    ("output", "said"),
    [
        (f"{FIRST}{THEN}{FIRST}ValueError\n", ": ValueError"),
        (f"{FIRST}MemoryError\n", ": MemoryError; memory_limit is"),
        (NO_LIBRARY, ": there is no librclcpp.so; build it again"),
        # A text that is no traceback takes no time.
        ("Traceback (most recent call last):\n" + "  a\n" * 20_000, ""),
    ],
    ids=["the last of several", "a lack of memory", "a library", "no traceback"],
)
def test_the_reason_has_a_remedy_where_there_is_one(tmp_path: Path, output: str, said: str) -> None:
    found = ending_of(output, tmp_path).said
    assert found.startswith(said)
    assert bool(found) == bool(said)


def test_a_traceback_after_a_prompt_is_read_and_frozen_modules_are_no_place(tmp_path: Path) -> None:
    text = (
        f'Enter x: Traceback (most recent call last):\n  File "{tmp_path}/a.py", line 3, in f\n    environ["X"]\n'
        "  File \"<frozen os>\", line 679, in __getitem__\nKeyError: 'X'\n"
    )
    assert ending_of(text, tmp_path) == Ending(": KeyError: 'X'", Location(f"{tmp_path}/a.py", 3))
    assert ending_of(text, Path.cwd()).location is None

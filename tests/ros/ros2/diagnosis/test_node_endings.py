"""What failed nodes said, as their output has it."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.ros.ros2.diagnosis.node_endings import Ending, ending_of

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


def test_the_last_of_several_tracebacks_counts(tmp_path: Path) -> None:
    first = 'Traceback (most recent call last):\n  File "/a.py", line 1, in f\nKeyError: 1\n'
    then = "\nDuring handling of the above exception, another exception occurred:\n\n"
    assert ending_of(f"{first}{then}{first.replace('KeyError: 1', 'ValueError')}", tmp_path) == Ending(": ValueError")


def test_a_lack_of_memory_names_the_limit(tmp_path: Path) -> None:
    output = 'Traceback (most recent call last):\n  File "/a.py", line 1, in f\nMemoryError\n'
    assert ending_of(output, tmp_path).said.startswith(": MemoryError; memory_limit is")


def test_a_text_that_is_no_traceback_takes_no_time(tmp_path: Path) -> None:
    assert ending_of("Traceback (most recent call last):\n" + "  a\n" * 20_000, tmp_path) == Ending()

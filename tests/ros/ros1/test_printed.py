"""What roslaunch and rostest print, as they print it."""

from __future__ import annotations

import pytest

from sim_action.ros.ros1 import printed
from sim_action.ros.ros1.printed import Death

DIED = "\x1b[31m[mover-2] process has died [pid 7, exit code -9, cmd /ws/mover.py __name:=mover __log:=/l].\x1b[0m"
REQUIRED = """================================================================================
REQUIRED process [base/arm-1] has died!
process has died [pid 22, exit code 3, cmd /ws/arm.py __name:=arm].
log file: /tmp/arm-1*.log
Initiating shutdown!
"""
LEFT = "REQUIRED process [mover-1] has died!\nprocess has finished cleanly\n"


def test_deaths_are_found_with_how_they_came() -> None:
    assert list(printed.deaths(printed.plain(DIED))) == [Death("mover", -9, "/ws/mover.py")]
    assert str(Death("mover", -9)) == "the node 'mover' ended with SIGKILL"
    assert str(Death("mover", 3)) == "the node 'mover' ended with exit code 3"


def test_required_nodes_that_leave_are_found_however_they_leave() -> None:
    assert list(printed.required_deaths(REQUIRED)) == [Death("base/arm", 3, "/ws/arm.py")]
    assert list(printed.required_deaths(LEFT)) == [Death("mover", 0)]
    assert list(printed.deaths("[spawn-3] process has finished cleanly")) == []


def test_colours_and_places_of_logs_are_left_out() -> None:
    text = "&#x001B;[1mstarted&#x001B;[0m\n... logging to /tmp/x.log\nlog file: /tmp/x*.log\n\x1b]2;title\x07end"
    assert printed.plain(text) == "started\nend"


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("RLException: Invalid <arg> tag: x", "Invalid <arg> tag: x"),
        ("roslaunch.core.RLException: no", "no"),
        ("ERROR: cannot launch node of type [a/b.py]: no", "cannot launch node of type [a/b.py]: no"),
        ("all is well", None),
    ],
)
def test_why_a_file_cannot_be_launched(line: str, reason: str | None) -> None:
    assert printed.refused(f"before\n{line}\nafter") == reason


@pytest.mark.parametrize("line", ["rospkg.common.ResourceNotFound: robot", "Resource not found: robot"])
def test_a_package_that_is_missing_is_named(line: str) -> None:
    assert printed.missing_package(f"{line}\nROS path [0]=/usr/share/ros") == "robot"


def test_the_exception_is_that_of_the_program() -> None:
    text = 'Traceback:\n  File "/ws/mover.py", line 3\nValueError: battery\n  File "/x/other.py", line 1\nKeyError: 1\n'
    assert printed.last_exception(text, "/ws/mover.py") == "ValueError: battery"
    assert printed.last_exception(text, "/ws/nobody.py") is None
    assert printed.last_exception(text, "") is None

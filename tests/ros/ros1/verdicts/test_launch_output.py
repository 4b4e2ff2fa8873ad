"""Output of roslaunch and rostest, and logs of failed callbacks."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import Location
from sim_action.ros.ros1.verdicts import launch_output
from sim_action.ros.ros1.verdicts.launch_output import Death, callback_errors
from tests.ros_workspace import written

DIED = "\x1b[31m[mover-2] process has died [pid 7, exit code -9, cmd /ws/mover.py __name:=mover __log:=/l].\x1b[0m"
REQUIRED = """================================================================================
REQUIRED process [base/arm-1] has died!
process has died [pid 22, exit code 3, cmd /ws/arm.py __name:=arm].
log file: /tmp/arm-1*.log
Initiating shutdown!
"""
LEFT = "REQUIRED process [mover-1] has died!\nprocess has finished cleanly\n"


def test_ends_of_nodes_and_of_required_ones_are_found_with_how_they_came() -> None:
    assert list(launch_output.deaths(launch_output.cleaned_output(DIED))) == [Death("mover", -9, "/ws/mover.py")]
    assert str(Death("mover", -9)) == "the node 'mover' ended with SIGKILL"
    assert str(Death("mover", 3)) == "the node 'mover' ended with exit code 3"
    assert list(launch_output.required_deaths(REQUIRED)) == [Death("base/arm", 3, "/ws/arm.py")]
    assert list(launch_output.required_deaths(LEFT)) == [Death("mover", 0)]
    assert list(launch_output.deaths("[spawn-3] process has finished cleanly")) == []


def test_colours_and_places_of_logs_are_left_out() -> None:
    text = "&#x001B;[1mstarted&#x001B;[0m\n... logging to /tmp/x.log\nlog file: /tmp/x*.log\n\x1b]2;title\x07end"
    assert launch_output.cleaned_output(text) == "started\nend"


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
    assert launch_output.refusal(f"before\n{line}\nafter") == reason


@pytest.mark.parametrize(
    "line",
    [
        "rospkg.common.ResourceNotFound: robot",
        "Resource not found: robot",
        'Resource not found: The following package was not found in <arg name="a" default="$(find robot)/a"/>: robot',
    ],
)
def test_a_package_that_is_missing_is_named(line: str) -> None:
    assert launch_output.missing_package(f"{line}\nROS path [0]=/usr/share/ros") == "robot"


def test_the_exception_is_that_of_the_program() -> None:
    text = 'Traceback:\n  File "/ws/mover.py", line 3\nValueError: battery\n  File "/x/other.py", line 1\nKeyError: 1\n'
    assert launch_output.last_exception(text, "/ws/mover.py") == "ValueError: battery"
    assert launch_output.last_exception(text, "/ws/nobody.py") is None
    assert launch_output.last_exception(text, "") is None


LOG = """\
[rospy.internal][INFO] 2026-01-02 03:04:05,158: topic[/odom] adding connection to [http://localhost:1/], count 0
[rosout][ERROR] 2026-01-02 03:04:05,558: bad callback: <bound method T.heard of <__main__.T testMethod=test_it>>
Traceback (most recent call last):
  File "/usr/lib/python3/dist-packages/rospy/topics.py", line 750, in _invoke_callback
    cb(msg)
  File "{code}", line 6, in heard
    self.seen = 1 / 0
                ~~^~~
ZeroDivisionError: division by zero

"""
OTHER = LOG.replace("ZeroDivisionError: division by zero", "KeyError: 'x'")


def test_each_is_told_once_with_how_often_and_where(tmp_path: Path) -> None:
    code = written(tmp_path / "ws/src/robot/test_it.py", "")
    log = LOG.format(code=code)
    written(tmp_path / "log/one/test-4.log", log + OTHER.format(code=code) + log)
    written(tmp_path / "log/one/test-4-stdout.log", log)
    written(tmp_path / "log/one/calm-2.log", "[rosout][ERROR] 2026-01-02 03:04:05,558: no battery\n")
    first, second = callback_errors(tmp_path / "log", None, tmp_path / "ws")
    assert (first.node, first.times, first.exception) == ("test", 2, "ZeroDivisionError: division by zero")
    assert isinstance(first.location, Location)
    assert first.location.line == 6
    assert str(second).startswith("a callback of the node 'test' raised: KeyError: 'x' at ")


def test_those_of_another_launch_are_not_told(tmp_path: Path) -> None:
    log = LOG.format(code="/elsewhere.py")
    for run, process in (("one", 11), ("two", 112)):
        written(tmp_path / run / "gazebo-1.log", f"[rospy.client][INFO] x: init_node, name[/gazebo], pid[{process}]\n")
        written(tmp_path / run / f"{run}-3.log", log)
    (found,) = callback_errors(tmp_path, "11", tmp_path / "ws")
    assert (found.node, found.location) == ("one", None)

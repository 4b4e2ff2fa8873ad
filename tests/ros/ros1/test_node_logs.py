"""Callbacks that raised, from logs as rospy writes them."""

from __future__ import annotations

from pathlib import Path

from sim_action.core.errors import Location
from sim_action.ros.ros1.node_logs import bad_callbacks
from tests.ros_workspace import written

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

    first, second = bad_callbacks(tmp_path / "log", None, tmp_path / "ws")

    assert (first.node, first.times, first.exception) == ("test", 2, "ZeroDivisionError: division by zero")
    assert isinstance(first.location, Location)
    assert first.location.line == 6
    assert str(second).startswith("a callback of the node 'test' raised: KeyError: 'x' at ")


def test_those_of_another_launch_are_not_told(tmp_path: Path) -> None:
    log = LOG.format(code="/elsewhere.py")
    for run, process in (("one", 11), ("two", 112)):
        written(tmp_path / run / "gazebo-1.log", f"[rospy.client][INFO] x: init_node, name[/gazebo], pid[{process}]\n")
        written(tmp_path / run / f"{run}-3.log", log)

    (found,) = bad_callbacks(tmp_path, "11", tmp_path / "ws")

    assert (found.node, found.location) == ("one", None)

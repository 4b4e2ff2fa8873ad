"""The program `spawn_model` where ROS may be absent: stand-ins take the place of rospy and of its messages."""

from __future__ import annotations

import importlib
import signal
import sys
from collections.abc import Iterator
from typing import Any, Final
from unittest.mock import MagicMock

import pytest

_MODULE: Final = "sim_action.ros.ros1.node.spawn_model"
PATIENCE_OF_ROSLAUNCH_S = 15  # roslaunch kills a node 15 s after the signal SIGINT


@pytest.fixture
def spawn_model(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    for package, part in (("rospy", ""), ("gazebo_msgs", "srv"), ("geometry_msgs", "msg"), ("std_srvs", "srv")):
        monkeypatch.setitem(sys.modules, package, MagicMock())
        monkeypatch.setitem(sys.modules, f"{package}.{part}", MagicMock())
    monkeypatch.delitem(sys.modules, _MODULE, raising=False)
    yield importlib.import_module(_MODULE)
    # The next import finds the real modules again.
    del sys.modules[_MODULE]


def test_the_end_does_not_wait_for_a_simulation_that_answers_no_more(
    spawn_model: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[str, Any]] = []
    monkeypatch.setattr(signal, "alarm", lambda seconds: calls.append(("alarm", seconds)))
    monkeypatch.setattr(spawn_model.rospy, "spin", lambda: calls.append(("spin", None)))
    monkeypatch.setattr(spawn_model.rospy, "ServiceException", OSError)
    monkeypatch.setattr(spawn_model.rospy, "ROSException", OSError)
    monkeypatch.setattr(spawn_model, "_service", lambda *_: lambda model: calls.append(("delete", model)))
    spawn_model._stay("/gazebo", "two")
    assert [name for name, _ in calls] == ["spin", "alarm", "delete"]
    _, (_, seconds), (_, model) = calls
    assert 0 < seconds < PATIENCE_OF_ROSLAUNCH_S
    assert model == "two"

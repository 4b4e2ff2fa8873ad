"""The program spawn_model, without ROS: stand-ins take the place of rospy and of its messages."""

from __future__ import annotations

import importlib
import signal
import sys
from types import ModuleType
from typing import Any
from unittest.mock import MagicMock

import pytest

# roslaunch kills a node 15 s after the signal SIGINT.
PATIENCE_OF_ROSLAUNCH_S = 15


@pytest.fixture
def spawn_model(monkeypatch: pytest.MonkeyPatch) -> Any:
    for name in ("rospy", "gazebo_msgs", "gazebo_msgs.srv", "geometry_msgs", "geometry_msgs.msg", "std_srvs.srv"):
        monkeypatch.setitem(sys.modules, name, MagicMock())
    name = "sim_action.ros.ros1.node.spawn_model"
    monkeypatch.delitem(sys.modules, name, raising=False)
    module: ModuleType = importlib.import_module(name)
    # The next import must find the real modules again.
    monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, name)
    return module


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

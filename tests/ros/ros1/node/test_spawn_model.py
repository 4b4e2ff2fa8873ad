"""The program spawn_model, without ROS."""

from __future__ import annotations

import signal
from typing import Any

import pytest

from tests.ros.ros1.node.without_ros import imported

# roslaunch kills a node 15 s after the signal SIGINT.
PATIENCE_OF_ROSLAUNCH_S = 15


@pytest.fixture
def spawn_model(monkeypatch: pytest.MonkeyPatch) -> Any:
    return imported("spawn_model", monkeypatch)


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


def test_the_services_are_those_of_gazebo_unless_another_namespace_is_asked_for(spawn_model: Any) -> None:
    spawn_model.rospy.get_namespace = lambda: "/"
    parser = spawn_model._parser()
    assert parser.parse_args(["-model", "two"]).gazebo_namespace == "/gazebo"
    assert parser.parse_args(["-model", "two", "-gazebo_namespace", "/sim"]).gazebo_namespace == "/sim"

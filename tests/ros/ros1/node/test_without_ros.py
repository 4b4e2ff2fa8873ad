"""Modules of the node where ROS may be absent: stand-ins take the place of rospy and of its messages."""

from __future__ import annotations

import importlib
import signal
import sys
from types import SimpleNamespace
from typing import Any, Final
from unittest.mock import MagicMock

import pytest

_NODE: Final = "sim_action.ros.ros1.node"
_PACKAGES: Final = (
    "gazebo_msgs",
    "geometry_msgs",
    "nav_msgs",
    "rosgraph_msgs",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
    "tf2_msgs",
)

PATIENCE_OF_ROSLAUNCH_S = 15  # roslaunch kills a node 15 s after the signal SIGINT


def imported(name: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a module of the node; the next import finds the real modules again."""
    for stub in (
        "rospy",
        "rospy.msg",
        "roslib",
        "roslib.message",
        *(f"{package}{part}" for package in _PACKAGES for part in ("", ".msg", ".srv")),
    ):
        monkeypatch.setitem(sys.modules, stub, MagicMock())
    before = {each: module for each, module in sys.modules.items() if each.startswith(f"{_NODE}.")}
    for each in before:
        del sys.modules[each]
    try:
        return importlib.import_module(f"{_NODE}.{name}")
    finally:
        for each in [each for each in sys.modules if each.startswith(f"{_NODE}.")]:
            del sys.modules[each]
        sys.modules.update(before)


@pytest.mark.parametrize(
    ("rate", "kept", "is_noted"), [(50.0, 50.0, False), (100.0, 100.0, False), (200.0, 100.0, True)]
)
def test_a_controller_that_publishes_more_often_than_the_clock_ticks_is_noted(
    rate: float, kept: float, is_noted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    notes: list[str] = []
    wiring = SimpleNamespace(warn=notes.append)
    schedule = imported("plugins", monkeypatch).Wiring.controller_schedule(wiring, "arm", rate)
    assert schedule.rate == kept
    assert notes == ["arm/publish_rate is 200: messages are published 100 times per second"] * is_noted


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

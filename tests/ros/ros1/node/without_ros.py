"""Modules of the node, imported where ROS may be absent: stand-ins take the place of rospy and of its messages."""

from __future__ import annotations

import importlib
import sys
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


def imported(name: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a module of the node; the next import finds the real modules again."""
    for stub in ("rospy", "rospy.msg", *(f"{package}{part}" for package in _PACKAGES for part in ("", ".msg", ".srv"))):
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

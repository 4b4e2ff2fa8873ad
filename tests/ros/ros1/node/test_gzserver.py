"""The node in place of Gazebo: a node of real ROS uses each topic and each service."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.ros.ros1.launch_request import LaunchRequest
from tests.ros.ros1.launches import launched, needs_ros, package, told
from tests.ros.ros1.probe import PROBE, PROBE_TEST

pytestmark = [needs_ros, pytest.mark.process]


def test_topics_and_services_are_gazebos(tmp_path: Path) -> None:
    package(tmp_path / "ws", "probe", {"probe.py": PROBE, "probe.test": PROBE_TEST})

    found = launched(tmp_path / "run", LaunchRequest("rostest", "probe", "probe.test", workspace=tmp_path / "ws"))

    (test,) = found.tests
    assert test.methods is not None, found.text
    assert {case.name: case.text for case in test.methods.cases if case.problem} == {}
    assert len(test.methods.cases) == 22
    run = told(found)
    assert run.end == "test finished"
    assert run.in_step

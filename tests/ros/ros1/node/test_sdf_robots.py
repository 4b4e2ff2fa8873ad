"""Robots in SDF, on real ROS: with their plugins and sensors, in a world and spawned."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.ros.ros1.launch_request import LaunchRequest
from tests.ros.ros1.launches import launched, needs_ros, package, told
from tests.ros.ros1.rover import PACKAGE, ROVER, TEST, YARD, YARD_TEST

pytestmark = [needs_ros, pytest.mark.process]


def test_robots_in_sdf(tmp_path: Path) -> None:
    files = {"models/rover/model.sdf": ROVER, "yard.world": YARD, "yard.test": YARD_TEST, "test_yard.py": TEST}
    package(tmp_path / "ws", "yard", files)
    (tmp_path / "ws/src/yard/package.xml").write_text(PACKAGE)

    found = launched(tmp_path / "run", LaunchRequest("rostest", "yard", "yard.test", workspace=tmp_path / "ws"))

    (test,) = found.tests
    assert test.methods is not None, found.text
    assert {case.name: case.text for case in test.methods.cases if case.problem} == {}, found.text
    assert len(test.methods.cases) == 2
    assert told(found).in_step

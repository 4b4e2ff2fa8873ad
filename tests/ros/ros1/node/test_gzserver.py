"""The node in place of Gazebo: a node of real ROS uses each topic and each service."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.ros.launches import LaunchRequest
from sim_action.ros.ros1.verdicts import findings
from tests.ros.ros1.cart import CART, CART_LAUNCH, CART_TEST, CLUMSY
from tests.ros.ros1.launches import launched, needs_ros, package, told
from tests.ros.ros1.machine import MACHINE, MACHINE_LAUNCH, MACHINE_TEST
from tests.ros.ros1.probe import PROBE, PROBE_TEST
from tests.ros.ros1.rover import PACKAGE, ROVER, TEST, YARD, YARD_TEST
from tests.soak import soaked

pytestmark = [needs_ros, pytest.mark.process]


def passed(found: findings.Findings, count: int) -> findings.TestFindings:
    """The one test of the launch, whose cases all passed, in step."""
    (test,) = found.tests
    assert test.methods is not None, found.text
    assert {case.name: case.text for case in test.methods.cases if case.problem} == {}, found.text
    assert len(test.methods.cases) == count
    assert told(found).in_step
    return test


def test_topics_and_services_are_gazebos(tmp_path: Path) -> None:
    package(tmp_path / "ws", "probe", {"probe.py": PROBE, "probe.test": PROBE_TEST})
    found = launched(tmp_path / "run", LaunchRequest("rostest", "probe", "probe.test", workspace=tmp_path / "ws"))
    passed(found, 22)
    assert told(found).end == "test finished"


def test_planar_move_and_controllers(tmp_path: Path) -> None:
    files = {"machine.urdf": MACHINE, "machine.test": MACHINE_LAUNCH, "test_machine.py": MACHINE_TEST}
    package(tmp_path / "ws", "machine", files)
    request = LaunchRequest("rostest", "machine", "machine.test", workspace=tmp_path / "ws", allows_losses=True)
    found = launched(tmp_path / "run", request)
    passed(found, 5)
    run = told(found)
    notes = "\n".join(run.notes)
    lost = "\n".join(loss.message for loss in run.losses)
    assert "the plugin smoke_machine of the robot is not supported" in lost
    assert "'grip' has the type position_controllers/GripperActionController, which is not supported" in lost
    assert "joint 'spin' has hardware_interface/VelocityJointInterface, but the controller needs" in notes
    assert "'/m/disc_speed': its gains are not used; a servo of the engine" in notes
    assert "planar move (kinematic)" in notes
    assert "joint_state_controller/publish_rate is 200: messages are published 100 times per second" in notes


def cart(folder: Path, urdf: str = CART) -> tuple[Path, LaunchRequest]:
    files = {"cart.urdf": urdf, "cart.test": CART_LAUNCH, "test_cart.py": CART_TEST, "clumsy.py": CLUMSY}
    request = LaunchRequest("rostest", "cart", "cart.test", workspace=folder / "ws")
    return package(folder / "ws", "cart", files), request


@pytest.mark.parametrize("again", soaked([0, 1], short=[0]))
def test_a_diff_drive_controller_and_a_callback_that_raises_the_same_every_time(tmp_path: Path, again: int) -> None:
    folder, request = cart(tmp_path)
    found = launched(tmp_path / "run", request)
    first = told(found)
    (raised,) = passed(found, 1).callbacks
    assert (raised.node, raised.exception) == ("clumsy", "AttributeError: 'Point' object has no attribute 'nothing'")
    assert raised.times > 1
    assert raised.location is not None
    assert (Path.cwd() / raised.location.file, raised.location.line) == ((folder / "clumsy.py").resolve(), 7)
    for number in range(again):
        second = told(launched(tmp_path / f"again{number}", request))
        assert (first.digest, first.messages) == (second.digest, second.messages)


def test_a_sensor_without_a_valid_pose_is_an_invalid_robot(tmp_path: Path) -> None:
    laser = '<plugin name="l" filename="libgazebo_ros_laser.so"><topicName>scan</topicName></plugin>'
    sensor = f'<sensor name="s" type="ray"><pose>0 0 high</pose>{laser}</sensor>'
    urdf = CART.replace("</robot>", f'<gazebo reference="base_link">{sensor}</gazebo></robot>')
    failure = told(launched(tmp_path / "run", cart(tmp_path, urdf)[1])).failure
    assert failure is not None
    assert (failure.kind, failure.message) == ("invalid", "<pose> is '0 0 high': expected 6 finite numbers")


def test_robots_in_sdf(tmp_path: Path) -> None:
    files = {"models/rover/model.sdf": ROVER, "yard.world": YARD, "yard.test": YARD_TEST, "test_yard.py": TEST}
    package(tmp_path / "ws", "yard", files)
    (tmp_path / "ws/src/yard/package.xml").write_text(PACKAGE)
    found = launched(tmp_path / "run", LaunchRequest("rostest", "yard", "yard.test", workspace=tmp_path / "ws"))
    passed(found, 2)

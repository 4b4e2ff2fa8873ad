"""What controllers are told of their robot."""

from __future__ import annotations

from dataclasses import replace

from sim_action import JointDescription, RobotDescription
from sim_action.robot.model.robot_model import Mimic
from tests.traces import scene


def test_it_tells_the_robot_and_how_it_is_asked() -> None:
    robot = RobotDescription.of(replace(scene(), seed=5), 20.0, "script a.py Controller")
    assert (robot.name, robot.base, robot.rate, robot.seed) == ("turtlebot3_burger", "base_footprint", 20.0, 5)
    assert {"base_footprint", "wheel_left_link"} <= set(robot.links)
    assert [name for name, joint in robot.joints.items() if joint.moves] == ["wheel_left_joint", "wheel_right_joint"]
    assert robot.joints["scan_joint"] == JointDescription(type="fixed", moves=False)


def test_random_numbers_depend_on_seed_and_purpose_alone() -> None:
    def drawn(seed: int, purpose: str) -> float:
        return float(RobotDescription.of(replace(scene(), seed=seed), 20.0, purpose).random.random())

    assert drawn(5, "script a.py") == drawn(5, "script a.py")
    assert len({drawn(5, "script a.py"), drawn(6, "script a.py"), drawn(5, "script b.py")}) == 3


def test_a_joint_has_its_limits_and_whom_it_follows() -> None:
    there = scene()
    left, right = (joint for joint in there.model.joints if joint.moves)
    stated = replace(left, lower=-1.0, upper=2.0, max_effort=3.0, max_velocity=4.0, mimic=Mimic(right.name))
    assert JointDescription.of(stated) == JointDescription(
        type="continuous", moves=True, lower=-1.0, upper=2.0, max_effort=3.0, max_velocity=4.0, mimics=right.name
    )

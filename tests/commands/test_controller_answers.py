from __future__ import annotations

from dataclasses import replace

import pytest

from sim_action import JointDescription, RobotDescription
from sim_action.commands.controller_answers import Saturation
from sim_action.core.geometry import Twist
from sim_action.robot.model.robot_model import Mimic, RobotModel
from sim_action.state.command import JointTargets
from tests.traces import burger, scene

LEFT, RIGHT = "wheel_left_joint", "wheel_right_joint"


def limited(max_effort: float | None = 2.0, max_velocity: float | None = 6.0) -> RobotModel:
    """A burger whose left wheel has limits."""
    model = burger()
    joints = (
        replace(joint, max_effort=max_effort, max_velocity=max_velocity)
        if joint.name == LEFT
        else replace(joint, max_effort=None, max_velocity=None)
        for joint in model.joints
    )
    return replace(model, joints=tuple(joints))


@pytest.mark.parametrize(
    "targets",
    [
        JointTargets(),
        JointTargets(velocity={LEFT: 6.0, RIGHT: 1e9}, position={LEFT: 1e9}, effort={RIGHT: -1e9}),
        JointTargets(effort={LEFT: -2.0}, max_effort={LEFT: 2.0, RIGHT: 1e9}),
    ],
)
def test_what_is_within_limits_stays_as_it_is(targets: JointTargets) -> None:
    motors = Saturation(limited(), "ctl.py")
    assert motors.clip(targets) is targets
    assert motors.notes == []


@pytest.mark.parametrize(
    ("targets", "taken"),
    [
        (JointTargets(velocity={LEFT: -7.0, RIGHT: 7.0}), JointTargets(velocity={LEFT: -6.0, RIGHT: 7.0})),
        (JointTargets(effort={LEFT: 2.5}), JointTargets(effort={LEFT: 2.0})),
        (
            JointTargets(position={LEFT: 1.0}, max_effort={LEFT: 3.0}),
            JointTargets(position={LEFT: 1.0}, max_effort={LEFT: 2.0}),
        ),
    ],
)
def test_what_is_beyond_a_limit_is_cut_to_it(targets: JointTargets, taken: JointTargets) -> None:
    assert Saturation(limited(), "ctl.py").clip(targets) == taken


def test_answers_are_cut_and_noted_once() -> None:
    answer = (Twist.planar(1e9), JointTargets(effort={LEFT: 2.5}))
    assert Saturation(limited(), "ctl.py").clip_answer(answer) == (Twist.planar(1e9), JointTargets(effort={LEFT: 2.0}))
    motors = Saturation(limited(), "ctl.py")
    for effort in (2.5, 50.0):
        motors.clip(JointTargets(effort={LEFT: -effort}))
    motors.clip(JointTargets(velocity={LEFT: 7.0}))
    assert motors.notes == [
        "ctl.py commanded 2.5 N m for joint 'wheel_left_joint'; it was clipped to 2 N m, its effort limit",
        "ctl.py commanded 401.1 deg/s for joint 'wheel_left_joint'; it was clipped to 343.8 deg/s, its velocity limit",
    ]
    targets = JointTargets(effort={LEFT: 1e9}, velocity={LEFT: 1e9}, max_effort={LEFT: 1e9})
    assert Saturation(limited(None, None), "ctl.py").clip(targets) is targets


def test_a_position_beyond_the_limits_of_a_joint_is_noted_once_and_stays() -> None:
    model = limited()
    joints = (replace(joint, lower=-1.0, upper=2.0) if joint.name == LEFT else joint for joint in model.joints)
    motors = Saturation(replace(model, joints=tuple(joints)), "ctl.py")
    # At its stop, a joint is up to 0.1 mrad beyond its limit: a controller that holds it there is not at fault.
    assert motors.clip(JointTargets(position={LEFT: -1.00009})).position == {LEFT: -1.00009}
    assert motors.notes == []
    for position in (2.0, -1.5, 3.0):
        targets = JointTargets(position={LEFT: position, RIGHT: 1e9})
        assert motors.clip(targets) is targets
    beyond = "-85.94 deg is outside the limits of the joint, -57.3 deg to 114.6 deg"
    assert motors.notes == [f"ctl.py commanded joint 'wheel_left_joint' to a position that it cannot reach: {beyond}"]


def test_robots_and_joints_are_described() -> None:
    robot = RobotDescription.of(replace(scene(), seed=5), 20.0, "script a.py Controller")
    assert (robot.name, robot.base, robot.rate, robot.seed) == ("turtlebot3_burger", "base_footprint", 20.0, 5)
    assert {"base_footprint", "wheel_left_link"} <= set(robot.links)
    assert [name for name, joint in robot.joints.items() if joint.moves] == ["wheel_left_joint", "wheel_right_joint"]
    assert robot.joints["scan_joint"] == JointDescription(type="fixed", moves=False)
    there = scene()
    left, right = (joint for joint in there.model.joints if joint.moves)
    stated = replace(left, lower=-1.0, upper=2.0, max_effort=3.0, max_velocity=4.0, mimic=Mimic(right.name))
    assert JointDescription.of(stated) == JointDescription(
        type="continuous", moves=True, lower=-1.0, upper=2.0, max_effort=3.0, max_velocity=4.0, mimics=right.name
    )


def test_random_numbers_depend_on_seed_and_purpose_alone() -> None:
    def drawn(seed: int, purpose: str) -> float:
        return float(RobotDescription.of(replace(scene(), seed=seed), 20.0, purpose).random.random())

    assert drawn(5, "script a.py") == drawn(5, "script a.py")
    assert len({drawn(5, "script a.py"), drawn(6, "script a.py"), drawn(5, "script b.py")}) == 3

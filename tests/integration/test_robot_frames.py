"""The transforms that nodes of ROS 2 get, against the poses of links that engines have."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.ros.messages import Message
from sim_action.ros.ros2.topics import Channels, channels
from sim_action.state.command import JointTargets
from sim_action.state.observation import Observation
from tests.integration.engines import advance, on_every_engine, running
from tests.ros.ros2.scenes import first_message, scene


def placed(found: Channels, seen: Observation, frame: str) -> Pose:
    """Return the pose of a frame in the root of the tree, as a listener finds it."""
    told = [each for topic in ("/tf", "/tf_static") for each in first_message(found, topic, seen)["transforms"]]
    parents = {each["child_frame_id"]: each for each in told}
    assert len(parents) == len(told), "a frame has two parents"
    pose = Pose()
    while frame in parents:
        pose = geometry.compose(_pose(parents[frame]["transform"]), pose)
        frame = parents[frame]["header"]["frame_id"]
    return pose


def _pose(transform: Message) -> Pose:
    x, y, z = transform["translation"].values()
    qx, qy, qz, qw = transform["rotation"].values()
    return Pose((x, y, z), (qx, qy, qz, qw))


HUSKY_WHEELS = ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel")
ROBOTS = {
    "turtlebot3_burger": ("", {"wheel_left_joint": 4.0, "wheel_right_joint": -2.0}),
    "husky_a200": ("", dict.fromkeys(HUSKY_WHEELS, 3.0)),
    "ur5e_gripper": (", base: fixed", {"shoulder_lift_joint": -0.5, "elbow_joint": 0.8, "wrist_1_joint": -0.4}),
}


@on_every_engine
@pytest.mark.parametrize("model", ROBOTS)
def test_links_are_where_the_engine_has_them(engine: str, model: str, tmp_path: Path) -> None:
    robot, speeds = ROBOTS[model]
    there = scene(tmp_path, model, robot=robot)
    found = channels(there, {}, 240.0)
    with running(engine, there) as backend:
        advance(backend, 0, 120, JointTargets(velocity=speeds))
        seen = backend.observe(120, contacts=False)
        base = seen.pose if there.bolted else Pose()
        assert max(abs(state.position) for state in seen.joints.values()) > 0.1
        for link in there.model.links:
            theirs = backend.link_pose(link.name)
            apart = geometry.compose(geometry.inverse(theirs), geometry.compose(base, placed(found, seen, link.name)))
            assert apart.position_xyz == pytest.approx((0, 0, 0), abs=1e-6), link.name
            assert apart.orientation_xyzw[:3] == pytest.approx((0, 0, 0), abs=1e-6), link.name

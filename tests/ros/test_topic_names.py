"""The topics of a robot: usual names, stated names, and names that cannot be."""

from __future__ import annotations

import pytest

from sim_action.ros.topic_names import topic_problems, topics_of
from sim_action.world.scene import Fitting

LIDAR = Fitting("lidar", "lidar", "base_scan", 5.0)
REAR = Fitting("rear lidar", "lidar", "rear", 5.0)
WHEELS = Fitting("wheels", "odometry", "base_link", 20.0)
EYE = Fitting("eye", "camera", "head", 10.0)


def test_without_sensors_a_robot_is_commanded_and_tells_where_it_and_its_joints_are() -> None:
    assert topics_of([], {}) == {"cmd_vel": "/cmd_vel", "joint_states": "/joint_states", "odom": "/odom"}


def test_a_sensor_that_is_the_only_one_of_its_kind_has_the_usual_topic() -> None:
    assert topics_of([LIDAR], {})["lidar"] == "/scan"
    assert topics_of([EYE], {})["eye"] == "/eye/image_raw"


def test_several_of_a_kind_have_their_names_before_it() -> None:
    topics = topics_of([LIDAR, REAR], {})

    assert (topics["lidar"], topics["rear lidar"]) == ("/lidar/scan", "/rear_lidar/scan")


def test_odometry_that_a_sensor_tells_is_in_place_of_the_truth() -> None:
    topics = topics_of([WHEELS], {})

    assert topics["wheels"] == "/odom"
    assert "odom" not in topics


def test_stated_topics_are_absolute() -> None:
    assert topics_of([LIDAR], {"cmd_vel": "arm/cmd_vel", "lidar": "/front"}) == {
        "cmd_vel": "/arm/cmd_vel",
        "joint_states": "/joint_states",
        "odom": "/odom",
        "lidar": "/front",
    }


@pytest.mark.parametrize(
    ("stated", "sensors", "key", "message"),
    [
        ({"lidr": "/scan"}, [LIDAR], "lidr", "did you mean 'lidar'"),
        ({"odom": "/odom"}, [WHEELS], "odom", "allowed: cmd_vel, joint_states, wheels"),
        ({"lidar": "/odom"}, [LIDAR], "lidar", "'/odom' is already the topic of 'odom'"),
    ],
)
def test_topics_that_cannot_be_are_named(
    stated: dict[str, str], sensors: list[Fitting], key: str, message: str
) -> None:
    ((path, said),) = topic_problems(stated, topics_of(sensors, stated))

    assert path == (key,)
    assert message in said

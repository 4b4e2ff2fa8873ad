"""The installation of ROS 1, and the command that installs it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from sim_action.core.errors import UsageError
from sim_action.ros.ros1.installation import Ros, find_ros
from tests.ros.ros1.launches import needs_ros


@pytest.mark.process
def test_where_it_is_not_one_message_says_what_to_type(tmp_path: Path) -> None:
    for python in (tmp_path / "python3", Path(sys.executable)):
        with pytest.raises(UsageError, match=r"no rospy.*sudo apt-get install .*python3-rostest") as caught:
            find_ros(python)
        assert "\n" not in str(caught.value)


def test_what_belongs_to_it_is_below_its_prefix() -> None:
    ros = Ros(Path("/usr/bin/python3"), Path("/opt/ros/noetic/lib/python3/dist-packages"))
    assert ros.share == Path("/opt/ros/noetic/share")
    assert ros.program("rostest") == Path("/opt/ros/noetic/bin/rostest")


@pytest.mark.process
@needs_ros
def test_the_distributions_own_is_found() -> None:
    assert (find_ros().share / "geometry_msgs/msg/Pose.msg").is_file()

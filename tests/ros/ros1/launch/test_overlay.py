"""The overlay, seen by real ROS."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from sim_action.core.errors import UsageError
from sim_action.ros.ros1.launch.overlay import Overlay, build_overlay
from tests.ros.ros1.launches import needs_ros, package, ros

pytestmark = [needs_ros, pytest.mark.process]


def built(folder: Path) -> Overlay:
    (folder / "overlay").mkdir()
    return build_overlay(folder / "overlay", ros(), folder / "ws", os.environ)


def said(overlay: Overlay, *words: str) -> str:
    variables = {**overlay.variables, "PYTHONPATH": overlay.python_path}
    return subprocess.run(words, env=variables, check=True, capture_output=True, text=True, cwd="/").stdout


def python(overlay: Overlay, text: str) -> str:
    return said(overlay, "python", "-c", text).strip()


def test_messages_are_those_of_gazebo(tmp_path: Path) -> None:
    overlay = built(tmp_path)
    told = python(overlay, "from gazebo_msgs.msg import ModelStates; print(ModelStates._md5sum)")
    assert told == "48c080191eb15c41858319b4d8a609c2"


def test_messages_of_a_package_that_nobody_has_built_can_be_imported_beside_its_modules(tmp_path: Path) -> None:
    files = {
        "setup.py": "",
        "src/robot/__init__.py": "",
        "src/robot/own.py": "SPEED = 3\n",
        "msg/Goal.msg": "geometry_msgs/Point place\n",
        "srv/Go.srv": "Goal goal\n---\nbool done\n",
    }
    package(tmp_path / "ws", "robot", files)
    overlay = built(tmp_path)
    imports = "from robot.msg import Goal; from robot.srv import Go; from robot.own import SPEED"
    assert python(overlay, f"{imports}; print(SPEED, Goal().place.x)") == "3 0.0"


def test_messages_need_only_the_modules_of_ros_and_a_package_that_is_missing_ends_only_the_node_that_uses_it(
    tmp_path: Path,
) -> None:
    own = {"setup.py": "", "src/robot/__init__.py": "", "src/robot/own.py": "SPEED = 3\n"}
    package(tmp_path / "ws", "robot", {**own, "msg/Goal.msg": "nowhere/Thing thing\n"})
    package(tmp_path / "ws", "seen", {"msg/Seen.msg": "# all of it\nsensor_msgs/Image image\nnav_msgs/Path[] ways\n"})
    overlay = built(tmp_path)
    text = "from seen.msg import Seen; from sensor_msgs.msg import Image; s = Seen(); print(type(s.image) is Image)"
    assert python(overlay, text) == "True"
    text = "from robot.own import SPEED\ntry: import robot.msg\nexcept ImportError as error: print(error)"
    assert python(overlay, text).startswith("the messages of 'robot' need the package 'nowhere', which is neither in")


def test_messages_that_cannot_be_read_are_an_error(tmp_path: Path) -> None:
    package(tmp_path / "ws", "robot", {"msg/Goal.msg": "float64 1x\n"})
    with pytest.raises(UsageError, match=r"the messages of robot, controller_manager_msgs, gazebo_msgs: .*1x"):
        built(tmp_path)


def test_users_packages_count_before_ours_but_where_ours_stands_in_for_gazebo(tmp_path: Path) -> None:
    for name in ("turtlebot3_description", "gazebo_ros"):
        package(tmp_path / "ws", name, {})
    overlay = built(tmp_path)
    text = "import rospkg; p = rospkg.RosPack(); print(*(p.get_path(n) for n in {}))"
    names = ("turtlebot3_description", "gazebo_ros", "turtlebot3_gazebo", "rospy")
    paths = python(overlay, text.format(names)).split()
    assert {Path(path).parent for path in paths} == {tmp_path / "overlay/share"}
    assert Path(paths[0]).resolve() == tmp_path / "ws/src/turtlebot3_description"
    assert os.access(Path(paths[1]) / "spawn_model", os.X_OK)
    assert Path(paths[3]).resolve() == ros().share / "rospy"


def test_python_has_rospy_by_both_of_its_names(tmp_path: Path) -> None:
    overlay = built(tmp_path)
    for name in ("python", "python3"):
        assert said(overlay, "env", name, "-c", "import rospy; print(1)") == "1\n"

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


@pytest.fixture(scope="module")
def overlay(tmp_path_factory: pytest.TempPathFactory) -> Overlay:
    """An overlay of packages with messages and modules, and of two with names of ours."""
    folder = tmp_path_factory.mktemp("overlay")
    own = {"setup.py": "", "src/{0}/__init__.py": "", "src/{0}/own.py": "SPEED = 3\n"}
    messages = {"msg/Goal.msg": "geometry_msgs/Point place\n", "srv/Go.srv": "Goal goal\n---\nbool done\n"}
    for name, more in (("robot", messages), ("lost", {"msg/Goal.msg": "nowhere/Thing thing\n"})):
        package(folder / "ws", name, {path.format(name): text for path, text in own.items()} | more)
    package(folder / "ws", "seen", {"msg/Seen.msg": "# all of it\nsensor_msgs/Image image\nnav_msgs/Path[] ways\n"})
    for name in ("turtlebot3_description", "gazebo_ros"):
        package(folder / "ws", name, {})
    return built(folder)


def said(overlay: Overlay, text: str) -> str:
    """What a program prints that imports ROS, by the name that nodes do not use in other tests."""
    words = ["env", "python3", "-c", text]
    variables = {**overlay.variables, "PYTHONPATH": overlay.python_path}
    return subprocess.run(words, env=variables, check=True, capture_output=True, text=True, cwd="/").stdout.strip()


def test_messages_of_a_package_that_nobody_has_built_can_be_imported_beside_its_modules(overlay: Overlay) -> None:
    imports = "import rospy; from robot.msg import Goal; from robot.srv import Go; from robot.own import SPEED"
    assert said(overlay, f"{imports}; print(SPEED, Goal().place.x)") == "3 0.0"
    text = "from seen.msg import Seen; from sensor_msgs.msg import Image; s = Seen(); print(type(s.image) is Image)"
    assert said(overlay, text) == "True"


def test_a_package_that_is_missing_ends_only_the_node_that_uses_its_messages(overlay: Overlay) -> None:
    text = "from lost.own import SPEED\ntry: import lost.msg\nexcept ImportError as error: print(error)"
    assert said(overlay, text).startswith("the messages of 'lost' need the package 'nowhere', which is neither in")


def test_messages_that_cannot_be_read_are_an_error(tmp_path: Path) -> None:
    package(tmp_path / "ws", "robot", {"msg/Goal.msg": "float64 1x\n"})
    with pytest.raises(UsageError, match=r"the messages of robot, controller_manager_msgs, gazebo_msgs: .*1x"):
        built(tmp_path)


def test_users_packages_count_before_ours_but_where_ours_stands_in_for_gazebo(overlay: Overlay) -> None:
    text = "import rospkg; p = rospkg.RosPack(); print(*(p.get_path(n) for n in {}))"
    names = ("turtlebot3_description", "gazebo_ros", "turtlebot3_gazebo", "rospy")
    paths = said(overlay, text.format(names)).split()
    share = Path(overlay.variables["ROS_PACKAGE_PATH"])
    assert {Path(path).parent for path in paths} == {share}
    assert Path(paths[0]).resolve() == share.parents[1] / "ws/src/turtlebot3_description"
    assert os.access(Path(paths[1]) / "spawn_model", os.X_OK)
    assert Path(paths[3]).resolve() == ros().share / "rospy"

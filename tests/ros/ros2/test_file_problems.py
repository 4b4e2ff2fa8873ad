"""Problems of packages, executables and files, before anything runs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter

from sim_action.core.workspace import Workspace
from sim_action.ros.ros2 import file_problems as module
from sim_action.ros.ros2.file_problems import file_problems
from sim_action.ros.ros2.installation import find_ros
from sim_action.ros.ros2.spec import Ros2Commands, Ros2Nodes, Ros2NodeSpec
from tests.ros.ros2.prefixes import installed, manifest, program, ros_prefix, source
from tests.ros_workspace import written

NODES: TypeAdapter[tuple[Ros2NodeSpec, ...]] = TypeAdapter(tuple[Ros2NodeSpec, ...])


INSTALLATION = module.local_ros


@pytest.fixture(autouse=True)
def with_ros(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    prefix = ros_prefix(tmp_path_factory.mktemp("ros"))
    ros = find_ros({"AMENT_PREFIX_PATH": str(prefix)}, prefix / "absent")
    monkeypatch.setattr(module, "local_ros", lambda: (ros, None))


@pytest.fixture
def without_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "local_ros", lambda: (None, "ROS 2 is not installed"))


def problems(root: Path, *nodes: object, **keys: Any) -> list[str]:
    """Returns each problem as "key: message"; `keys`: `launch` and `workspace`."""
    stated = {"nodes": NODES.validate_python(nodes) if nodes else None, "launch": None, "workspace": None, **keys}
    found = file_problems(Ros2Nodes.model_construct(**stated), Workspace(root, root))
    return [f"{'.'.join(map(str, path))}: {message}" for path, message in found]


def only(root: Path, *nodes: object, **keys: Any) -> str:
    [problem] = problems(root, *nodes, **keys)
    return problem


def test_there_are_either_nodes_or_a_launch_file(tmp_path: Path) -> None:
    either = ": needs either 'launch' or 'nodes'; "
    assert only(tmp_path) == f"{either}give one of them"
    assert only(tmp_path, "p/e", launch=("p", "f.launch.py")) == f"{either}remove one of them"
    short = only(tmp_path, launch=("p",))
    assert short == "launch: needs a package and a launch file, such as [my_robot, drive.launch.py]"


def test_a_good_scenario_has_no_problem(tmp_path: Path) -> None:
    source(tmp_path)
    written(tmp_path / "src/my_robot/launch/drive.launch.py", "")
    written(tmp_path / "node.py", "")
    program(tmp_path / "compiled")
    assert problems(tmp_path, "my_robot/mover", "./node.py", "./compiled") == []
    assert problems(tmp_path, launch=("my_robot", "drive.launch.py", "x:=1.0")) == []


def test_an_unknown_package_is_named_with_the_nearest(tmp_path: Path) -> None:
    source(tmp_path)
    expected = f"there is no package 'my_robots' in {tmp_path} or ROS 2; did you mean 'my_robot'? (allowed: my_robot)"
    assert only(tmp_path, "my_robots/mover") == f"nodes.0: {expected}"
    assert only(tmp_path, launch=("my_robots", "x.launch.py")) == f"launch.0: {expected}"


@pytest.mark.usefixtures("without_ros")
def test_without_ros_an_unknown_package_may_be_of_ros(tmp_path: Path) -> None:
    source(tmp_path)
    assert problems(tmp_path, "turtlesim/turtlesim_node") == []
    assert problems(tmp_path, launch=("turtlesim", "x.launch.py")) == []
    assert "no executable 'movr'" in only(tmp_path, "my_robot/movr")


def test_an_unknown_executable_is_named_with_the_nearest(tmp_path: Path) -> None:
    source(tmp_path)
    computed = source(tmp_path, "computed", {"setup.py": "from setuptools import setup\nsetup(entry_points=read())\n"})
    prefix = installed(tmp_path / "install", "built")
    program(prefix / "lib/built/talker")
    assert only(tmp_path, "my_robot/movr") == (
        "nodes.0: the package 'my_robot' has no executable 'movr'; did you mean 'mover'? (allowed: mover); add it to "
        "console_scripts in setup.py"
    )
    unread = f"can be read from {computed}/setup.py, which computes its entry points; write"
    assert unread in only(tmp_path, "computed/x")
    assert only(tmp_path, "built/talkr") == (
        "nodes.0: the package 'built' has no executable 'talkr'; did you mean 'talker'? (allowed: talker); add it to "
        "entry_points in setup.py or to install() in CMakeLists.txt, and build again"
    )
    assert only(tmp_path, "geometry_msgs/x") == "nodes.0: the package 'geometry_msgs' has no executable 'x'"


def test_a_package_that_is_not_built_says_so(tmp_path: Path) -> None:
    manifest(tmp_path / "src/compiled", "compiled", "ament_cmake")
    written(tmp_path / "install/.colcon_install_layout", "isolated")
    for workspace in (None, "install"):
        installed(tmp_path / "install/other", "other")
        assert only(tmp_path, "compiled/node", workspace=workspace) == (
            f"nodes.0: the package 'compiled' in {tmp_path}/src/compiled is not built: its build type is ament_cmake, "
            f"and only packages of Python programs run without a build; run colcon build in {tmp_path}, in a ROS 2 "
            "with rclcpp, such as the container ros:jazzy"
        )


def test_two_packages_of_one_name_are_named(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        manifest(tmp_path / "src" / folder, "twice", "ament_python")
    message = f"there are 2 packages 'twice': {tmp_path}/src/a and {tmp_path}/src/b; remove or rename one"
    assert message in only(tmp_path, "twice/node")
    assert message in only(tmp_path, "twice/node", workspace=".")


def test_a_workspace_that_is_not_built_says_so(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    absent = only(tmp_path, "p/e", workspace="install")
    assert absent.startswith("workspace: 'install' does not exist")
    assert f"; the workspace is not built: run colcon build in {tmp_path}, or leave out 'workspace' if" in absent
    assert only(tmp_path, "p/e", workspace="absent/install").endswith(f"(looked for {tmp_path}/absent/install)")
    assert only(tmp_path, "p/e", workspace="empty") == (
        "workspace: 'empty' has no packages; run colcon build in the workspace, or name another folder"
    )


def test_a_program_that_is_not_executable_says_so(tmp_path: Path) -> None:
    written(tmp_path / "compiled", "")
    written(tmp_path / "install/lib/built/talker", "")
    installed(tmp_path / "install", "built")
    assert only(tmp_path, "./compiled") == (
        "nodes.0: './compiled' is not executable, and is not a file of Python (.py); run chmod +x ./compiled and "
        "git update-index --chmod=+x ./compiled"
    )
    talker = tmp_path / "install/lib/built/talker"
    assert only(tmp_path, "built/talker") == f"nodes.0: 'talker' of 'built' is not executable; run chmod +x {talker}"
    assert only(tmp_path, "./absent.py").startswith("nodes.0: './absent.py' does not exist")
    assert only(tmp_path, "./compile").endswith("; did you mean 'compiled'?")


def test_a_manifest_that_is_no_xml_is_named_and_a_file_without_its_dot_suggested(tmp_path: Path) -> None:
    written(tmp_path / "nodes/mover.py", "")
    assert only(tmp_path, "nodes/mover.py").endswith("; if you mean the file, write ./nodes/mover.py")
    path = written(tmp_path / "src/broken/package.xml", "<package><name>broken")
    assert only(tmp_path, "broken/mover") == f"nodes.0: the package 'broken' cannot be read: {path} is not valid XML"


def test_names_are_suggested_for_missing_files_of_the_workspace_only(tmp_path: Path) -> None:
    (tmp_path / "mover.py").mkdir()
    (tmp_path / "repository").mkdir()
    written(tmp_path / "secret.py", "")
    folder = f"nodes.0: './mover.py' is a folder, not a file (looked for {tmp_path}/mover.py)"
    assert only(tmp_path, "./mover.py") == folder
    assert "did you mean" not in only(tmp_path / "repository", "../secre.py")
    (tmp_path / "loop.py").symlink_to("loop.py")
    for path in ("./loop.py", "./\0.py"):
        assert "did you mean" not in only(tmp_path, path)


@pytest.mark.parametrize("odd", ["a\0b", "x" * 5000, "..", "*", "\n", "é"])
def test_odd_names_are_problems(odd: str, tmp_path: Path) -> None:
    source(tmp_path)
    assert problems(tmp_path, {"package": odd, "executable": odd})
    assert problems(tmp_path, {"package": "my_robot", "executable": odd})
    assert problems(tmp_path, {"file": f"./{odd}"})
    assert problems(tmp_path, launch=(odd, odd, odd))
    assert problems(tmp_path, "my_robot/mover", workspace=f"{odd}/install")


def test_two_nodes_have_two_names(tmp_path: Path) -> None:
    source(tmp_path)
    mover = {"package": "my_robot", "executable": "mover"}
    assert only(tmp_path, "my_robot/mover", "my_robot/mover") == (
        "nodes.1: two nodes of one name: 'my_robot/mover' has the name 'mover', as another one; give each its own "
        "'name' or 'namespace'"
    )
    named = {"file": "./x.py", "name": "mover"}
    written(tmp_path / "x.py", "")
    assert "'./x.py' has the name 'mover', as 'my_robot/mover';" in only(tmp_path, mover, named)
    assert problems(tmp_path, mover, {**mover, "name": "other"}, {**mover, "namespace": "/left"}) == []


def test_a_launch_file_is_looked_for(tmp_path: Path) -> None:
    folder = source(tmp_path)
    absent = only(tmp_path, launch=("my_robot", "drive.launch.py"))
    assert absent == "launch.1: the package 'my_robot' has no launch file 'drive.launch.py', and no other one"
    written(folder / "launch/drive.launch.py", "")
    assert "; did you mean 'drive.launch.py'?" in only(tmp_path, launch=("my_robot", "drve.launch.py"))
    bad = only(tmp_path, launch=("my_robot", "drive.launch.py", "x=1"))
    assert bad == "launch.2: 'x=1' is not an argument of a launch file; write NAME:=VALUE"


def test_notes_say_what_is_not_checked(without_ros: None) -> None:
    nodes = NODES.validate_python(["p/e"])
    assert Ros2Commands(ros2=Ros2Nodes(nodes=nodes)).unchecked == (
        "ros2: the nodes are started when the scenario runs",
        "ros2: ROS 2 is not installed",
    )
    launched = Ros2Commands(ros2=Ros2Nodes(launch=("p", "f"))).unchecked
    assert launched[0] == "ros2: the launch file is read when the scenario runs"


def test_other_systems_and_another_middleware_have_no_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "local_ros", INSTALLATION.__wrapped__)
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_zenoh_cpp")
    assert (module.local_ros()[1] or "").startswith("RMW_IMPLEMENTATION is rmw_zenoh_cpp")
    monkeypatch.setattr(sys, "platform", "darwin")
    assert (module.local_ros()[1] or "").startswith("nodes of ROS 2 run on Linux only")

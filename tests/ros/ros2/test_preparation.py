"""The build of messages on the wheels: its order, and what is named before anything is built."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Final

import pytest

from sim_action.core.errors import UsageError
from sim_action.ros.ros2.installation import Ros2, find_ros
from sim_action.ros.ros2.preparation import needed_by, prepare, problems, sources_in
from sim_action.scenario.child_environment import code_environment
from tests.ros.ros2.nodes import needs_ros2, variables
from tests.ros_workspace import written
from tests.soak import soaked

CMAKE: Final = """\
cmake_minimum_required(VERSION 3.8)
project({name})
find_package(ament_cmake REQUIRED)
{packages}
"""
LIBRARY: Final = "add_library({name} {name}.cpp)\n"
MESSAGES: Final = """\
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces(${{PROJECT_NAME}} "msg/Speed.msg" DEPENDENCIES {needs})
ament_package()
"""
OF_MESSAGES: Final = """\
<version>0.0.1</version><description>d</description><maintainer email="dev@example.com">x</maintainer>
<license>MIT</license><buildtool_depend>ament_cmake</buildtool_depend>
<buildtool_depend>rosidl_default_generators</buildtool_depend><exec_depend>rosidl_default_runtime</exec_depend>
<member_of_group>rosidl_interface_packages</member_of_group>
"""


def package(folder: Path, name: str, *needs: str, build_type: str = "ament_cmake", message: str | None = None) -> Path:
    """Write a package in Python, or with a library in C++, or with a message."""
    depends = "".join(f"<depend>{need}</depend>" for need in needs)
    more = (
        f"{OF_MESSAGES if message is not None else ''}{depends}<export><build_type>{build_type}</build_type></export>"
    )
    written(folder / "package.xml", f'<package format="3"><name>{name}</name>{more}</package>')
    if build_type == "ament_python":
        written(folder / f"{name}.py", "".join(f"import {need}\n" for need in needs))
        return folder
    text = CMAKE + (LIBRARY if message is None else MESSAGES)
    packages = "\n".join(f"find_package({need} REQUIRED)" for need in needs)
    written(folder / "CMakeLists.txt", text.format(name=name, packages=packages, needs=" ".join(needs)))
    if message is not None:
        written(folder / "msg/Speed.msg", message)
    return folder


def interfaces(workspace: Path, name: str, message: str, *needs: str, folder: str = "") -> Path:
    return package(workspace / "src" / (folder or name), name, *needs, message=message)


@pytest.fixture
def prefix(tmp_path: Path) -> Path:
    """A prefix with the only package that all packages of messages need."""
    share = tmp_path / "prefix/share/rosidl_default_runtime"
    share.mkdir(parents=True)
    (share / "package.xml").touch()
    return tmp_path / "prefix"


def test_a_package_follows_those_that_it_needs(tmp_path: Path, prefix: Path) -> None:
    interfaces(tmp_path, "a", "b/Speed speed\n", "b", "c")
    interfaces(tmp_path, "b", "c/Speed[<=3] speeds\n", "c")
    interfaces(tmp_path, "c", "# the robot's 1\nfloat64 MAX=2.0 # it's 3\nstring<=5[] names\nstring text 'a # b'\n")
    (tmp_path / "src/c/test/msg").mkdir(parents=True)
    (tmp_path / "src/c/test/msg/Dummy.msg").write_text("std_msgs/Header header\n")
    sources = sources_in(tmp_path)
    assert list(sources) == ["c", "b", "a"]
    assert list(problems(sources, (prefix,))) == []


@pytest.mark.parametrize(
    ("packages", "message"),
    [
        (
            [("a", "b"), ("b", "c"), ("c", "a")],
            r"packages need each other in a circle: (\w -> ){3}\w; remove one <depend>",
        ),
        ([("a",), ("a",)], "the workspace has 2 packages 'a': src/.* and src/.*; remove or rename one"),
        ([], "has no packages"),
    ],
    ids=["circle", "two of one name", "none"],
)
def test_a_workspace_that_has_no_order_is_refused(
    packages: list[tuple[str, ...]], message: str, tmp_path: Path
) -> None:
    (tmp_path / "src").mkdir()
    for number, (name, *needs) in enumerate(packages):
        interfaces(tmp_path, name, "", *needs, folder=f"{name}{number}")
    with pytest.raises(UsageError, match=message):
        sources_in(tmp_path)


def test_a_manifest_that_is_not_xml_is_named_with_its_line(tmp_path: Path) -> None:
    package = interfaces(tmp_path, "a", "")
    (package / "package.xml").write_text("<package>\n<name>a</name>\n<oops\n</package>")
    with pytest.raises(UsageError, match=r"package\.xml:\d+.* is not XML"):
        sources_in(tmp_path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("float64\n", "'float64' is not a field of a message; write TYPE NAME, such as float64 speed"),
        ("flot64 a\n", "there is no type 'flot64'; did you mean 'float64'?"),
        ("Sped a\n", "there is no type 'Sped'; did you mean 'Speed'?"),
        ("b/Spead a\n", "the package 'b' has no message 'Spead'; did you mean 'Speed'?"),
        ("other/Speed a\n", "the package 'other' of the type is not named by a <depend> in package.xml"),
    ],
)
def test_a_message_that_does_not_parse_is_named_with_its_line(
    text: str, message: str, tmp_path: Path, prefix: Path
) -> None:
    package = interfaces(tmp_path, "a", f"bool good\n{text}", "b")
    interfaces(tmp_path, "b", "bool good\n")
    ((found, place),) = problems(sources_in(tmp_path), (prefix,))
    assert found.partition(" (allowed")[0] == message
    assert (place.file, place.line) == (str(package / "msg/Speed.msg"), 2)


def test_a_package_that_nobody_has_is_named(tmp_path: Path, prefix: Path) -> None:
    interfaces(tmp_path, "a", "bool good\n", "nowhere_msgs")
    ((found, _),) = problems(sources_in(tmp_path), (prefix,))
    assert "'a' needs the package 'nowhere_msgs', which neither the workspace nor ROS 2 has; add its source" in found


FAKE_CMAKE: Final = """\
#!/bin/sh
[ "$1" = --build ] || exit 0
env > "$BUILT"
[ -z "$FAILS" ] && exit
seq 30
echo "$FAILS: error"
exit 1
"""


@pytest.fixture
def wheels(tmp_path: Path, prefix: Path, monkeypatch: pytest.MonkeyPatch) -> Ros2:
    """An installation with generators, and a cmake on PATH that only writes its variables."""
    for folder in ("rclpy", "catkin_pkg"):
        (prefix / "lib/python3.11/site-packages" / folder).mkdir(parents=True)
    (prefix / "share/rosidl_default_generators").mkdir()
    (prefix / "share/rclpy").mkdir()
    (prefix / "share/rclpy/package.xml").touch()
    for name in ("cmake", "ninja", "g++"):
        program = tmp_path / "bin" / name
        program.parent.mkdir(exist_ok=True)
        program.write_text(FAKE_CMAKE)
        program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    monkeypatch.setenv("SECRET", "s3cret")
    return Ros2((prefix,), Path(sys.executable), "jazzy", "rmw_fastrtps_cpp", "here", {"ROS_DISTRO": "jazzy"})


@pytest.mark.process
def test_what_has_changed_is_built_in_order_and_sees_no_secret(tmp_path: Path, wheels: Ros2) -> None:
    package = interfaces(tmp_path, "a", "b/Speed speed\n", "b")
    interfaces(tmp_path, "b", "bool good\n")
    seen = code_environment({**os.environ, "BUILT": str(tmp_path / "built")}, ["BUILT"])

    def built() -> list[str]:
        return list(prepare(tmp_path, wheels, tmp_path / "cache", seen))

    assert built() == ["b: built", "a: built"]
    variables = (tmp_path / "built").read_text()
    assert "ROS_DISTRO=jazzy" in variables
    assert f"AMENT_PREFIX_PATH={tmp_path}/install/b:" in variables
    assert "s3cret" not in variables
    assert built() == ["b: unchanged", "a: unchanged"]
    (package / "large.dat").write_bytes(bytes(2_000_000))
    assert built() == ["b: unchanged", "a: built"]
    (package / "large.dat").write_bytes(bytes(2_000_001))
    assert built() == ["b: unchanged", "a: built"]


@pytest.mark.process
def test_libraries_that_packages_in_python_need_are_built(tmp_path: Path, wheels: Ros2) -> None:
    interfaces(tmp_path, "a", "bool good\n")
    (tmp_path / "my.repos").write_text("repositories: {others/tf: {type: git, url: 'https://example.com/tf'}}\n")
    package(tmp_path / "others/tf/tf", "tf", "a")
    package(tmp_path / "src/tf_py", "tf_py", "tf")
    package(tmp_path / "src/unused", "unused", "a")
    package(tmp_path / "src/driver", "driver", "rclcpp")
    package(tmp_path / "src/nodes", "nodes", "tf_py", "driver", build_type="ament_python")
    seen = {**os.environ, "BUILT": os.devnull}
    assert sorted(prepare(tmp_path, wheels, tmp_path / "cache", seen)) == [
        "a: built",
        "driver: not built, because it needs 'rclcpp', which is not there or cannot be built",
        "nodes: not built, because it needs no build",
        "tf: built",
        "tf_py: built",
        "unused: not built, because no package in Python needs it",
    ]
    assert list(prepare(tmp_path, wheels, tmp_path / "cache", seen, {"tf"})) == ["a: unchanged", "tf: unchanged"]


@pytest.mark.parametrize(
    ("commands", "names"),
    [
        ("ros2: {nodes: [nodes/nodes]}", {"tf"}),
        ("ros2: {nodes: [./own.py, {file: ./own.py, name: b}]}", {"tf", "a"}),
        ("}\nworld: {actors: [{commands: [{ros2: {nodes: [./own.py]}}]}, 3]", {"tf", "a"}),
        ("ros2: {nodes: 1}", {"tf"}),
        ("ros2: {workspace: nowhere, nodes: [nodes/nodes]}", set()),
        ("twist: {linear: 1}", set()),
        ("[}", set()),
    ],
)
def test_scenarios_need_what_their_programs_import(commands: str, names: set[str], tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    interfaces(tmp_path, "a", "bool good\n")
    package(tmp_path / "src/tf", "tf")
    package(tmp_path / "src/unused", "unused")
    package(tmp_path / "src/nodes", "nodes", "tf", "rclpy", build_type="ament_python")
    (tmp_path / "own.py").write_text("from a.msg import Speed\n")
    scenario = tmp_path / "s.sim.yml"
    scenario.write_text(f"name: s\ncommands: {{{commands}}}\n")
    assert needed_by([scenario, tmp_path / "none.sim.yml"]) == ({tmp_path: names} if names else {})


@pytest.mark.process
def test_a_build_that_fails_shows_its_last_lines_and_its_place(
    tmp_path: Path, wheels: Ros2, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = interfaces(tmp_path, "a", "bool good\n")
    fails = {**os.environ, "BUILT": os.devnull, "FAILS": f"{package}/CMakeLists.txt:7"}
    with pytest.raises(UsageError) as raised:
        list(prepare(tmp_path, wheels, tmp_path / "cache", fails))
    first, *lines = str(raised.value).splitlines()
    assert first == f"{package}/CMakeLists.txt:7: the build of 'a' failed; the last 20 lines:"
    assert lines == [*map(str, range(12, 31)), f"{package}/CMakeLists.txt:7: error"]
    (tmp_path / "bin/ninja").unlink()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    with pytest.raises(UsageError, match="a build needs ninja; run sudo apt-get install"):
        list(prepare(tmp_path, wheels, tmp_path / "cache", {}))


@needs_ros2
@pytest.mark.parametrize("text", soaked(["geometry_msgs/Point where\n", "bool True\n"], short=[]))
def test_messages_are_built_once_or_the_last_lines_are_told(text: str, tmp_path: Path) -> None:
    interfaces(tmp_path, "my_msgs", text, "geometry_msgs")
    ros = find_ros(variables())
    if not (ros.prefix / "share/rosidl_default_generators").is_dir():
        pytest.skip("the generators of messages are not installed")
    if "True" in text:
        with pytest.raises(UsageError, match="the build of 'my_msgs' failed; the last"):
            list(prepare(tmp_path, ros, tmp_path / "cache", os.environ))
        return
    for state in ("built", "unchanged"):
        assert list(prepare(tmp_path, ros, tmp_path / "cache", os.environ)) == [f"my_msgs: {state}"]
    assert next((tmp_path / "install/my_msgs").glob("lib/python3*/site-packages/my_msgs/msg/_speed.py")).is_file()

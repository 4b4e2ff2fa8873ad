"""The build of messages on the wheels: its order, and what is named before anything is built."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import pytest

from sim_action.core.errors import UsageError
from sim_action.ros.ros2.installation import find_ros
from sim_action.ros.ros2.preparation import prepare, problems, sources_in
from tests.ros.ros2.nodes import needs_ros2, variables
from tests.soak import soaked

PACKAGE: Final = """\
<package format="3"><name>{name}</name><version>0.0.1</version><description>d</description>
<maintainer email="dev@example.com">x</maintainer><license>MIT</license>
<buildtool_depend>ament_cmake</buildtool_depend><buildtool_depend>rosidl_default_generators</buildtool_depend>
{needs}<exec_depend>rosidl_default_runtime</exec_depend><member_of_group>rosidl_interface_packages</member_of_group>
<export><build_type>ament_cmake</build_type></export></package>
"""
CMAKE: Final = """\
cmake_minimum_required(VERSION 3.8)
project({name})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{packages}
rosidl_generate_interfaces(${{PROJECT_NAME}} "msg/Speed.msg" DEPENDENCIES {needs})
ament_package()
"""


def interfaces(workspace: Path, name: str, message: str, *needs: str, folder: str = "") -> Path:
    package = workspace / "src" / (folder or name)
    (package / "msg").mkdir(parents=True)
    (package / "package.xml").write_text(
        PACKAGE.format(name=name, needs="".join(f"<depend>{need}</depend>\n" for need in needs))
    )
    packages = "\n".join(f"find_package({need} REQUIRED)" for need in needs)
    (package / "CMakeLists.txt").write_text(CMAKE.format(name=name, packages=packages, needs=" ".join(needs)))
    (package / "msg/Speed.msg").write_text(message)
    return package


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
    interfaces(tmp_path, "c", "# 1\nfloat64 MAX=2.0 # 3\nstring<=5[] names\nstring text 'a # b'\n")
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


@needs_ros2
@pytest.mark.parametrize("text", soaked(["geometry_msgs/Point where\n", "bool True\n"], short=[]))
def test_messages_are_built_once_or_the_last_lines_are_told(text: str, tmp_path: Path) -> None:
    interfaces(tmp_path, "my_msgs", text, "geometry_msgs")
    ros = find_ros(variables())
    if not (ros.prefix / "share/rosidl_default_generators").is_dir():
        pytest.skip("the generators of messages are not installed")
    if "True" in text:
        with pytest.raises(UsageError, match="the build of 'my_msgs' failed; the last"):
            list(prepare(tmp_path, ros, tmp_path / "cache"))
        return
    for state in ("built", "unchanged"):
        assert list(prepare(tmp_path, ros, tmp_path / "cache")) == [f"my_msgs: {state}"]
    assert next((tmp_path / "install/my_msgs").glob("lib/python3*/site-packages/my_msgs/msg/_speed.py")).is_file()

"""Where ROS 2 is found, and the messages about one that cannot be used."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from sim_action.core.errors import UsageError
from sim_action.core.records import replace
from sim_action.ros.ros2 import installation
from sim_action.ros.ros2.installation import PYTHON_VARIABLE, RMW, Ros2, find_ros, packages_of_prefix, set_up
from tests.ros.ros2.prefixes import HUMBLE, KILTED, installed, program, ros_prefix
from tests.ros_workspace import written


def problem(environment: dict[str, str], root: Path) -> str:
    with pytest.raises(UsageError) as caught:
        find_ros(environment, root)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_without_ros_one_message_says_what_to_type(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said = rf"^ROS 2 is not installed; .*setup\.bash.*pip install ros-jazzy-rclpy .*{PYTHON_VARIABLE}="
    assert re.search(said, problem({}, tmp_path))
    # Relative prefixes do not count.
    ros_prefix(tmp_path / "ros")
    monkeypatch.chdir(tmp_path)
    assert "not installed" in problem({"AMENT_PREFIX_PATH": "ros"}, tmp_path / "absent")


def test_a_sourced_environment_comes_before_others(tmp_path: Path) -> None:
    sourced = ros_prefix(tmp_path / "sourced", KILTED)
    ros_prefix(tmp_path / "root/jazzy")
    users = installed(tmp_path / "ws/install/p", "p", "prepend-non-duplicate;PYTHONPATH;lib/python3.12/site-packages\n")
    ros = find_ros({"AMENT_PREFIX_PATH": f"{users}:{sourced}", "PYTHONPATH": "/mine"}, tmp_path / "root")
    assert (ros.distribution, ros.prefix, ros.prefixes) == ("kilted", sourced, (users, sourced))
    assert ros.python == sourced / "bin/python3.12"
    assert ros.variables["AMENT_PREFIX_PATH"] == f"{users}:{sourced}"
    modules = "lib/python3.12/site-packages"
    assert ros.variables["PYTHONPATH"] == f"{users}/{modules}:{sourced}/{modules}:/mine"
    shown = "kilted in {0} (from the sourced environment), Fast DDS (rmw_fastrtps_cpp), for {0}/bin/python3.12"
    assert str(ros) == shown.format(sourced)


def test_an_installed_distribution_needs_no_sourcing(tmp_path: Path) -> None:
    jazzy = ros_prefix(tmp_path / "jazzy")
    ros_prefix(tmp_path / "kilted", KILTED)
    ros_prefix(tmp_path / "humble", HUMBLE)
    users = installed(tmp_path / "ws/install", "p")
    ros = find_ros({"AMENT_PREFIX_PATH": str(users)}, tmp_path)
    assert (ros.distribution, ros.prefixes, ros.source) == ("jazzy", (users, jazzy), str(tmp_path))
    assert ros.variables["LD_LIBRARY_PATH"] == f"{jazzy}/lib"
    assert ros.variables["ROS_DISTRO"] == "jazzy"


def test_the_environment_of_this_python_may_have_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "prefix", str(ros_prefix(tmp_path / "env", KILTED)))
    ros = find_ros({}, tmp_path / "absent")
    assert (ros.distribution, ros.python) == ("kilted", tmp_path / "env/bin/python3.12")


def test_the_wheels_of_a_named_python_start_at_once(tmp_path: Path) -> None:
    wheels = ros_prefix(tmp_path / "env", wheels=True)
    sourced = ros_prefix(tmp_path / "sourced", HUMBLE)
    named = {PYTHON_VARIABLE: str(wheels / "bin/python"), "AMENT_PREFIX_PATH": str(sourced), "PYTHONPATH": "/mine"}
    ros = find_ros({**named, "PATH": "/usr/bin"}, tmp_path / "absent")
    # A Python in a virtual environment is a link; its own path finds the modules.
    assert (ros.python, ros.prefixes, ros.source) == (wheels / "bin/python", (wheels,), PYTHON_VARIABLE)
    assert ros.variables["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] == "1"
    assert ros.variables["LD_LIBRARY_PATH"] == f"{wheels}/lib:{wheels}/lib/python3.12/site-packages/ros_rcl.libs"
    assert ros.variables["PATH"] == f"{wheels}/bin:/usr/bin"
    assert (ros.variables["AMENT_PREFIX_PATH"], ros.variables["PYTHONPATH"]) == (str(wheels), "")


def test_a_workspace_may_be_sourced_on_top_of_the_wheels(tmp_path: Path) -> None:
    wheels = ros_prefix(tmp_path / "env", wheels=True)
    users = installed(tmp_path / "ws/install/p", "p", "prepend-non-duplicate;PYTHONPATH;lib/python\n")
    named = {PYTHON_VARIABLE: str(wheels / "bin/python"), "AMENT_PREFIX_PATH": str(users)}
    ros = find_ros(named, tmp_path / "absent")
    assert ros.variables["AMENT_PREFIX_PATH"] == f"{users}:{wheels}"
    assert ros.variables["PYTHONPATH"] == f"{users}/lib/python"


def test_a_named_python_may_run_a_sourced_ros(tmp_path: Path) -> None:
    sourced, python = ros_prefix(tmp_path / "sourced"), program(tmp_path / "venv/bin/python")
    ros = find_ros({PYTHON_VARIABLE: str(python), "AMENT_PREFIX_PATH": str(sourced)}, tmp_path / "absent")
    assert (ros.python, ros.prefix) == (python, sourced)


def test_nodes_do_not_find_sim_action(tmp_path: Path) -> None:
    root = str(Path(installation.__file__).parents[3])
    ros = find_ros({"AMENT_PREFIX_PATH": str(ros_prefix(tmp_path)), "PYTHONPATH": f"{root}:/mine"}, tmp_path / "absent")
    assert ros.variables["PYTHONPATH"] == f"{tmp_path}/lib/python3.12/site-packages:/mine"


@pytest.mark.parametrize(
    ("name", "message"), [("absent", "is not a program"), ("python", "has no rclpy; source .* venv ~/ros2")]
)
def test_a_named_python_that_cannot_be_used_is_refused(name: str, message: str, tmp_path: Path) -> None:
    program(tmp_path / "bin/python")
    found = problem({PYTHON_VARIABLE: f"{tmp_path}/bin/{name}"}, ros_prefix(tmp_path / "root/jazzy").parent)
    assert re.search(rf"^{PYTHON_VARIABLE} is {tmp_path}/bin/{name}, .*{message}", found)
    # Wheels are suggested for a virtual environment.
    python = tmp_path / "bin/python"
    written(tmp_path / "pyvenv.cfg", "")
    assert f"has no rclpy; run {python} -m pip install ros-" in problem({PYTHON_VARIABLE: str(python)}, tmp_path)


def test_other_distributions_are_refused(tmp_path: Path) -> None:
    environment = {"AMENT_PREFIX_PATH": str(ros_prefix(tmp_path / "foxy", "1.0.5"))}
    message = problem(environment, ros_prefix(tmp_path / "root/jazzy").parent)
    assert "foxy (from the sourced environment) is foxy (rclpy 1.0.5)" in message
    assert "supports jazzy, kilted, lyrical, humble" in message


@pytest.mark.parametrize(("name", "version"), [("humble", HUMBLE), ("lyrical", "11.0.1")])
def test_distributions_are_known_by_rclpy_or_their_folder(name: str, version: str, tmp_path: Path) -> None:
    prefix = ros_prefix(tmp_path / "root" / name, version)
    for environment in ({}, {"AMENT_PREFIX_PATH": str(prefix)}):
        assert find_ros(environment, prefix.parent).distribution == name


@pytest.mark.parametrize(
    ("text", "said"), [("<version>99.1.0</version>", "(rclpy 99.1.0)"), ("nothing", "(rclpy without a version)")]
)
def test_an_unknown_distribution_is_refused(text: str, said: str, tmp_path: Path) -> None:
    written(ros_prefix(tmp_path) / "share/rclpy/package.xml", text)
    assert f"of an unknown distribution {said}" in problem({"AMENT_PREFIX_PATH": str(tmp_path)}, tmp_path / "absent")


@pytest.mark.parametrize("wheels", [False, True])
def test_missing_parts_are_named(wheels: bool, tmp_path: Path) -> None:
    prefix = ros_prefix(tmp_path, missing="rmw_fastrtps_cpp", wheels=wheels)
    message = problem({"AMENT_PREFIX_PATH": str(prefix)}, tmp_path / "absent")
    install = f"run {prefix}/bin/python -m pip install ros-jazzy-rclpy" if wheels else "ros-jazzy-rmw-fastrtps-cpp"
    assert "has no rmw_fastrtps_cpp; run" in message
    assert install in message


def test_an_interpreter_is_found_on_path_or_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    prefix = ros_prefix(tmp_path / "ros")
    (prefix / "lib/python3.12").rename(prefix / "lib/python3.99")
    sourced = {"AMENT_PREFIX_PATH": str(prefix)}
    assert "needs python3.99, which is not on PATH" in problem(sourced, tmp_path / "absent")
    python = program(tmp_path / "bin/python3.99")
    monkeypatch.setenv("PATH", str(python.parent))
    assert find_ros(sourced, tmp_path / "absent").python == python
    # Without its module, the prefix is refused.
    (prefix / "lib/python3.99/site-packages/rclpy").rmdir()
    assert "has no Python module rclpy" in problem(sourced, tmp_path / "absent")


def test_other_middleware_is_refused(tmp_path: Path) -> None:
    remedy = "lock-step needs Fast DDS; set RMW_IMPLEMENTATION=rmw_fastrtps_cpp, or unset it"
    message = problem({"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}, tmp_path)
    assert message == f"RMW_IMPLEMENTATION is rmw_cyclonedds_cpp, and {remedy}"


@pytest.mark.parametrize("variable", [PYTHON_VARIABLE, "AMENT_PREFIX_PATH"])
def test_a_path_that_no_system_can_have_is_one_line(variable: str, tmp_path: Path) -> None:
    assert problem({variable: "/" + "x" * 5000}, tmp_path).startswith("ROS 2 cannot be read: ")


def test_scripts_that_were_not_run_are_a_note() -> None:
    ros = Ros2((), Path("/usr/bin/python3"), "jazzy", RMW, "/opt/ros", {})
    assert ros.notes == []
    [note] = replace(ros, unread=("/opt/ros/jazzy/share/a/a.sh",)).notes
    assert note.startswith("not run, because only a shell can: /opt/ros/jazzy/share/a/a.sh; ")


def test_variables_are_extended_once_or_set(tmp_path: Path) -> None:
    before, last = "prepend-non-duplicate", "append-non-duplicate;A;last\n"
    texts = f"# a comment\n{before};A;one;two\n{before};A;one\n{last}{last}"
    folders = f"{before}-if-exists;A;absent\n{before}-if-exists;A;share\n{before};A;/absolute\n"
    installed(tmp_path, "p", f"{texts}{folders}no semicolon\nunknown;A;b\n")
    found = set_up([tmp_path], {"A": "before", "B": "other"}).variables
    a = ["/absolute", f"{tmp_path}/share", f"{tmp_path}/two", f"{tmp_path}/one", "before", f"{tmp_path}/last"]
    assert found == {"A": ":".join(a), "AMENT_PREFIX_PATH": str(tmp_path)}
    # Others are set.
    installed(tmp_path, "p", "set;A;share\nset;B;text;more\nset-if-unset;C;new\nset-if-unset;D;new\nset;E;\n")
    found = set_up([tmp_path], {"A": "old", "C": "old"}).variables
    assert (found["A"], found["B"], found["D"]) == (f"{tmp_path}/share", "text;more", "new")
    assert "C" not in found


def test_hooks_of_hooks_are_read_to_an_end_and_scripts_alone_are_named(tmp_path: Path) -> None:
    hook = "source;share/p/hook/path"
    own = "source;share/p/own.bash\nsource;share/p/own.ps1\nsource;share/p/package.sh\n"
    installed(tmp_path, "p", f"{hook}.sh\n{hook}.ps1\n{own}")
    written(tmp_path / "share/p/hook/path.dsv", "prepend-non-duplicate;PYTHONPATH;lib/python\n")
    found = set_up([tmp_path], {})
    assert found.variables["PYTHONPATH"] == f"{tmp_path}/lib/python"
    assert f"{tmp_path}/share/p/own.bash" in found.unread


def test_the_first_prefix_wins_and_a_missing_one_changes_its_own_variable_alone(tmp_path: Path) -> None:
    first = installed(tmp_path / "first", "p", "prepend-non-duplicate;A;lib\n")
    second = installed(tmp_path / "second", "q", "prepend-non-duplicate;A;lib\n")
    found = set_up([first, second], {}).variables
    assert found == {"A": f"{first}/lib:{second}/lib", "AMENT_PREFIX_PATH": f"{first}:{second}"}
    assert set_up([tmp_path / "absent"], {}).variables == {"AMENT_PREFIX_PATH": f"{tmp_path}/absent"}


def test_a_package_comes_after_its_dependencies_and_a_circle_is_in_the_order_of_the_alphabet(tmp_path: Path) -> None:
    for name in ("a", "b", "c"):
        installed(tmp_path, name)
    written(tmp_path / "share/colcon-core/packages/a", "b:unknown")
    dependencies = written(tmp_path / "share/ament_index/resource_index/package_run_dependencies/b", "c;b")
    assert packages_of_prefix(tmp_path) == ["c", "b", "a"]
    dependencies.write_text("a")
    assert packages_of_prefix(tmp_path) == ["a", "b", "c"]

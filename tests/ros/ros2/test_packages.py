"""The packages of workspaces: built, and in source."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sim_action.core.workspace import PathError, Workspace
from sim_action.ros.ros2.installation import Ros2, find_ros
from sim_action.ros.ros2.packages import (
    Packages,
    PythonPackage,
    command_of,
    is_python,
    prefixes_in,
    read_package,
    workspace_of,
)
from tests.ros.ros2.prefixes import SETUP, installed, manifest, program, ros_prefix, source
from tests.ros_workspace import written

MOVER = {"mover": "my_robot.mover:main"}


def ros(folder: Path) -> Ros2:
    return find_ros({"AMENT_PREFIX_PATH": str(ros_prefix(folder))}, folder / "absent")


def isolated(workspace: Path, *names: str) -> list[Path]:
    """Builds packages as colcon does."""
    written(workspace / "install/.colcon_install_layout", "isolated\n")
    written(workspace / "install/COLCON_IGNORE", "")
    return [installed(workspace / "install" / name, name, "prepend-non-duplicate;A;lib\n") for name in names]


def test_isolated_and_merged_layouts_are_found(tmp_path: Path) -> None:
    first = isolated(tmp_path / "isolated", "a", "b")
    written(tmp_path / "isolated/install/other/share/x", "")
    merged = installed(installed(tmp_path / "merged/install", "a"), "b")
    for folder in (tmp_path / "isolated", tmp_path / "isolated/install"):
        assert prefixes_in(folder) == tuple(first)
    for folder in (tmp_path / "merged", merged):
        assert prefixes_in(folder) == (merged,)
        assert Packages.around(folder, None).installed == {"a": merged, "b": merged}
    assert prefixes_in(tmp_path) == ()


def test_a_built_package_hides_its_source(tmp_path: Path) -> None:
    built, _ = isolated(tmp_path, "built", "other")
    for name in ("built", "plain"):
        source(tmp_path, name)
    for folder in (tmp_path, tmp_path / "install"):
        packages = Packages.around(folder, None)
        assert packages.installed["built"] == built
        assert list(packages.sources) == ["plain"]
        assert packages.names == {"built", "other", "plain"}


def test_sources_are_found_anywhere_but_in_what_a_build_has_left(tmp_path: Path) -> None:
    manifest(tmp_path / "deep/robot", "robot")
    manifest(tmp_path / "build/copy", "copy")
    manifest(tmp_path / "ignored/p", "p")
    written(tmp_path / "ignored/COLCON_IGNORE", "")
    assert list(Packages.around(tmp_path, None).sources) == ["robot"]


def test_a_folder_with_an_install_folder_is_a_workspace(tmp_path: Path) -> None:
    root, inner = tmp_path / "root", tmp_path / "root/inner"
    source(root)
    isolated(inner, "p")
    scenario = written(inner / "tests/deep/drive.sim.yml", "").parent
    assert workspace_of(None, Workspace(scenario, root)) == inner
    assert workspace_of(None, Workspace(root / "other", root)) == root
    assert workspace_of("install", Workspace(inner, root)) == inner / "install"


def test_executables_are_installed_files_and_entry_points(tmp_path: Path) -> None:
    here = ros(tmp_path / "ros")
    of_ros = program(tmp_path / "ros/lib/geometry_msgs/talker")
    prefix, *_ = isolated(tmp_path / "ws", "built")
    talker = program(prefix / "lib/built/sub/talker")
    written(prefix / "lib/built/__pycache__/x.pyc", "")
    setup_text = SETUP.replace("entry", "scripts=['bin/run.py'], entry")
    folder = source(tmp_path / "ws", files={"setup.py": setup_text, "bin/run.py": ""})
    packages = Packages.around(tmp_path / "ws", here)
    assert packages.executables("built") == {"talker": talker}
    assert packages.executables("my_robot") == {"mover": None, "run.py": folder / "bin/run.py"}
    assert packages.executables("geometry_msgs") == {"talker": of_ros}
    assert packages.executables("absent") == {}
    assert Packages.around(tmp_path / "other", here).names >= {"geometry_msgs", "rclpy"}


def test_the_environment_has_workspaces_before_ros(tmp_path: Path) -> None:
    here = ros(tmp_path / "ros")
    built, _ = isolated(tmp_path / "ws", "built", "other")
    folder = source(tmp_path / "ws")
    (tmp_path / "scratch").mkdir()
    variables = Packages.around(tmp_path / "ws", here).set_up(tmp_path / "scratch")
    prefixes = variables["AMENT_PREFIX_PATH"].split(":")
    overlay = Path(prefixes[0])
    assert prefixes[1:] == [str(built), str(built.with_name("other")), str(here.prefix)]
    assert variables["A"] == f"{built}/lib:{built.with_name('other')}/lib"
    assert variables["PYTHONPATH"].split(":")[:1] == [str(folder)]
    assert (overlay / "share/my_robot").resolve() == folder
    assert (overlay / "share/ament_index/resource_index/packages/my_robot").is_file()
    # Without packages in source, there is no overlay.
    (tmp_path / "empty").mkdir()
    assert Packages.around(tmp_path / "no_ws", here).set_up(tmp_path / "empty") == here.variables
    assert list((tmp_path / "empty").iterdir()) == []


@pytest.mark.process
def test_an_entry_point_runs_as_it_would_when_installed(tmp_path: Path) -> None:
    folder = source(tmp_path / "a workspace")
    written(folder / "my_robot/mover.py", "import sys\n\n\ndef main():\n    print(sys.argv[1:])\n    return 3\n")
    here = ros(tmp_path / "ros")
    python = tmp_path / "a Python/python"
    python.parent.mkdir()
    python.symlink_to(sys.executable)
    installation = Ros2(here.prefixes, python, "jazzy", here.rmw, here.source, here.variables)
    packages = Packages.around(tmp_path / "a workspace", installation)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    environment = {**os.environ, "PYTHONPATH": packages.set_up(scratch)["PYTHONPATH"]}
    command = packages.command("my_robot", "mover", scratch)
    assert command[0] == str(python)
    # Launch files run the program itself.
    for words in (command, command[1:]):
        done = subprocess.run([*words, "a b"], env=environment, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (3, "['a b']\n"), done.stderr


def test_the_command_of_a_program_is_that_of_its_kind(tmp_path: Path) -> None:
    here = ros(tmp_path / "ros")
    prefix, *_ = isolated(tmp_path, "p")
    for name, text in {
        "talker": "\x7fELF",
        "mover": "#!/opt/other/bin/python3.11 -E\n",
        "run.sh": "#!/bin/sh\n",
    }.items():
        program(prefix / "lib/p" / name, text)
    packages = Packages.around(tmp_path, here)
    lib = prefix / "lib/p"
    assert packages.command("p", "talker", tmp_path) == [str(lib / "talker")]
    assert packages.command("p", "run.sh", tmp_path) == [str(lib / "run.sh")]
    assert packages.command("p", "mover", tmp_path) == [str(here.python), str(lib / "mover")]
    assert command_of(tmp_path / "x.py", here.python) == [str(here.python), str(tmp_path / "x.py")]
    with pytest.raises(PathError, match="'p/absent' does not exist any more"):
        packages.command("p", "absent", tmp_path)
    assert not is_python(tmp_path / "absent")
    assert is_python(program(tmp_path / "a", "#!/usr/bin/env python3\n"))


def package(folder: Path, **files: str) -> PythonPackage:
    manifest(folder, "my_robot")
    for name, text in files.items():
        written(folder / name.replace("_", "."), text)
    return read_package("my_robot", folder)


def setup(arguments: str, before: str = "") -> str:
    return f"from setuptools import setup\n{before}\nsetup({arguments})\n"


@pytest.mark.parametrize(
    "text",
    [
        SETUP,
        setup("entry_points={'console_scripts': ['mover = my_robot.mover:main']}"),
        setup("entry_points={'console_scripts': ('mover=my_robot.mover:main [extra]',)}"),
        setup("entry_points={'console_scripts': 'mover = my_robot.mover:main'}"),
        setup("entry_points='[console_scripts]\\nmover = my_robot.mover:main'"),
        setup("entry_points={'console_scripts': [f'mover = {name}.mover:main']}", "name = 'my_robot'"),
        setup("entry_points={'console_scripts': ['mover = ' + name + '.mover:main']}", "name = 'my_robot'"),
        setup("entry_points={'console_scripts': [] + nodes}", "nodes = ['mover = my_robot.mover:main']"),
        "import setuptools\nif __name__ == '__main__':\n    setuptools."
        + setup("").split("\n")[2][:5]
        + "(entry_points={'console_scripts': ['mover = my_robot.mover:main']})\n",
    ],
)
def test_entry_points_in_setup_py_are_read(text: str, tmp_path: Path) -> None:
    found = package(tmp_path, setup_py=text)
    assert (found.entry_points, found.unread, found.is_python, found.modules) == (MOVER, "", True, tmp_path)


def test_entry_points_in_other_files_are_read(tmp_path: Path) -> None:
    cfg = "[options.entry_points]\nconsole_scripts =\n    mover = my_robot.mover:main\n"
    toml = '[project]\nname = "my_robot"\n[project.scripts]\nlistener = "my_robot.listener:Node.main"\n'
    found = package(tmp_path, setup_py=setup(""), setup_cfg=cfg, pyproject_toml=toml)
    assert found.entry_points == {**MOVER, "listener": "my_robot.listener:Node.main"}


@pytest.mark.parametrize(
    "arguments",
    ["entry_points=read()", "entry_points={'console_scripts': [make('mover')]}", "**arguments", "entry_points=1 + 'a'"],
)
def test_computed_entry_points_are_not_run(arguments: str, tmp_path: Path) -> None:
    found = package(tmp_path, setup_py=setup(arguments))
    assert (found.entry_points, found.unread) == ({}, "setup.py")


@pytest.mark.parametrize(
    "files",
    [
        {"setup_py": "def broken("},
        {"setup_py": "x = \0"},
        {"setup_py": "(" * 5000},
        {"setup_py": setup("entry_points='no section'")},
        {"setup_py": setup("entry_points={'console_scripts': 3}")},
        {"setup_py": setup("entry_points={'console_scripts': [3, 'no equals', 'a b = c:d', 'a = 1', 'a = os;b']}")},
        {"setup_py": setup("entry_points=a", "a = b\nb = a")},
        {"setup_cfg": "no section"},
        {"pyproject_toml": "broken ="},
        {"pyproject_toml": "project = 1"},
        {"pyproject_toml": "[project]\nscripts = 1"},
    ],
)
def test_broken_files_have_no_entry_points(files: dict[str, str], tmp_path: Path) -> None:
    assert package(tmp_path, **files).entry_points == {}


def test_scripts_and_the_folder_of_modules_are_read(tmp_path: Path) -> None:
    written(tmp_path / "scripts/mover.py", "")
    written(tmp_path.parent / "outside.py", "")
    scripts = "scripts=['scripts/mover.py', 'scripts/absent.py', '../outside.py', 1]"
    found = package(tmp_path, setup_py=setup(f"{scripts}, package_dir={{'': 'lib'}}"))
    assert (found.scripts, found.modules) == ((tmp_path / "scripts/mover.py",), tmp_path / "lib")


def test_the_build_type_is_stated_or_that_of_the_build_files(tmp_path: Path) -> None:
    found = {}
    for stated, file in (("ament_cmake", "setup.py"), (None, "setup.py"), (None, "CMakeLists.txt")):
        folder = tmp_path / f"{stated} {file}"
        manifest(folder, "p", stated)
        written(folder / file, "")
        found[folder.name] = read_package("p", folder).build_type
    written(tmp_path / "package.xml", "<package")
    assert list(found.values()) == ["ament_cmake", "ament_python", "ament_cmake"], found
    assert read_package("p", tmp_path).build_type == "unknown"


def test_files_outside_of_the_package_are_not_read(tmp_path: Path) -> None:
    written(tmp_path / "secret.py", SETUP)
    folder = tmp_path / "p"
    manifest(folder, "p")
    (folder / "setup.py").symlink_to(tmp_path / "secret.py")
    (folder / "setup.cfg").symlink_to(folder / "setup.cfg")
    assert read_package("p", folder).entry_points == {}


CMAKE = """\
find_package(ament_cmake REQUIRED)
ament_python_install_package(${PROJECT_NAME})
install(PROGRAMS scripts/mover.py "scripts/other.py" DESTINATION lib/${PROJECT_NAME})  # add_executable(
install(DIRECTORY launch DESTINATION share/${PROJECT_NAME})
ament_package()
"""


@pytest.mark.parametrize(
    ("more", "runs"),
    [
        ("", True),
        ("add_executable(talker src/talker.cpp)\n", False),
        ('rosidl_generate_interfaces(${PROJECT_NAME} "msg/A.msg")\n', False),
        ("install(PROGRAMS scripts/run.sh DESTINATION lib/${PROJECT_NAME})\n", False),
    ],
)
def test_a_package_of_ament_cmake_runs_unbuilt_if_it_only_installs_python(
    more: str, runs: bool, tmp_path: Path
) -> None:
    folder = tmp_path / "src/robot"
    manifest(folder, "robot", "ament_cmake")
    written(folder / "CMakeLists.txt", CMAKE + more)
    for name in ("mover.py", "other.py", "run.sh"):
        written(folder / "scripts" / name, "")
    found = Packages.around(tmp_path, None).sources["robot"]
    assert found.is_python == runs
    if runs:
        assert [path.name for path in found.scripts] == ["mover.py", "other.py"]


@pytest.mark.parametrize("change", ["", "content", "link"])
def test_sources_that_differ_from_their_installed_copies_are_named(change: str, tmp_path: Path) -> None:
    (prefix,) = isolated(tmp_path, "robot")
    manifest(tmp_path / "src/robot", "robot")
    source = written(tmp_path / "src/robot/robot/mover.py", "a = 1\n")
    copy = prefix / "lib/python3.12/site-packages/robot/mover.py"
    if change == "link":
        copy.parent.mkdir(parents=True)
        copy.symlink_to(source)
    else:
        written(copy, "a = 2\n" if change else "a = 1\n")
    notes = Packages.around(tmp_path, None).notes
    expected = "not built again: 1 file (mover.py) differ from the copies in 'install', which run; run colcon build"
    assert notes == ([expected] if change == "content" else [])


def test_missing_modules_of_a_program_are_named(tmp_path: Path) -> None:
    written(tmp_path / "src/robot/setup.py", SETUP)
    manifest(tmp_path / "src/robot", "robot")
    written(tmp_path / "src/robot/robot/__init__.py", "")
    written(tmp_path / "beside.py", "")
    text = "import os.path\nimport beside, absent.part\nfrom robot import x\nfrom gone import y\nfrom . import z\n"
    program = written(tmp_path / "node.py", f"{text}try:\n    import optional\nexcept ImportError:\n    pass\n")
    packages = Packages.around(tmp_path, ros(tmp_path / "root"))
    assert packages.missing_modules(program) == ["absent", "gone"]
    written(tmp_path / "root/lib/python3.12/site-packages/gone/__init__.py", "")
    assert packages.missing_modules(program) == ["absent"]

"""Entry points of Python packages, read without running their code."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.ros.ros2.python_packages import PythonPackage, read_package
from tests.ros.ros2.prefixes import SETUP, manifest
from tests.ros_workspace import written

MOVER = {"mover": "my_robot.mover:main"}


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


@pytest.mark.parametrize(
    ("stated", "file", "build_type"),
    [
        ("ament_cmake", "setup.py", "ament_cmake"),
        (None, "setup.py", "ament_python"),
        (None, "CMakeLists.txt", "ament_cmake"),
    ],
)
def test_the_build_type_is_stated_or_that_of_the_build_files(
    stated: str | None, file: str, build_type: str, tmp_path: Path
) -> None:
    manifest(tmp_path, "p", stated)
    written(tmp_path / file, "")

    assert read_package("p", tmp_path).build_type == build_type


def test_a_broken_manifest_has_no_build_type(tmp_path: Path) -> None:
    written(tmp_path / "package.xml", "<package")

    assert read_package("p", tmp_path).build_type == "unknown"


def test_files_outside_of_the_package_are_not_read(tmp_path: Path) -> None:
    written(tmp_path / "secret.py", SETUP)
    folder = tmp_path / "p"
    manifest(folder, "p")
    (folder / "setup.py").symlink_to(tmp_path / "secret.py")
    (folder / "setup.cfg").symlink_to(folder / "setup.cfg")

    assert read_package("p", folder).entry_points == {}

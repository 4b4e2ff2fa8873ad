"""Each place in the package that opens a file is known, with the check that its path has passed."""

from __future__ import annotations

import ast
import functools
from pathlib import Path
from typing import Final

import sim_action

PACKAGE: Final = Path(sim_action.__file__).parent

READERS: Final = frozenset({"read_bytes", "read_text", "read_at_most", "open_regular"})
"""Functions that read a file, wherever they are called."""

ENGINES: Final = frozenset(
    {"from_file", "from_xml_path", "from_zip", "loadURDF", "loadSDF", "loadMJCF", "loadBullet", "loadTexture"}
)
"""Functions of engines that open files themselves."""
WATCHED: Final = READERS | ENGINES | {"from_string"}

GATED: Final = {
    "assertions/follow_path.py": "Workspace.file",
    "commands/logs/csv_table.py": "Workspace.file_or_folder",
    "commands/logs/damaged_logs.py": "as commands/logs/rosbag.py",
    "commands/logs/rosbag.py": "Workspace.file_or_folder, and Workspace.file for each file in the folder",
    "networks/onnx_network.py": "Workspace.file, also for its files with weights",
    "core/workspace.py": "only in folders of the workspace, and no link",
    "core/user_scripts.py": "Workspace.file",
    "meshes/__init__.py": "Packages.file, or Workspace.file for meshes of the world",
    "meshes/collada.py": "beside a mesh that was let through: only a name without folders, and no link",
    "robot/reading/control_tags.py": "Packages.file",
    "robot/documents/package_search.py": "Packages.may_read, or the environment of the job names the folder",
    "robot/reading/xacro_documents.py": "Packages.file",
    "robot/reading/xacro_expansion.py": "Packages.file",
    "robot/documents/xml_document.py": "Packages.file",
    "ros/ros1/catkin_packages.py": "exported_models: files of packages that are launched, which needs --allow-scripts",
    "ros/ros1/command_source/file_problems.py": "find_launch_file: only files of the package",
    "scenario/files.py": "Workspace.around, and Workspace.file for bases",
    "scenario/variations/values.py": "Workspace.file",
    "scenario/watched_files.py": "Packages.may_read for each path, with links resolved",
    "state/golden_trajectory.py": "Workspace.file",
    "world/shape_files/grids.py": "Workspace.file",
    "world/shapes.py": "Workspace.file",
}
"""Modules that open a file that a scenario or a model names -> the check that comes first."""

OWN: Final = frozenset(
    {
        "app/catalogue.py",
        "app/library_results.py",
        "networks/network_check.py",  # its own size in /proc
        "cli/init.py",  # its templates
        "cli/pyproject.py",  # only if it lies in the workspace, with links resolved
        "robot/documents/part_table.py",
        "core/files.py",
        "core/git_tree.py",
        "core/permissions.py",
        "core/provenance.py",
        "engines/mujoco/__init__.py",  # what installed packages state
        "recording/replay/replay_data.py",
        "reports/html/document.py",
        "reports/links.py",  # only a scenario file in the workspace, with links resolved
        "results/artifacts.py",
        "results/journal.py",
        "results/journal_seal.py",
        "results/results_json.py",
        "results/output_folder.py",
        "runner/cluster/task.py",
        "runner/cluster/workspace_archive.py",  # regular files of the workspace, links as links
        "runner/isolation/child_process.py",
        "runner/isolation/portable_child.py",
        "runner/isolation/process_control.py",
        "runner/run_keys.py",
        "runner/warm_process.py",
        "state/trace_storage.py",
    }
)
"""Modules that open files of sim-action, of the caller and of the system."""

CODE: Final = "ros/"  # other modules in this folder read files of ROS, after its nodes were allowed to run


@functools.cache
def calls() -> dict[str, frozenset[str]]:
    """Return the names of the functions and methods that each module calls, if it has a watched one."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        tree = ast.walk(ast.parse(text)) if any(name in text for name in WATCHED) else ()
        called = [node.func for node in tree if isinstance(node, ast.Call)]
        names = (call.attr if isinstance(call, ast.Attribute) else getattr(call, "id", "") for call in called)
        found[path.relative_to(PACKAGE).as_posix()] = frozenset(names)
    return found


def callers(functions: frozenset[str]) -> set[str]:
    """Return the modules that call one of these functions or methods."""
    return {module for module, names in calls().items() if names & functions}


def test_every_module_that_reads_files_is_in_the_table() -> None:
    found = callers(READERS)
    known = OWN | GATED.keys()
    assert {name for name in found if not name.startswith(CODE)} <= known, "resolve the path by Workspace or Packages"
    assert known <= found, "remove the row"


def test_only_two_modules_let_an_engine_open_a_file() -> None:
    # It is a file that the module itself has written.
    assert callers(ENGINES) == {"engines/pybullet/rigid_bodies.py", "engines/pybullet/loaded_bodies.py"}


def test_mujoco_gets_no_file_name() -> None:
    assert callers(frozenset({"from_string"})) == {"robot/reading/mjcf/mujoco_spec.py"}

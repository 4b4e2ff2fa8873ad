"""The key of a run includes each file that its scenario names: no example reads another one while it is loaded."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

# An audit hook cannot be removed, so it has a process of its own.
READS = """
import json, os, sys
from pathlib import Path

from sim_action.core.permissions import Permissions
from sim_action.runner.observed_inputs import python_folders
from sim_action.scenario.files import read_file
from sim_action.scenario.loading import Libraries, build_scene, checked
from sim_action.scenario.watched_files import NamedFiles

examples = os.path.abspath("examples")
opened = set()

def hear(event, arguments):
    if event == "open" and not isinstance(arguments[0], int):
        path = os.path.realpath(os.fsdecode(arguments[0]))
        if path.startswith(examples) and not path.endswith(".pyc"):
            opened.add(path)

sys.addaudithook(hear)
named, left, count = NamedFiles(), {}, 0
for file in sorted(Path("examples").rglob("*.sim.yml")):
    # Those of packages are valid where the packages are installed.
    for source in read_file(file, Permissions())[:1] if "packages" not in file.parts else ():
        opened.clear()
        read_file(file, Permissions())
        loaded = checked(source, Permissions(), Libraries(), evaluate=True)
        build_scene(loaded)
        # Nodes of ROS are processes: their runs have no key.
        if not any(key in json.dumps(source.document.data) for key in ("ros1", "ros2")):
            count += 1
            left[str(file)] = sorted(opened - {os.path.realpath(path) for path in named.of(source)})
print(json.dumps([count, {file: paths for file, paths in left.items() if paths}]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="some examples need programs of Unix")
def test_all_files_that_examples_read_are_named() -> None:
    ran = subprocess.run([sys.executable, "-c", READS], cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    count, left = json.loads(ran.stdout)
    assert count > 40
    assert left == {}

"""`sim-action doctor` says what is there, what is missing, and what prevents scenarios from running."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import pytest

from sim_action.engines import installed
from tests.integration.conftest import outside_of_github

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")


def doctor(**variables: str) -> tuple[int, dict[str, tuple[str, str]]]:
    """The exit code, and name -> mark and text, below half of the address space that a scenario may use."""
    found = subprocess.run(
        [sys.executable, "-m", "sim_action", "doctor"],
        env=outside_of_github(variables),
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30)),
    )
    assert found.stderr == ""
    lines = [(line[:3].strip(), line[3:19].strip(), line[20:]) for line in found.stdout.splitlines()]
    return found.returncode, {name: (mark, text) for mark, name, text in lines}


def test_engines_drive_a_robot_and_limits_and_folders_are_told(tmp_path: Path) -> None:
    code, told = doctor(TMPDIR=str(tmp_path), XDG_CACHE_HOME=str(tmp_path / "cache"))
    assert code == 0
    for engine in installed():
        mark, text = told[engine]
        assert (mark, text.rpartition(": ")[2]) == ("ok", "a robot drove")
    assert {"sim-action", "mcap", "parallel runs", "temporary files", "cache", "ROS 1", "ROS 2"} <= set(told)
    # Scenarios run all the same.
    assert told["memory"][0] == "-"
    assert told["memory"][1].startswith("2 GiB of address space, and a scenario may use 4")
    assert told["temporary files"][1].startswith(f"{tmp_path}, ")
    assert told["cache"] == ("ok", f"0 MB of hulls of meshes in {tmp_path / 'cache/sim-action'}")


def test_a_missing_engine_and_a_missing_extra_say_how_to_get_them(tmp_path: Path) -> None:
    for name in ("mujoco", "mcap"):
        (tmp_path / name).mkdir()
    # An import that finds nothing there: as if neither was installed.
    (tmp_path / "sitecustomize.py").write_text(
        "import importlib.util as util\n"
        "find = util.find_spec\n"
        "util.find_spec = lambda name, package=None: None if name in ('mujoco', 'mcap') else find(name, package)\n"
    )
    _, told = doctor(PYTHONPATH=f"{tmp_path}:{Path(__file__).parents[2]}")
    assert told["mujoco"] == ("-", "not installed; pip install mujoco-core")
    assert told["mcap"][1].startswith("not installed; pip install 'sim-action[mcap]' adds recordings")

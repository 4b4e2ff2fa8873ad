"""What tests of the actions share: one installation of what they need, and scenarios that pass, fail and run code."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.integration.github import ActionResult, Runner
from tests.integration.warm import WARM
from tests.patience import PATIENCE

ACTION = Path(__file__).parent.parent.parent
TUTORIAL = (ACTION / "examples/turtlebot3/straight_line.sim.yml").read_text(encoding="utf-8")
STUCK = TUTORIAL.replace("linear: 1.0", "linear: 0.0")
INVALID = TUTORIAL.replace("travel:", "travle:")
ASSERTION_LINE = next(number for number, line in enumerate(TUTORIAL.splitlines(), 1) if "travel:" in line)

BOX = """\
<robot name="box">
  <link name="base">
    <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><geometry><box size="1 1 1"/></geometry></collision>
  </link>
</robot>
"""
SCRIPTED = """\
name: box stands still
robot: {model: box.urdf}
commands: {script: controller.py}
expect: [{travel: {at_least: 1 m}}]
time_limit: 1 s
"""

# What a module does when it stands in for one of ours.
IMPOSTOR = "open('pwned', 'w').close()\nraise SystemExit('an impostor was imported')\n"


@pytest.fixture(scope="session")
def runner_temp(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Iterator[Path]:
    """A RUNNER_TEMP in which the actions have been once, shared by all workers of the session, removed by the last."""
    session = tmp_path_factory.getbasetemp()
    session = session if worker_id == "master" else session.parent
    temp, users = session / "runner temp", session / "runner-temp-users"
    with locked(session / "runner-temp-lock"):
        others = users.read_text() if users.exists() else ""
        if not others:
            temp.mkdir(exist_ok=True)
            install_among_impostors(temp, session / "impostors")
        users.write_text(others + "+")
    yield temp
    with locked(session / "runner-temp-lock"):
        users.write_text(users.read_text()[:-1])
        if not users.read_text():
            shutil.rmtree(temp)


@contextmanager
def locked(path: Path) -> Iterator[None]:
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def install_among_impostors(temp: Path, folder: Path) -> None:
    for name in ("pip", "venv", "ensurepip", "sitecustomize", "click", "sim_action"):
        write(folder / f"{name}.py", IMPOSTOR)
    runner = Runner(folder, temp, variables={"PYTHONPATH": str(folder), "PYTHONHOME": str(folder)})
    # The smaller ones first: an environment that has more packages would do for them, too.
    nothing_to_deal = runner.run(ACTION / "matrix", {"shards": "2"})
    nothing_to_join = runner.run(ACTION / "merge", {"results": "nowhere"})
    assert (nothing_to_deal.exit_code, nothing_to_join.exit_code) == (5, 2), nothing_to_deal.log + nothing_to_join.log
    nothing_to_run = runner.run(ACTION, {"backend": "all"})
    assert nothing_to_run.exit_code == 5, nothing_to_run.log
    assert len(list(temp.glob("sim-action-*/requirements.lock"))) == 3
    assert not (folder / "pwned").exists()


def write(path: Path, text: str) -> Path:
    """Writes a file, and makes the folders above it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def runner(tmp_path: Path, runner_temp: Path) -> Runner:
    workspace = tmp_path / "work space"
    workspace.mkdir()
    return Runner(workspace, runner_temp)


def counts(result: ActionResult) -> dict[str, str]:
    return {name: result.outputs[name] for name in ("total", "passed", "failed", "errors")}


def environment(temp: Path) -> Path:
    """The folder in which the action has installed the engines."""
    markers = temp.glob("sim-action-*/requirements.lock")
    [folder] = [marker.parent for marker in markers if "mujoco-core==" in marker.read_text(encoding="utf-8")]
    return folder


def sim_action(
    folder: Path, *arguments: str, program: str = "sim-action", **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run the command line, or pytest, outside of GitHub, forked from a process that has imported everything."""
    code, printed, errors = WARM.call(folder, arguments, outside_of_github(variables), program)
    return subprocess.CompletedProcess([program, *arguments], code, printed, errors)


def fresh_sim_action(folder: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run the command line outside of GitHub in an interpreter of its own."""
    return interpreter(folder, "-m", "sim_action", *arguments, env=outside_of_github(variables))


def interpreter(
    folder: Path, *arguments: str | Path, env: Mapping[str, str], python: str = sys.executable
) -> subprocess.CompletedProcess[str]:
    """Run the interpreter of the tests, or another one, with these arguments."""
    command = [python, *arguments]
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False, timeout=PATIENCE)


# The command line, and then its exit code and the peak of its own memory in kB.
_MEASURED = """
import re, sys
from pathlib import Path
from sim_action.cli.main import call, leave
code = call(sys.argv[1:])
peak = re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())[1]
Path("peak").write_text(f"{code} {peak}")
leave(code)
"""


def peak_kb(folder: Path, *arguments: str) -> tuple[int, int]:
    """The exit code of a call in an interpreter of its own, and its largest memory in kB, without its children."""
    variables = outside_of_github({"XDG_CACHE_HOME": str(folder / "cache")})
    interpreter(folder, "-c", _MEASURED, *arguments, env=variables)
    code, peak = map(int, (folder / "peak").read_text().split())
    return code, peak


def outcomes(folder: Path) -> list[dict[str, Any]]:
    """The outcomes in `results.json` of the output folder."""
    results = json.loads((folder / "sim-results/results.json").read_text(encoding="utf-8"))
    return list(results["outcomes"])


def outside_of_github(variables: dict[str, str]) -> dict[str, str]:
    """The environment of a call: equal in all of them but for these variables, as `--resume` compares it."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("GITHUB_")}
    return {**kept, "PYTHONPATH": str(ACTION), **variables}

"""No code of the repository runs where it is not allowed to: every subcommand, event and kind of code."""

from __future__ import annotations

import os
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Final
from xml.sax.saxutils import quoteattr

import pytest

from sim_action.cli.main import call, program
from sim_action.core.permissions import PRIVILEGED_EVENTS
from tests.integration.conftest import interpreter
from tests.onnx_files import linear
from tests.ros.ros1.launches import needs_ros, package
from tests.ros.ros2.nodes import needs_ros2, variables
from tests.ros.ros2.prefixes import source
from tests.soak import soaked

ROOT: Final = Path(__file__).resolve().parents[2]

CASE: Final = """\
name: {name}
robot: {{model: {model}}}
{commands}
expect: [{expect}]
time_limit: 1 s
"""
MARK: Final = "open({marker!r}, 'a').write({kind!r} + chr(10))\n"
BODIES: Final[Mapping[str, str]] = {
    "function.py": "{mark}\ndef control(observation): ...\n",
    "map.py": "{mark}\ndef control(observation, x): ...\n",
    "class.py": "class Controller:\n    def reset(self, robot):\n        {mark}\n    def step(self, _): ...\n",
    "ctl.py": "import sys\n{mark}\nfor line in sys.stdin:\n    print('{{}}', flush=True)\n",
    "judge.py": "{mark}\nclass Judge:\n    def judge(self, trace): ...\n",
}
EVALUATED: Final = "evaluated-42"  # the marker of xacro, whose expressions cannot write files

XACRO: Final = """\
<robot name="nosy" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <link name="evaluated-${6 * 7}">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="1 1 1"/></geometry></collision>
  </link>
</robot>
"""
SCENARIOS: Final = {
    "function": {"commands": "commands: {rate: 10 Hz, script: function.py}"},
    "class": {"commands": "commands: {rate: 10 Hz, script: class.py}"},
    "map": {"commands": "commands: {script: {file: map.py, rate: 10 Hz, with: {x: 1}}}"},
    "process": {"commands": "commands: {rate: 10 Hz, process: python3 ctl.py}"},
    # A network cannot leave a marker.
    "policy": {
        "commands": "commands: {policy: {file: p.onnx, rate: 10 Hz, observation: [time], action: {joints: effort}}}"
    },
    "assertion": {"expect": "assertion: judge.py:Judge"},
    "xacro": {"model": "nosy.urdf.xacro"},
}
CALLS: Final[Mapping[str, list[str]]] = {
    "run": ["run", "--no-report", "--quiet", "."],
    "validate": ["validate", "."],
    "matrix": ["matrix", "--shards", "2", "."],
    "merge": ["merge", "--no-report", "--scenarios", ".", "--output-dir", "merged", "sim-results"],
    "compare": ["compare", "sim-results", "sim-results"],
    "prove": ["prove", "--quiet", "--only", "silenced", "."],
    "margins": ["margins", "--quiet", "--factor", "friction", "--runs", "2", "."],
    "report": ["report"],
    "view": ["view", "--print"],
    "rostest": ["rostest", "--no-report", "nosy", "nosy.test"],
    "roslaunch": ["roslaunch", "--no-report", "--sim-time-limit", "1", "nosy", "nosy.launch"],
    "launchtest": ["launchtest", "--no-report", "nosy", "nosy_test.py"],
    "ros2": ["ros2", "prepare", "."],
    "init": ["init", "new"],
    "inspect": ["inspect", "nosy.urdf.xacro"],
    "models": ["models"],
    "assertions": ["assertions"],
    "commands": ["commands"],
    "sensors": ["sensors"],
    "schema": ["schema"],
    "explain": ["explain", "upright"],
    "guide": ["guide"],
    "doctor": ["doctor"],
}
LAUNCH: Final = """\
<launch>
  <arg name="x" default="$(eval 6 * 7)"/>
  <include file="$(find turtlebot3_gazebo)/launch/turtlebot3_empty_world.launch"/>
  {0}
</launch>
"""
NODE: Final = "#!/usr/bin/env python\nimport sys\nkind = sys.argv[1]\n{mark}"
GATED: Final = ("run", "prove", "margins", "rostest", "roslaunch", "launchtest", "ros2", "inspect")
"""The subcommands that run code of the repository."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository with every kind of code, each of which leaves a marker."""
    for name in [name for name in os.environ if name.startswith("GITHUB_")]:
        monkeypatch.delenv(name)
    monkeypatch.chdir(tmp_path)
    for name, body in BODIES.items():
        Path(name).write_text(body.format(mark=mark(tmp_path, name)))
    Path("nosy.urdf.xacro").write_text(XACRO)
    Path("p.onnx").write_bytes(linear([[1.0, 1.0]], [0.0, 0.0]))
    for name, keys in SCENARIOS.items():
        Path(f"{name}.sim.yml").write_text(case(name, **keys))
    node = NODE.format(mark=f"open({str(tmp_path / 'marker')!r}, 'a').write(kind + chr(10))\n")
    test = '<test test-name="x" pkg="nosy" type="nosy.py" args="rostest"/>'
    launched = '<node name="x" pkg="nosy" type="nosy.py" args="roslaunch"/>'
    files = {"nosy_test.py": mark(tmp_path, "launchtest")} | {
        "scripts/nosy.py": node,
        "nosy.test": LAUNCH.format(test),
        "launch/nosy.launch": LAUNCH.format(launched),
    }
    package(tmp_path, "nosy", files)
    Path("nosy_node.py").write_text(mark(tmp_path, "ros2"))
    evaluated = f'$(eval \'open("{tmp_path}/marker", "a").write("ros2_eval ")\')'
    (tmp_path / "mark.sh").write_text(f"echo ros2_command >> '{tmp_path}/marker'\n")
    texts = "".join(f"<log message={quoteattr(text)}/>" for text in (evaluated, f"$(command 'sh {tmp_path}/mark.sh')"))
    launches = {
        "launch/nosy.launch.py": mark(tmp_path, "ros2_launch"),
        "launch/nosy.launch.xml": f"<launch>{texts}</launch>",
    }
    source(tmp_path, "nosy2", {"setup.py": "from setuptools import setup\n\nsetup()\n", **launches})
    return tmp_path


def mark(folder: Path, kind: str) -> str:
    return MARK.format(marker=str(folder / "marker"), kind=kind).strip()


def case(
    name: str, model: str = "turtlebot3_burger", commands: str = "# no commands", expect: str = "no_collision"
) -> str:
    return CASE.format(name=name, model=model, commands=commands, expect=expect)


def markers(folder: Path, printed: str = "") -> set[str]:
    """The kinds of code that ran."""
    marker = folder / "marker"
    found = set(marker.read_text().split()) if marker.exists() else set()
    texts = [printed, *(path.read_text(errors="replace") for path in folder.glob("sim-results/*.json"))]
    return found | ({"xacro"} if any(EVALUATED in text for text in texts) else set())


def test_every_subcommand_is_called_here() -> None:
    """A new subcommand needs a line in CALLS, and, if it runs code, the options of `code_flags`."""
    assert set(CALLS) == set(program.commands)

    def offering(option: str) -> set[str | None]:
        commands = program.commands.values()
        return {command.name for command in commands if option in {parameter.name for parameter in command.params}}

    assert offering("allow_scripts") == offering("pass_env") == set(GATED)


def test_code_runs_where_it_is_allowed(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("GITHUB_EVENT_NAME", "pull_request")
    assert call(CALLS["run"]) == 1
    assert call(CALLS["inspect"]) == 0
    assert markers(folder, capsys.readouterr().out) == {*BODIES, "xacro"}


@pytest.mark.soak
@needs_ros
def test_nodes_run_where_they_are_allowed(folder: Path) -> None:
    Path("nodes.sim.yml").write_text(
        case("nodes", commands="commands: {rate: 10 Hz, ros1: {nodes: [{package: nosy, type: nosy.py, args: ros1}]}}")
    )
    call(["run", "--no-report", "nodes.sim.yml"])
    call(CALLS["roslaunch"])
    call(CALLS["rostest"])
    assert {"ros1", "roslaunch", "rostest"} <= markers(folder)


@needs_ros2
def test_nodes_of_ros_2_run_where_they_are_allowed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in variables().items():
        monkeypatch.setenv(name, value)
    for path in folder.glob("*.sim.yml"):
        path.unlink()
    for name in ("ros2", "ros2_launch", "ros2_texts"):
        Path(f"{name}.sim.yml").write_text(case(name, commands=NODES[name]))
    call(["run", "--no-report", "."])
    assert {"ros2", "ros2_launch", "ros2_eval", "ros2_command"} <= markers(folder)


def test_other_subcommands_run_no_code_anywhere(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call([*CALLS["run"], "--allow-scripts", "false"])
    for name in sorted(set(CALLS) - set(GATED)):
        capsys.readouterr()
        call(CALLS[name])
        assert (name, markers(folder, capsys.readouterr().out)) == (name, set())


NODES: Final = {
    "ros1": "commands: {rate: 10 Hz, ros1: {nodes: [nosy/nosy.py]}}",
    "ros2": "commands: {rate: 10 Hz, ros2: {nodes: [./nosy_node.py]}}",
    "ros2_launch": "commands: {rate: 10 Hz, ros2: {launch: [nosy2, nosy.launch.py]}}",
    "ros2_texts": "commands: {rate: 10 Hz, ros2: {launch: [nosy2, nosy.launch.xml]}}",
}


# tests/core/test_permissions.py has all of them.
SOME_EVENTS: Final = ("pull_request_target", "push", "pull_request_review", "false")


@pytest.mark.parametrize(
    ("name", "event"),
    soaked(
        product(GATED, sorted(PRIVILEGED_EVENTS | set(SOME_EVENTS))),
        short=[*product(GATED, SOME_EVENTS[:1]), *product(["run"], SOME_EVENTS[1:])],
    ),
)
def test_code_is_refused(
    name: str, event: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = list(CALLS[name])
    if event == "false":
        words[1:1] = ["--allow-scripts", "false"]
    else:
        monkeypatch.setenv("GITHUB_EVENT_NAME", event)
        monkeypatch.setenv("GITHUB_REPOSITORY_OWNER", "owner")
    if event == "push":
        # The checkout of a fork.
        Path(".git").mkdir()
        Path(".git/config").write_text('[remote "origin"]\n\turl = https://github.com/stranger/robot\n')
    elif event == "pull_request_review":
        ref = Path(".git/refs/remotes/pull/7/merge")
        ref.parent.mkdir(parents=True)
        ref.write_text("1" * 40)
    for key, commands in NODES.items():
        Path(f"{key}.sim.yml").write_text(case(key, commands=commands))
    assert call(words) == 2
    captured = capsys.readouterr()
    printed = captured.out + captured.err
    assert markers(folder, printed) == set()
    refusals = [line for line in printed.splitlines() if "allow-scripts" in line]
    several = name in ("run", "prove", "margins")
    assert len(refusals) == (len(SCENARIOS) + len(NODES) if several else 1), printed
    assert all("scripts are not" in line for line in refusals)


IMPOSTORS: Final = (
    *("yaml", "numpy", "sitecustomize", "usercustomize", "click", "pydantic", "json", "conftest", "xacro"),
    *("mujoco", "pybullet", "antigravity", "startup"),
)


@pytest.mark.parametrize(
    "words",
    [
        ["-P", "-m", "sim_action", "validate", "."],
        ["-P", "-m", "sim_action", "run", "--repeat", "2", "--allow-scripts", "false", "."],
        ["-P", "-m", "sim_action", "inspect", "box.urdf.xacro"],
        # Python itself imports modules of the standard library from the current folder, such as json, if it needs any.
        ["-m", "sim_action", "validate", "."],
    ],
    ids=" ".join,
)
def test_no_file_is_imported_by_its_name_alone(words: list[str], tmp_path: Path) -> None:
    for name in IMPOSTORS:
        (tmp_path / f"{name}.py").write_text(f"{mark(tmp_path, name)}\n")
    (tmp_path / "evil.pth").write_text(f"import os; {mark(tmp_path, 'pth')}\n")
    (tmp_path / "sim_action").mkdir()
    hooks = f'- {{id: x, entry: python -c "{mark(tmp_path, "hook")}", language: system, name: x}}\n'
    (tmp_path / ".pre-commit-hooks.yaml").write_text(hooks)
    (tmp_path / "setup.py").write_text(mark(tmp_path, "setup"))
    (tmp_path / "pyproject.toml").write_text('[build-system]\nbuild-backend = "startup"\nbackend-path = ["."]\n')
    (tmp_path / "box.urdf.xacro").write_text(XACRO)
    (tmp_path / "a.sim.yml").write_text(case("a", commands="commands: {rate: 10 Hz, twist: [{linear: 0.1}]}"))
    variables = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONSTARTUP": str(tmp_path / "startup.py")}
    if words[0] != "-P":
        (tmp_path / "sim_action").rmdir()
    done = interpreter(tmp_path, *words, env=variables)
    assert done.returncode == 0, done.stdout + done.stderr
    assert markers(tmp_path) == set()

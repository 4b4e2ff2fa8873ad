"""The guess of the engines: one that asks too little costs time, and these files must not cost it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from action import asked_engines as module
from action.asked_engines import BOTH, asked_engines

PYBULLET, MUJOCO = frozenset({"pybullet"}), frozenset({"mujoco"})
PLAIN = "name: a\nrobot: {model: turtlebot3_burger}\nexpect: [{travel: {at_least: 1 m}}]\n"


def asked(folder: Path, **variables: str) -> frozenset[str]:
    return asked_engines({"INPUT_WORKING_DIRECTORY": str(folder), **variables})


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep/plain.sim.yml").write_text(PLAIN)
    return tmp_path


def test_scenarios_without_an_engine_get_the_default(workspace: Path) -> None:
    assert asked(workspace) == PYBULLET
    (workspace / "package.xml").write_text("<package><mujoco/></package>")
    (workspace / "controller.py").write_text("backend = 'mujoco'")
    (workspace / ".github").mkdir()
    steps = "    - with:\n        backend: mujoco\n    - run: pytest --junitxml=a.xml\n"
    (workspace / ".github/test.yml").write_text(f"on: push\njobs:\n  a:\n    steps:\n{steps}")
    (workspace / ".github/robot.yml").write_text("robot: {steps: [run: pytest --junitxml=a.xml]}\n")
    (workspace / "launch.yaml").write_text("urdf: robot.xml\nbackends: [mujoco]\n")
    (workspace / "compose.yml").write_text("services:\n  robot: {volumes: [robot.xml:/robot.xml]}\n# robot: a.xml\n")
    (workspace / "ros.sim.yml").write_text(f"{PLAIN}ros2: {{launch: a.launch.xml}}  # see package.xml\n")
    pytest_alone = '[project]\ndependencies = ["mujoco"]\n[tool.pytest]\naddopts = "--junitxml=a.xml"\n'
    (workspace / "pyproject.toml").write_text(f'{pytest_alone}[tool.sim-action]\njunit = "b.xml"\n')
    assert asked(workspace) == PYBULLET


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.sim.yml", "backend: mujoco\n"),
        ("a.sim.yaml", "backend: 'mujoco'\n"),
        ("a.sim.yml", '"backend" : "mujoco"\n'),
        ("a.sim.yml", "{name: a, backend: mujoco}\n"),
        ("a.sim.yml", "? backend\n: mujoco\n"),
        ("a.sim.yml", "backend: !!str mujoco\n"),
        ("a.sim.yml", "name: a\r\nbackend: mujoco\r\n"),
        ("a.sim.yml", "x: &engine mujoco\nbackend: *engine\n"),
        ("a.sim.yml", "variations: {backend: [pybullet, mujoco]}\n"),
        ("a.sim.yml", "variations:\n  backend:\n    values:\n      - mujoco\n"),
        ("a.sim.yml", "agreement: {position: 1 cm}\n"),
        ("a.sim.yml", "robot: {model: models/arm.xml}\n"),
        ("a.sim.yml", "robot: {model: models/arm.MJCF}\n"),
        ("a.sim.yml", 'backend: "muj\\x6fco"\n'),
        ("a.sim.yml", 'backend: "muj\\\n  oco"\n'),
        ("common.base.yml", "backend: mujoco\n"),
        ("any name.yml", "backend: mujoco\n"),
        ("base.yml", "\ufeffrobot:\n  model: arm.xml\n"),
        ("base.yml", "# a base\n---\n'robot': {model: arm.xml}\n"),
        ("pyproject.toml", '[tool.sim-action]\nbackend = "mujoco"\n'),
        ("pyproject.toml", '[tool.sim-action]\nbackend = "all"\n'),
        ("pyproject.toml", 'tool.sim-action.backend = "muj\\u006fco"\n'),
        ("pyproject.toml", "[tool.sim-action\n"),
        ("pyproject.toml", "tool = 1\n"),
    ],
)
def test_files_that_can_ask_for_both_get_both(name: str, text: str, workspace: Path) -> None:
    for file in (workspace / name, workspace / "deep" / name):
        file.write_bytes(text.encode())
        assert asked(workspace) == BOTH
        file.unlink()


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig", "utf-32"])
def test_encodings_of_yaml_are_searched(encoding: str, workspace: Path) -> None:
    (workspace / "a.sim.yml").write_bytes("backend: mujoco\n".encode(encoding))
    assert "mujoco" in asked(workspace)


@pytest.mark.parametrize(
    ("variables", "expected"),
    [
        ({"INPUT_BACKEND": "mujoco"}, MUJOCO),
        ({"INPUT_BACKEND": " pybullet "}, PYBULLET),
        ({"INPUT_BACKEND": "all"}, BOTH),
        ({"INPUT_BACKEND": "unknown"}, BOTH),
        ({"SIM_ACTION_BACKEND": "mujoco"}, MUJOCO),
        ({"SIM_ACTION_BACKEND": "all"}, BOTH),
        ({"INPUT_BACKEND": "pybullet", "SIM_ACTION_BACKEND": "mujoco"}, PYBULLET),
        ({"INPUT_BACKEND": "auto"}, PYBULLET),
        ({}, PYBULLET),
    ],
)
def test_the_caller_decides_first(variables: dict[str, str], expected: frozenset[str], workspace: Path) -> None:
    assert asked(workspace, **variables) == expected


def test_the_engines_of_folders(tmp_path: Path) -> None:
    assert asked(tmp_path) == PYBULLET
    for name in ("a.sim.yml", "b.sim.yaml"):
        (tmp_path / name).write_text(f"{PLAIN}backend: mujoco\n")
    (tmp_path / "other.yml").write_text("a: 1\n")
    assert asked(tmp_path) == MUJOCO
    (tmp_path / "c.sim.yml").write_text(f"{PLAIN}backend: pybullet\n")
    assert asked(tmp_path) == BOTH


def test_settings_above_the_working_directory_count(workspace: Path) -> None:
    (workspace / "pyproject.toml").write_text('[tool.sim-action]\nbackend = "mujoco"\n')
    assert asked(workspace / "deep") == BOTH


def test_what_cannot_be_searched_gets_both(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert asked(workspace / "missing") == BOTH
    assert asked_engines({"INPUT_WORKING_DIRECTORY": "a\0b"}) == BOTH
    (workspace / "large.yml").write_bytes(b"#" * 1_000_001)
    assert asked(workspace) == BOTH
    (workspace / "large.yml").unlink()
    monkeypatch.setattr(module, "_MAX_ENTRIES", 1)
    assert asked(workspace) == BOTH


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_links_lead_to_regular_files_inside_or_get_both(tmp_path: Path) -> None:
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "plain.txt").write_text(PLAIN)
    link = inside / "a.sim.yml"
    link.symlink_to("plain.txt")
    assert asked(inside) == PYBULLET
    (tmp_path / "outside.yml").write_text(PLAIN)
    for target in ("/dev/ptmx", "/dev/zero", "../outside.yml", "missing", "a.sim.yml"):
        link.unlink()
        link.symlink_to(target)
        assert asked(inside) == BOTH, target
    link.unlink()
    for target in ("/dev/ptmx", "/dev/zero"):
        (tmp_path / "pyproject.toml").symlink_to(target)
        assert asked(inside) == BOTH, target
        (tmp_path / "pyproject.toml").unlink()


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such pipes")
def test_a_pipe_is_not_waited_for(workspace: Path) -> None:
    os.mkfifo(workspace / "pipe.yml")
    assert asked(workspace) == BOTH


def test_all_files_together_are_limited(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_MAX_TOTAL_BYTES", len(PLAIN))
    assert asked(workspace) == PYBULLET
    (workspace / "b.yml").write_text("a: 1\n")
    assert asked(workspace) == BOTH


def test_folders_that_are_too_deep_to_walk_get_both(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise RecursionError

    monkeypatch.setattr("action.asked_engines.os.walk", refuse)
    assert asked(workspace) == BOTH

"""The block to paste is YAML that reads back as what it was written from, whatever the names."""

from __future__ import annotations

from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.yaml_document import read_document
from sim_action.drives.diff import DiffDrive
from sim_action.robot.spec import Robot
from sim_action.scenario.robot_block import robot_block

names = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), min_size=1, max_size=20)


def read(block: str) -> Any:
    data = read_document("it.sim.yml", block).data
    assert isinstance(data, dict)
    return data["robot"]


def test_only_what_differs_is_written() -> None:
    assert robot_block(Robot(model="robots/arm.urdf"), None) == "robot:\n  model: robots/arm.urdf\n"


def test_all_of_it() -> None:
    robot = Robot(
        model="my robots/arm.xacro",
        base="fixed",
        args={"lidar": "true", "mass": 3},
        packages={"a": "../a"},
        allow=("b",),
    )
    drive = DiffDrive(left=("l",), right=("r",), radius=0.05)
    assert robot_block(robot, drive, "base: free").splitlines() == [
        "robot:",
        '  model: "my robots/arm.xacro"',
        "  base: fixed",
        '  args: {lidar: "true", mass: 3}',
        "  packages: {a: ../a}",
        "  allow: [b]",
        "  drive: {diff: {left: [l], right: [r], radius: 0.05}}",
        "  # base: free",
    ]


@pytest.mark.parametrize(
    "name",
    [
        "on",
        "null",
        "~",
        "1e3",
        "0x1",
        "a: b",
        "#a",
        "[",
        "-",
        "'",
        '"',
        "\u2028",
        "🤖",
        ".5",
        ".1e3",
        ".5e-3",
        ".",
        "..",
        ".inf",
    ],
)
def test_names_that_yaml_would_take_for_something_else_are_quoted(name: str) -> None:
    block = robot_block(Robot(model=name, args={"a": name}), None)
    assert read(block) == {"model": name, "args": {"a": name}}
    assert yaml.safe_load(block) == {"robot": {"model": name, "args": {"a": name}}}


@pytest.mark.parametrize("name", ["./a.urdf", "../a.urdf", "/a.urdf", "_a", "a.b", "a-1"])
def test_paths_and_names_stand_as_they_are(name: str) -> None:
    assert robot_block(Robot(model=name), None) == f"robot:\n  model: {name}\n"


@given(names, names, names)
def test_what_is_written_reads_back(model: str, left: str, right: str) -> None:
    robot = Robot(model=model, args={left: right}, packages={right: left})
    drive = DiffDrive(left=(left,), right=(right,))
    assert read(robot_block(robot, drive)) == {
        "model": model,
        "args": {left: right},
        "packages": {right: left},
        "drive": {"diff": {"left": (left,), "right": (right,)}},
    }

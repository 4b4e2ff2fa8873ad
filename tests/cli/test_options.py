"""What is typed beside a model's name."""

from __future__ import annotations

import pytest

from sim_action.cli.options import asked_model
from sim_action.core.errors import UsageError
from sim_action.robot.spec import Robot


def flags(*args: str, packages: tuple[str, ...] = ()) -> dict[str, object]:
    return {"args": args, "packages": packages, "allow_outside": True}


def test_pairs_become_what_a_scenario_would_say() -> None:
    robot, workspace = asked_model("a.xacro", flags("lidar=true", "pose=x=1", "none=", packages=("meshes=../m",)))
    args: dict[str, str | bool | int | float] = {"lidar": "true", "pose": "x=1", "none": ""}
    assert robot == Robot(model="a.xacro", args=args, packages={"meshes": "../m"})
    assert workspace.allow_outside


@pytest.mark.parametrize("text", ["lidar", "=true", ""])
def test_what_is_no_pair_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="--arg takes NAME=VALUE, found"):
        asked_model("a.xacro", flags(text))
    with pytest.raises(UsageError, match="--package takes NAME=VALUE, found"):
        asked_model("a.xacro", flags(packages=(text,)))

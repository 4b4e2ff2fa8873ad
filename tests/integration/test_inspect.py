"""What `sim-action inspect` says of real robots: it is what the engine has, and its block runs as it stands."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import pytest
import yaml

from tests.integration.conftest import outcomes, sim_action
from tests.ros_workspace import ros_workspace
from tools.bench.robots import ROBOTS, KnownRobot

# A robot that drives, an arm, one that falls on its side.
PASTED: Final = frozenset({"r2d2", "kuka_iiwa", "laikago"})
BLOCK: Final = "block for a scenario in this folder:\n\n"


def inspected(folder: Path, model: str, *options: str) -> tuple[str, dict[str, Any]]:
    shown, listed = (
        sim_action(folder, "inspect", model, "--allow-outside", *options, *more) for more in ((), ("--json",))
    )
    assert (shown.returncode, listed.returncode) == (0, 0), shown.stderr
    block, document = shown.stdout.split(BLOCK)[1], json.loads(listed.stdout)
    assert block.strip() == document["robot"].strip()
    return block, document


def assert_passes(folder: Path, block: str, **rest: object) -> None:
    spec = {"name": "pasted", "allow": ["fixed-base"], "time_limit": "2 s", **rest}
    spec.setdefault("expect", [{"upright": {"max_tilt": "10 deg"}}])
    (folder / "pasted.sim.yml").write_text(block + yaml.safe_dump(spec))
    ran = sim_action(folder, "run", "--allow-outside", "pasted.sim.yml")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert [outcome["status"] for outcome in outcomes(folder)] == ["passed"]


@pytest.mark.pybullet
@pytest.mark.parametrize("known", [known for known in ROBOTS if known.name in PASTED], ids=lambda known: known.name)
def test_the_block_of_a_robot_runs_as_it_was_pasted(known: KnownRobot, tmp_path: Path) -> None:
    packages = [f"--package={name}={folder}" for name, folder in known.robot.packages.items()]
    block, document = inspected(tmp_path, known.path, *packages)
    assert tuple(document["needs"]) == known.robot.allow
    if known.robot.base == "fixed":
        # An arm that stands on the ground may fall over, so the block offers to bolt it.
        assert "  base: fixed" in block or "  # base: fixed  # if" in block
        block = block.replace("# base", "base")
    # The y axis of laikago's base points up, so it falls on its side from the pose of the block.
    rest = {"expect": [{"upright": {"max_tilt": "100 deg"}}]} if known.robot.pose.roll else {}
    assert_passes(tmp_path, block, **rest)


@pytest.mark.pybullet
@pytest.mark.parametrize(("name", "kind"), [("husky", "skid"), ("racecar", "ackermann")])
def test_the_drive_that_is_recognised_drives(name: str, kind: str, tmp_path: Path) -> None:
    (known,) = (known for known in ROBOTS if known.name == name)
    block, _ = inspected(tmp_path, known.path)
    assert f"\n  drive: {{{kind}: {{" in block
    goal = {"expect": [{"travel": {"at_least": "0.5 m"}}], "commands": {"twist": [{"linear": 0.5}]}, "time_limit": 5}
    assert_passes(tmp_path, block, **goal)


def test_the_block_of_a_xacro_with_packages_and_arguments_runs(tmp_path: Path) -> None:
    made = ros_workspace(tmp_path)
    model = str(made.rover.relative_to(made.root))
    block, document = inspected(made.root, model, "--arg", "with_lidar=false", "--arg", "mass=3")
    assert document["mass"] == 3
    assert 'args: {with_lidar: "false", mass: "3"}' in block
    goal = {"expect": [{"travel": {"at_least": "0.2 m"}}], "commands": {"twist": [{"linear": 0.5}]}}
    assert_passes(made.root, block, **goal)


def test_xacro_sees_only_the_variables_that_are_passed(tmp_path: Path) -> None:
    body = '<robot name="r"><link name="a-$(optenv MAP_URL none)"/><link name="b-$({})"/>{}</robot>'
    joint = '<joint name="j" type="fixed"><parent link="a-$(optenv MAP_URL none)"/><child link="b-$({})"/></joint>'
    for name, word in (("good", "optenv TZ none"), ("bad", "env MAP_URL")):
        (tmp_path / f"{name}.xacro").write_text(body.format(word, joint.format(word)))

    def inspected(*words: str) -> str:
        done = sim_action(tmp_path, "inspect", *words, MAP_URL="http://planted", TZ="UTC")
        return done.stdout + done.stderr

    assert "a-none" in (printed := inspected("good.xacro"))
    assert "b-UTC" in printed
    for more in ((), ("--json",)):
        assert "a-***" in (printed := inspected("good.xacro", "--pass-env", "MAP_URL", *more))
        assert "planted" not in printed
    assert "the variable MAP_URL exists, but code of the repository does not see it" in inspected("bad.xacro")

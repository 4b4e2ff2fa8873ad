"""What `sim-action inspect` says of real robots: it is what the engine has, and its block runs as it stands."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import pytest
import yaml

from sim_action.core.workspace import Workspace
from sim_action.drives import recognise
from sim_action.robot.model.kinematics import link_poses, robot_box
from sim_action.robot.reading.loading import load_model
from sim_action.world import Physics, World
from sim_action.world.scene import Scene
from tests.integration.conftest import outcomes, sim_action
from tests.ros_workspace import ros_workspace
from tools.bench.robots import ROBOTS, WORKSPACE, KnownRobot

FAR: Final = 50.0
TIGHT: Final = 2e-4  # m: what margins of the engine and its floats come to
ROUNDED: Final = 0.001  # m, where a mesh that is turned reaches furthest: the engine's margin rounds its edges
TURNED: Final = frozenset({"laikago", "franka_panda"})
every_robot = pytest.mark.parametrize(
    "known", [pytest.param(known, marks=pytest.mark.pybullet, id=known.name) for known in ROBOTS]
)
BLOCK: Final = "block for a scenario in this folder:\n\n"


def engines_box(scene: Scene) -> list[float]:
    """How far the engine's robot reaches from its base frame along -x, +x, -y, ..."""
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=client)
        body = loaded(scene, client)
        return [reach(body, axis, sign, client) for axis in range(3) for sign in (-1, 1)]
    finally:
        pybullet.disconnect(client)


def loaded(scene: Scene, client: int) -> int:
    import pybullet

    path = scene.workspace.directory / "engine.urdf"
    path.write_text(scene.model.urdf)
    for name, text in scene.model.hull_files.items():
        path.with_name(name).write_bytes(text)
    flags = pybullet.URDF_USE_IMPLICIT_CYLINDER | pybullet.URDF_USE_INERTIA_FROM_FILE
    body = int(pybullet.loadURDF(str(path), flags=flags, physicsClientId=client))
    com = pybullet.getDynamicsInfo(body, -1, client)[3:5]
    pybullet.resetBasePositionAndOrientation(body, *com, client)
    infos = [pybullet.getJointInfo(body, joint, client) for joint in range(pybullet.getNumJoints(body, client))]
    for index, name in ((info[0], info[1].decode()) for info in infos):
        pybullet.resetJointState(body, index, scene.joint_positions.get(name, 0.0), physicsClientId=client)
    return body


def reach(body: int, axis: int, sign: int, client: int) -> float:
    import pybullet

    normal, at = ([value * (place == axis) for place in range(3)] for value in (-sign, sign * FAR))
    shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=normal, physicsClientId=client)
    wall = pybullet.createMultiBody(0, shape, basePosition=at, physicsClientId=client)
    nearest = min(point[8] for point in pybullet.getClosestPoints(body, wall, 2 * FAR, physicsClientId=client))
    pybullet.removeBody(wall, client)
    return float(sign * (FAR - nearest))


@every_robot
@pytest.mark.parametrize("askew", [0.0, 0.3])
def test_the_box_is_the_engines(known: KnownRobot, askew: float, tmp_path: Path) -> None:
    workspace = Workspace(tmp_path, tmp_path, allow_outside=True)
    spec = known.robot
    robots = load_model(spec, workspace)
    joints = {joint.name: joint.home + askew * (joint.type != "prismatic") for joint in robots.moving_joints}
    spec = spec.model_copy(update={"joints": joints})
    scene = Scene(spec, robots, World(), Physics(), workspace)
    box = robot_box(robots, link_poses(robots, scene.joint_positions))
    assert box is not None
    ours = [corner[axis] * (1 if upper else -1) for axis in range(3) for upper, corner in enumerate(box)]
    engines = [at * (1 if place % 2 else -1) for place, at in enumerate(engines_box(scene))]
    apart = ROUNDED if askew or known.name in TURNED else TIGHT
    for mine, its in zip(ours, engines, strict=True):
        assert mine == pytest.approx(its, abs=apart)


def inspected(folder: Path, model: str, *options: str) -> tuple[str, dict[str, Any]]:
    text = sim_action(folder, "inspect", model, "--allow-outside", *options)
    found = sim_action(folder, "inspect", model, "--allow-outside", "--json", *options)
    assert (text.returncode, found.returncode) == (0, 0), text.stderr
    block = text.stdout.split(BLOCK)[1]
    document = json.loads(found.stdout)
    assert block.strip() == document["robot"].strip()
    return block, document


def run(folder: Path, block: str, **rest: object) -> dict[str, Any]:
    spec = {
        "name": "pasted",
        "allow": ["fixed-base"],
        "time_limit": "2 s",
        "expect": [{"upright": {"max_tilt": "10 deg"}}],
        **rest,
    }
    (folder / "pasted.sim.yml").write_text(block + yaml.safe_dump(spec))
    ran = sim_action(folder, "run", "--allow-outside", "pasted.sim.yml")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    (outcome,) = outcomes(folder)
    return dict(outcome)


@every_robot
def test_the_block_of_a_robot_runs_as_it_was_pasted(known: KnownRobot, tmp_path: Path) -> None:
    packages = [f"--package={name}={folder}" for name, folder in known.robot.packages.items()]
    block, found = inspected(tmp_path, known.path, *packages)
    assert tuple(found["needs"]) == known.robot.allow
    if known.robot.base == "fixed":
        # An arm that stands on the ground may fall over, so the block offers to bolt it.
        assert "  base: fixed" in block or "  # base: fixed  # if" in block
        block = block.replace("# base", "base")
    # The y axis of laikago's base points up, so it falls on its side from the pose of the block.
    rest = {"expect": [{"upright": {"max_tilt": "100 deg"}}]} if known.robot.pose.roll else {}
    assert run(tmp_path, block, **rest)["status"] == "passed"


@pytest.mark.pybullet
@pytest.mark.parametrize(("name", "kind"), [("husky", "skid"), ("racecar", "ackermann")])
def test_the_drive_that_is_recognised_drives(name: str, kind: str, tmp_path: Path) -> None:
    (known,) = (known for known in ROBOTS if known.name == name)
    block, _ = inspected(tmp_path, known.path)
    assert f"\n  drive: {{{kind}: {{" in block
    goal = {"expect": [{"travel": {"at_least": "0.5 m"}}], "commands": {"twist": [{"linear": 0.5}]}, "time_limit": 5}
    assert run(tmp_path, block, **goal)["status"] == "passed"


@every_robot
def test_only_what_drives_has_a_drive(known: KnownRobot) -> None:
    drive = recognise(load_model(known.robot, WORKSPACE))
    drives = {"husky": "skid", "r2d2": "skid", "racecar": "ackermann"}
    assert (drive.key if drive else None) == drives.get(known.name)


def test_the_block_of_a_xacro_with_packages_and_arguments_runs(tmp_path: Path) -> None:
    made = ros_workspace(tmp_path)
    model = str(made.rover.relative_to(made.root))
    block, found = inspected(made.root, model, "--arg", "with_lidar=false", "--arg", "mass=3")
    assert found["mass"] == 3
    assert 'args: {with_lidar: "false", mass: "3"}' in block
    goal = {"expect": [{"travel": {"at_least": "0.2 m"}}], "commands": {"twist": [{"linear": 0.5}]}}
    assert run(made.root, block, **goal)["status"] == "passed"


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

"""Models, read by this project and by an independent reader: masses, inertias, axes, limits and mimics are equal."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from sim_action.core.errors import ModelError
from sim_action.core.workspace import Workspace
from sim_action.robot.model.findings import ALLOWABLE
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from tests.robot.independent_readers import (
    Body,
    Joined,
    Matrix,
    Read,
    bounds,
    compiled,
    frame,
    numbers,
    placed,
    plain_sdf,
    tensor,
    turn_of_quaternion,
    turn_of_rpy,
    urchins,
)
from tests.ros_workspace import written
from tests.soak import soaked

PYBULLET_DATA: Final = Path(pytest.importorskip("pybullet_data").getDataPath()).resolve()
REPOSITORY: Final = Path(__file__).parents[3]
COPIED: Final = 1e-12  # relative, of numbers as they stand in a file
# Of lengths in m, of directions, and relative to the largest moment of inertia: products of about ten rotations.
COMPUTED: Final = 1e-9
MIN_COMPARED: Final = 95  # of the 121 URDFs and MJCFs of pybullet_data

SCENES: Final[Mapping[str, frozenset[str]]] = MappingProxyType(
    {
        "mjcf/pusher.xml": frozenset({"target", "object"}),
        "mjcf/reacher.xml": frozenset({"target"}),
        "mjcf/striker.xml": frozenset({"object", "target", "body_13", "coaster", "body_15", "body_16"}),
        "mjcf/thrower.xml": frozenset({"object", "target"}),
    }
)
"""Scenes -> the bodies that are not parts of the robot."""

SCALED: Final = frozenset(
    {
        "cube_small.urdf",
        "gripper/wsg50_one_motor_gripper_left_finger.urdf",
        "gripper/wsg50_one_motor_gripper_right_finger.urdf",
    }
)
"""Models whose <inertia_scaling>, an extension of Bullet's, multiplies their inertia."""

ONLY_HERE: Final[Mapping[str, str]] = MappingProxyType(
    {
        "husky/husky.urdf": "it has a xacro expression, which counts as left out; urchin cannot read it",
        "spherical_joint_limit.urdf": "it has a joint of an unknown type for urchin",
    }
)
"""Models that the independent reader cannot read -> the reason."""


# --- this project ---


def poses(model: RobotModel) -> dict[str, Matrix]:
    """Return the pose of each link in the base frame, all joints at 0."""
    return {
        name: frame(np.array(pose.position_xyz), turn_of_quaternion(*pose.orientation_xyzw))
        for name, pose in link_poses(model, {}).items()
    }


def inertial(element: ET.Element, link: Matrix) -> Body:
    """Return the body of a URDF <inertial>; `link`: the pose of the link in the base frame."""
    mass, inertia, origin = element.find("mass"), element.find("inertia"), element.find("origin")
    assert mass is not None
    assert inertia is not None
    stated = {} if origin is None else origin.attrib
    own = frame(numbers(stated.get("xyz", "0 0 0")), turn_of_rpy(*numbers(stated.get("rpy", "0 0 0"))))
    moments = tensor({name: float(value) for name, value in inertia.attrib.items()})
    return placed(float(mass.attrib["value"]), link @ own, moments)


def joints_of(model: RobotModel) -> dict[str, Joined]:
    at = poses(model)
    return {
        joint.name: Joined(
            (joint.parent, joint.child),
            at[joint.child][:3, :3] @ joint.axis_xyz if joint.moves else None,
            bounds(joint.lower, joint.upper),
            (joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset) if joint.mimic else None,
        )
        for joint in model.joints
    }


def ours(model: RobotModel) -> Read:
    """Return this project's reading of a model that becomes URDF; links whose file states no mass are left out."""
    at = poses(model)
    stated = {link.name for link in model.links if link.mass}
    bodies = {
        name: inertial(found, at[name])
        for link in ET.fromstring(model.urdf).findall("link")
        if (name := link.attrib["name"]) in stated and (found := link.find("inertial")) is not None
    }
    return Read(bodies, joints_of(model))


@functools.cache
def loaded(path: Path) -> RobotModel | str:
    """Return a model, or the reason why it is refused."""
    try:
        return load_model(Robot(model=path.name, allow=ALLOWABLE), Workspace(path.parent, path.parent))
    except ModelError as error:
        return str(error)


def models_of_worlds() -> Iterator[tuple[str, str, ET.Element]]:
    """Yield the file, the version and the <model> of each robot: a model with a joint."""
    for path in sorted(PYBULLET_DATA.rglob("*.sdf")):
        root = ET.parse(path).getroot()
        for model in root.iter("model"):
            if model.find("joint") is not None:
                for link in model.findall("link"):
                    for part in [part for part in link if part.tag not in {"pose", "inertial"}]:
                        link.remove(part)
                name = path.relative_to(PYBULLET_DATA).as_posix()
                yield name, root.attrib["version"], model


# --- comparison ---


def same(mine: Matrix, yours: Matrix) -> bool:
    return bool(np.abs(mine - yours).max() <= COMPUTED * max(1.0, np.abs(yours).max()))


def differences(mine: Read, yours: Read) -> list[str]:
    """Return all differences but those of inertias."""
    found = [f"{name}: only one reader has this link" for name in mine.bodies.keys() ^ yours.bodies.keys()]
    found += [f"{name}: only one reader has this joint" for name in mine.joints.keys() ^ yours.joints.keys()]
    for name in mine.bodies.keys() & yours.bodies.keys():
        one, other = mine.bodies[name], yours.bodies[name]
        if one.mass != pytest.approx(other.mass, rel=COPIED):
            found.append(f"{name}: mass {one.mass} and {other.mass} kg")
        if not same(one.centre, other.centre):
            found.append(f"{name}: centre of mass {one.centre} and {other.centre}")
    for name in mine.joints.keys() & yours.joints.keys():
        found += [f"{name}: {what}" for what in joint_differences(mine.joints[name], yours.joints[name])]
    return found


def joint_differences(one: Joined, other: Joined) -> Iterator[str]:
    for what, mine, yours in (
        ("ends", one.ends, other.ends),
        ("limits", one.limits, pytest.approx(other.limits, rel=COPIED)),
        ("mimic", one.mimic, other.mimic),
        ("is fixed", one.axis is None, other.axis is None),
    ):
        if mine != yours:
            yield f"{what}: {mine} and {yours}"
    if one.axis is not None and other.axis is not None and not same(one.axis, other.axis):
        yield f"axis: {one.axis} and {other.axis}"


def is_possible(body: Body) -> bool:
    """Return True if an inertia is one of a real body: this project repairs the others (docs/models/audit.md)."""
    least, middle, most = np.linalg.eigvalsh(body.inertia)
    # The sign of the least moment of a singular tensor is rounding, which differs between processors.
    return bool(least > COMPUTED * most and most <= least + middle)


def inertia_differences(mine: Read, yours: Read) -> list[str]:
    real = {name for name, body in yours.bodies.items() if is_possible(body)}
    found = [
        f"{name}: inertia {mine.bodies[name].inertia} and {yours.bodies[name].inertia}"
        for name in mine.bodies.keys() & real
        if np.abs(mine.bodies[name].inertia - yours.bodies[name].inertia).max()
        > COMPUTED * np.abs(yours.bodies[name].inertia).max()
    ]
    if real == yours.bodies.keys() and not same(mine.inertia, yours.inertia):
        found.append(f"total: inertia about the base {mine.inertia} and {yours.inertia}")
    return found


def assert_equal(mine: Read, yours: Read, name: str = "") -> None:
    assert not differences(mine, yours)
    assert mine.mass == pytest.approx(yours.mass, rel=COPIED)
    if name not in SCALED:
        assert not inertia_differences(mine, yours)


# --- tests ---

URDFS: Final = [path for path in sorted(PYBULLET_DATA.rglob("*.urdf")) if "random_urdfs" not in path.parts]
OURS: Final = [path for folder in ("sim_action", "examples") for path in (REPOSITORY / folder).rglob("*.urdf")]
MJCFS: Final = sorted(PYBULLET_DATA.rglob("*.xml"))


def file_name(path: Path) -> str:
    return path.relative_to(PYBULLET_DATA if path.is_relative_to(PYBULLET_DATA) else REPOSITORY).as_posix()


@pytest.mark.parametrize("path", soaked([*URDFS, *sorted(OURS)], [*URDFS[::3], *OURS]), ids=file_name)
def test_a_urdf_is_as_urchin_reads_it(path: Path) -> None:
    model = loaded(path)
    pytest.importorskip("urchin")
    if isinstance(model, str):
        assert path not in OURS, model
    elif file_name(path) not in ONLY_HERE:
        assert_equal(ours(model), urchins(path), file_name(path))


@pytest.mark.parametrize(("file", "version", "model"), list(models_of_worlds()))
def test_a_model_of_a_world_is_as_its_specification_reads_it(
    file: str, version: str, model: ET.Element, tmp_path: Path
) -> None:
    root = ET.Element("sdf", version=version)
    root.append(model)
    written(tmp_path / "model.sdf", ET.tostring(root, encoding="unicode"))
    read = loaded(tmp_path / "model.sdf")
    assert isinstance(read, RobotModel), read
    assert_equal(ours(read), plain_sdf(model))


@pytest.mark.parametrize("path", MJCFS, ids=file_name)
def test_an_mjcf_is_as_mujoco_compiles_it(path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    model = loaded(path)
    if isinstance(model, str):
        return
    from sim_action.robot.reading.mjcf.mujoco_spec import engine_spec

    assert model.mjcf is not None
    mine = compiled(engine_spec(model.mjcf).compile())
    theirs = compiled(mujoco.MjModel.from_xml_path(str(path)), SCENES.get(file_name(path), frozenset()))
    assert_equal(mine, theirs)
    assert model.mass == pytest.approx(theirs.mass, rel=COPIED)
    moving = [joint for joint in joints_of(model).values() if joint.axis is not None]
    for one, yours in zip(moving, theirs.joints.values(), strict=True):
        assert not list(joint_differences(replace(one, ends=("", "")), yours))


@pytest.mark.soak
def test_most_models_are_compared() -> None:
    """A model that is refused with a reason is not compared above."""
    refused = [file_name(path) for path in (*URDFS, *MJCFS) if isinstance(loaded(path), str)]
    assert len(URDFS) + len(MJCFS) - len(refused) >= MIN_COMPARED

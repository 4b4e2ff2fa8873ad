"""Runs in a child, as the engine may die of what it is given: what sim-action and the engine make of URDFs.

Its arguments are files. Of each it prints a line of JSON when it begins and one when it has come to the end; what it
finds wrong is a list of texts, empty for a model that was refused with a place, or that both understand alike.
"""

from __future__ import annotations

import json
import math
import os
import signal
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch
from xml.etree import ElementTree as ET

import numpy as np
import pybullet

from sim_action.core import geometry
from sim_action.core.errors import EngineError, ModelError
from sim_action.core.geometry import Pose
from sim_action.core.workspace import Workspace
from sim_action.engines.pybullet.engine import PyBulletEngine
from sim_action.robot.model.findings import ALLOWABLE
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import STOP_PLAY, Joint, Link, RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.simulation.guards import Watchdog
from sim_action.state.trace_records import Channels
from sim_action.world import Physics, World
from sim_action.world.scene import Scene

LONGEST: Final = 20  # in s, for one model; a signal ends the child then
_POSITION: Final = 0.3
_STEPS: Final = 30
_NEAR: Final = 1e-4
_SHAPES: Final = {
    pybullet.GEOM_SPHERE: "sphere",
    pybullet.GEOM_BOX: "box",
    pybullet.GEOM_CYLINDER: "cylinder",
    pybullet.GEOM_CAPSULE: "capsule",
    pybullet.GEOM_MESH: "mesh",
}


def trial(path: Path) -> tuple[str, list[str]]:
    """What became of a model, and what is wrong with that."""
    try:
        model = read_urdf(path)
    except ModelError as error:
        refused = list(_bad_refusal(error))
        try:
            model = read_urdf(path, allow=ALLOWABLE)
        except ModelError as fatal:
            return "refused", [*refused, *_bad_refusal(fatal)]
        return "let go", [*refused, *_in_engine(model, path)]
    return "taken", list(_in_engine(model, path))


def _bad_refusal(error: ModelError) -> Iterator[str]:
    if error.location is None or error.location.line is None:
        yield f"a refusal without a line: {error}"
    if not all(line.isprintable() for line in str(error).splitlines()):
        yield f"a refusal that is not printable: {error!r}"
    if len(str(error).splitlines()) > 200 or len(str(error)) > 100_000:
        yield f"a refusal of {len(str(error))} characters: {str(error)[:500]}"


def _in_engine(model: RobotModel, path: Path) -> Iterator[str]:
    """What the engine understands otherwise."""
    folder = path.parent
    robot = Robot(model=str(path), base="fixed" if len(model.name) % 2 else None)
    scene = Scene(robot, model, World(), Physics(), Workspace(folder, folder))
    try:
        # What is a thousand kilometres long leaves no digits for what is not.
        if not any(finding.rule == "absurd-size" for finding in model.findings):
            # Against damping, links get moments of inertia that the model does not state.
            with patch("sim_action.engines.pybullet.passive_joints.calm", return_value=()):
                read = PyBulletEngine(scene)
            with closing(read):
                yield from _differences(model, read._client, read._robot, fixed=scene.bolted)
        with closing(PyBulletEngine(scene, Channels(contacts=True))) as backend:
            yield from _run(scene, backend)
    except EngineError as error:
        yield f"the engine refuses it: {error}"


def _run(scene: Scene, backend: PyBulletEngine) -> Iterator[str]:
    watchdog = Watchdog.of(scene, backend.observe(0, contacts=True))
    backend.advance(0, [None] * _STEPS)
    trace, unstable = watchdog.watch(backend.collect())
    if not np.isfinite(trace.state).all():
        yield "a state that is no number"
    if unstable is not None and "not a number" in str(unstable):
        yield f"it comes apart: {unstable}"
    backend.observe(_STEPS, contacts=True)


def _differences(model: RobotModel, client: int, robot: int, *, fixed: bool) -> Iterator[str]:
    if model.balls:
        # A ball joint is one joint of the engine, and three of ours: tests/physics compares their motion.
        return
    count = pybullet.getNumJoints(robot, client)
    infos = {}
    for index in range(count):
        info = pybullet.getJointInfo(robot, index, client)
        infos[info[1].decode(errors="replace")] = info
    if infos.keys() != model.joints_by_name.keys() or count != len(model.joints):
        yield f"joints: the engine has {sorted(infos)[:9]}, we have {sorted(model.joints_by_name)[:9]}"
        return
    for name, info in infos.items():
        yield from _joint_differences(model.joints_by_name[name], info)
    yield from _mass_differences(model, client, robot, infos, fixed=fixed)
    yield from _shape_differences(model, client, robot, infos)
    for position in (0.0, _POSITION):
        yield from _pose_differences(model, client, robot, infos, position)


def _joint_differences(joint: Joint, info: Sequence[Any]) -> Iterator[str]:
    kinds = {"revolute": 0, "continuous": 0, "prismatic": 1}
    if info[2] != kinds.get(joint.type, 4):
        yield f"joint {joint.name}: a {joint.type} joint is of type {info[2]} to the engine"
    if info[12].decode(errors="replace") != joint.child:
        yield f"joint {joint.name}: its child is {info[12]!r} to the engine"
    if joint.type in ("revolute", "prismatic"):
        lower, upper = joint.lower, joint.upper
        wanted = (-1e16 if lower is None else lower - STOP_PLAY, 1e16 if upper is None else upper + STOP_PLAY)
        if (joint.lower, joint.upper) == (None, None):
            if info[8] <= info[9]:
                yield f"joint {joint.name}: has no limits, the engine has {info[8:10]}"
        elif not _near(info[8:10], wanted):
            yield f"joint {joint.name}: limits {info[8:10]}, we have {wanted}"
    if joint.type == "continuous" and info[8] <= info[9]:
        yield f"joint {joint.name}: turns for ever, the engine has limits {info[8:10]}"
    wanted = (joint.max_effort or 0.0, joint.max_velocity or 0.0)
    if joint.moves and not _near(info[10:12], wanted):
        yield f"joint {joint.name}: effort and velocity {info[10:12]}, we have {wanted}"


def _mass_differences(
    model: RobotModel, client: int, robot: int, infos: dict[str, Any], *, fixed: bool
) -> Iterator[str]:
    inertials = {link.attrib["name"]: link.find("inertial") for link in ET.fromstring(model.urdf).iterfind("link")}
    index = {model.root: -1} | {model.joints_by_name[name].child: info[0] for name, info in infos.items()}
    for name, number in index.items():
        if number == -1 and fixed:
            continue
        link, dynamics = model.links_by_name[name], pybullet.getDynamicsInfo(robot, number, client)
        inertial = inertials[name]
        if inertial is None:
            yield f"link {name}: no inertial in what the engine gets"
            continue
        yield from _inertial_differences(link, inertial, dynamics)
        yield from _touch_differences(link, dynamics)


def _inertial_differences(link: Link, inertial: ET.Element, dynamics: Sequence[Any]) -> Iterator[str]:
    name, stated = link.name, link.mass
    mass = float(inertial.find("mass").attrib["value"])  # type: ignore[union-attr]  # the audit has seen to it
    if not _near([dynamics[0]], [mass]) or (stated and not _near([dynamics[0]], [stated])):
        yield f"link {name}: a mass of {dynamics[0]}, we have {stated}, the engine was given {mass}"
    moments = _principal(inertial.find("inertia"))
    if mass and not np.allclose(sorted(dynamics[2]), moments, rtol=1e-3, atol=1e-9 * max(map(abs, moments))):
        yield f"link {name}: moments of inertia {sorted(dynamics[2])}, we have {moments}"
    centre = _pose(inertial)
    if not _same(Pose(dynamics[3]), Pose(centre.position_xyz)):
        yield f"link {name}: a centre of mass at {dynamics[3]}, we have {centre.position_xyz}"


def _touch_differences(link: Link, dynamics: Sequence[Any]) -> Iterator[str]:
    surface = link.surface
    if link.collisions and not _near([dynamics[1]], [surface.friction]):
        yield f"link {link.name}: a friction of {dynamics[1]}, we have {surface.friction}"
    if link.collisions and surface.stiffness is not None and not _near([dynamics[9]], [surface.stiffness]):
        yield f"link {link.name}: a stiffness of {dynamics[9]}, we have {surface.stiffness}"


def _principal(inertia: ET.Element | None) -> list[float]:
    assert inertia is not None
    xx, xy, xz, yy, yz, zz = (float(inertia.attrib[name]) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    matrix = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    return sorted(float(moment) for moment in np.linalg.eigvalsh(matrix))


def _pose(element: ET.Element) -> Pose:
    origin = element.find("origin")
    texts = [(origin.get(name) if origin is not None else None) or "0 0 0" for name in ("xyz", "rpy")]
    (x, y, z), (roll, pitch, yaw) = (map(float, text.split()) for text in texts)
    return Pose((x, y, z), geometry.quaternion_from_rpy(roll, pitch, yaw))


def _shape_differences(model: RobotModel, client: int, robot: int, infos: dict[str, Any]) -> Iterator[str]:
    index = {model.root: -1} | {model.joints_by_name[name].child: info[0] for name, info in infos.items()}
    for name, number in index.items():
        link = model.links_by_name[name]
        shapes = pybullet.getCollisionShapeData(robot, number, client)
        inertial = Pose(*pybullet.getDynamicsInfo(robot, number, client)[3:5])
        yield from _link_shape_differences(link, shapes, inertial)


def _link_shape_differences(link: Link, shapes: Sequence[Any], inertial: Pose) -> Iterator[str]:
    if len(shapes) != len(link.collisions):
        yield f"link {link.name}: {len(shapes)} shapes, we have {len(link.collisions)}"
        return
    for found, wanted in zip(shapes, link.collisions, strict=True):
        if _SHAPES.get(found[2]) != wanted.kind:
            yield f"link {link.name}: a shape of type {found[2]}, we have a {wanted.kind}"
        elif wanted.kind != "mesh" and wanted.upper_xyz is not None and not _near(_half_sizes(found), wanted.upper_xyz):
            yield f"link {link.name}: a {wanted.kind} of {found[3]}, we have {wanted.upper_xyz}"
        if not _same(geometry.compose(inertial, Pose(found[5], found[6])), wanted.pose):
            yield f"link {link.name}: a {wanted.kind} at {found[5:7]} seen from {inertial}, we have {wanted.pose}"


def _half_sizes(found: Sequence[Any]) -> tuple[float, ...]:
    x, y, z = found[3]
    if found[2] == pybullet.GEOM_BOX:
        return (x / 2, y / 2, z / 2)
    if found[2] == pybullet.GEOM_SPHERE:
        return (x, x, x)
    return (y, y, x / 2 + (y if found[2] == pybullet.GEOM_CAPSULE else 0.0))


def _pose_differences(
    model: RobotModel, client: int, robot: int, infos: dict[str, Any], position: float
) -> Iterator[str]:
    """Of each link in the base frame, with all joints somewhere."""
    for name, info in infos.items():
        if model.joints_by_name[name].moves:
            pybullet.resetJointState(robot, info[0], position, physicsClientId=client)
    com = Pose(*pybullet.getBasePositionAndOrientation(robot, client))
    inertial = Pose(*pybullet.getDynamicsInfo(robot, -1, client)[3:5])
    base = geometry.compose(com, geometry.inverse(inertial))
    poses = link_poses(model, {joint.name: position for joint in model.moving_joints})
    for name, info in infos.items():
        child = model.joints_by_name[name].child
        state = pybullet.getLinkState(robot, info[0], computeForwardKinematics=1, physicsClientId=client)
        found = geometry.compose(geometry.inverse(base), Pose(state[4], state[5]))
        if not _same(found, poses[child]):
            yield f"link {child}, joints at {position}: {found}, we have {poses[child]}"
    for name, info in infos.items():
        if model.joints_by_name[name].moves:
            pybullet.resetJointState(robot, info[0], 0.0, physicsClientId=client)


def _same(found: Pose, wanted: Pose) -> bool:
    turn = abs(sum(a * b for a, b in zip(found.orientation_xyzw, wanted.orientation_xyzw, strict=True)))
    # The engine hands poses of links on in single precision.
    scale = max(1.0, *map(abs, wanted.position_xyz))
    return math.dist(found.position_xyz, wanted.position_xyz) <= _NEAR * scale and turn > 1 - 1e-6


def _near(found: Sequence[float], wanted: Sequence[float]) -> bool:
    return bool(np.allclose(found, wanted, rtol=_NEAR, atol=1e-12))


def main() -> None:
    told = os.fdopen(os.dup(1), "w", buffering=1)
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    for name in sys.argv[1:]:
        told.write(json.dumps(["begin", name]) + "\n")
        signal.alarm(LONGEST)
        try:
            fate, wrong = trial(Path(name))
        except Exception:  # noqa: BLE001 - what it is, is for the caller to read
            fate, wrong = "raised", [traceback.format_exc()]
        signal.alarm(0)
        told.write(json.dumps(["end", name, fate, wrong]) + "\n")
    told.flush()
    os._exit(0)


if __name__ == "__main__":
    main()

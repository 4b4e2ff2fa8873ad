"""Read URDFs with one library, and print what it understood as lines of JSON: `python peers.py READER FILE...`.

The libraries are in an environment of their own, without sim-action; some of them cannot be imported together. So each
reader runs in a process of its own, and this file imports nothing of the repository but for the reader "sim-action".

A line is `[file, reading]`. A reading is `{"error": text}`, or has

- `links`: name -> `mass` in kg, `centre` of mass in m and `inertia` in kg m^2 (xx, xy, xz, yy, yz, zz) about that
  centre, both along the axes of the link's frame; a link without a mass has none of the three;
- `joints`: name -> `type`, `lower`, `upper` (null: unlimited), `effort`, `velocity` (null: not stated or not kept);
- `frames`: link -> position in m and rotation matrix (12 numbers, the matrix by rows) in the frame of the root link,
  with the joints at the positions that the file `FILE.json` beside the model states, those that mimic others too.

A key that the library does not keep is missing.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

import numpy as np

Reading = dict[str, Any]
_FREE: Final = 1e9  # a limit beyond this is none


def _bound(value: float) -> float | None:
    return float(value) if abs(value) < _FREE else None


def _tensor(matrix: Any) -> list[float]:
    xx, xy, xz, yy, yz, zz = (float(matrix[i][j]) for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)))
    return [xx, xy, xz, yy, yz, zz]


def _rotation_xyzw(orientation_xyzw: Any) -> Any:
    x, y, z, w = np.asarray(orientation_xyzw, dtype=float) / np.linalg.norm(orientation_xyzw)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _frame(position: Any, rotation: Any, root_position: Any, root_rotation: Any) -> list[float]:
    root_rotation, rotation = np.asarray(root_rotation), np.asarray(rotation)
    moved = root_rotation.T @ (np.asarray(position) - np.asarray(root_position))
    return [float(value) for value in (*moved, *(root_rotation.T @ rotation).ravel())]


def _body(mass: float, centre: Any, matrix: Any) -> Reading:
    return {"mass": float(mass), "centre": [float(value) for value in centre], "inertia": _tensor(matrix)}


def _joints(robot: Element) -> list[Element]:
    # <transmission> has <joint> elements of another kind.
    return robot.findall("joint")


def _end(joint: Element, tag: str) -> str:
    end = joint.find(tag)
    assert end is not None
    return end.attrib["link"]


def _root(path: Path) -> str:
    robot = ET.parse(str(path)).getroot()
    children = {_end(joint, "child") for joint in _joints(robot)}
    (root,) = [link.attrib["name"] for link in robot.iterfind("link") if link.attrib["name"] not in children]
    return root


def sim_action(path: Path, positions: dict[str, float]) -> Reading:
    """Ours: limits, frames and masses of the model, as an engine gets them."""
    from sim_action.core import geometry
    from sim_action.robot.model.findings import ALLOWABLE
    from sim_action.robot.model.kinematics import link_poses
    from sim_action.robot.reading.urdf import read_urdf

    model = read_urdf(path, allow=ALLOWABLE)
    written = ET.parse(str(path)).getroot()
    links: dict[str, Reading] = {link.attrib["name"]: {} for link in written.iterfind("link")}
    for link in model.links:
        if link.inertial is not None and link.name in links:
            xx, xy, xz, yy, yz, zz = link.inertial.moments
            pose = link.inertial.pose
            turn = np.column_stack([geometry.rotate(pose.orientation_xyzw, axis) for axis in geometry.AXES])
            tensor = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
            links[link.name] = _body(link.inertial.mass, pose.position_xyz, tensor)
    joints: dict[str, Reading] = {
        joint.name: {
            "type": joint.type,
            "lower": _bound(joint.range[0]),
            "upper": _bound(joint.range[1]),
            "effort": joint.max_effort,
            "velocity": joint.max_velocity,
        }
        for joint in model.joints
    }
    # Joints with several motions are several joints to us.
    for joint in written.iterfind("joint"):
        if joint.get("type") in {"planar", "floating", "spherical", "ball"}:
            joints[joint.attrib["name"]] = {"type": joint.get("type")}
    joints = {joint.attrib["name"]: joints[joint.attrib["name"]] for joint in written.iterfind("joint")}
    poses = link_poses(model, {joint.name: positions.get(joint.name, 0.0) for joint in model.moving_joints})
    frames = {
        name: _frame(pose.position_xyz, _rotation_xyzw(pose.orientation_xyzw), (0, 0, 0), np.eye(3))
        for name, pose in poses.items()
        if name in links
    }
    return {
        "links": links,
        "joints": joints,
        "frames": frames,
        "parents": {_end(joint, "child"): (joint.get("name"), _end(joint, "parent")) for joint in _joints(written)},
        "rules": sorted({finding.rule for finding in model.findings}),
    }


def mujoco(path: Path, positions: dict[str, float]) -> Reading:
    """MuJoCo, told to keep links that are welded together apart."""
    import mujoco as mj

    tree = ET.parse(str(path))
    ET.SubElement(ET.SubElement(tree.getroot(), "mujoco"), "compiler", fusestatic="false", discardvisual="true")
    model = mj.MjModel.from_xml_string(ET.tostring(tree.getroot(), encoding="unicode"))
    data = mj.MjData(model)
    joints = {}
    for index in range(model.njnt):
        joint = model.joint(index)
        kind = {0: "floating", 1: "ball", 2: "prismatic", 3: "revolute"}[int(joint.type[0])]
        limited, efforts = bool(joint.limited[0]), bool(model.jnt_actfrclimited[index])
        joints[joint.name] = {
            "type": kind,
            "lower": _bound(joint.range[0]) if limited else None,
            "upper": _bound(joint.range[1]) if limited else None,
            "effort": float(model.jnt_actfrcrange[index][1]) if efforts else None,
        }
        if kind in {"revolute", "prismatic"}:
            data.qpos[int(joint.qposadr[0])] = positions.get(joint.name, 0.0)
    for name in [name.removesuffix("_TX") for name in joints if name.endswith("_TX")]:
        joints = {other: joint for other, joint in joints.items() if not other.startswith(f"{name}_")}
        joints[name] = {"type": "planar"}
    mj.mj_kinematics(model, data)
    links, frames = {}, {}
    root = model.body(_root(path)).id
    origin = data.xpos[root], data.xmat[root].reshape(3, 3)
    for index in range(model.nbody) if root == 0 else range(1, model.nbody):
        body = model.body(index)
        turn = _rotation_xyzw([*body.iquat[1:], body.iquat[0]])
        matrix = turn @ np.diag(body.inertia) @ turn.T
        links[body.name] = _body(body.mass[0], body.ipos, matrix) if body.mass[0] else {}
        frames[body.name] = _frame(data.xpos[index], data.xmat[index].reshape(3, 3), *origin)
    return {"links": links, "joints": joints, "frames": frames}


def pybullet(path: Path, positions: dict[str, float]) -> Reading:
    """PyBullet, told to take inertias from the file."""
    import pybullet as p

    client = p.connect(p.DIRECT)
    robot = p.loadURDF(str(path), flags=p.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client)
    infos = [p.getJointInfo(robot, index, client) for index in range(p.getNumJoints(robot, client))]
    kinds = {0: "revolute", 1: "prismatic", 2: "spherical", 3: "planar", 4: "fixed"}
    joints, links, frames = {}, {}, {}
    for info in infos:
        free = info[8] > info[9]
        joints[info[1].decode()] = {
            "type": kinds[info[2]],
            "lower": None if free else _bound(info[8]),
            "upper": None if free else _bound(info[9]),
            "effort": info[10],
            "velocity": info[11],
        }
        if info[2] in (0, 1):
            p.resetJointState(robot, info[0], positions.get(info[1].decode(), 0.0), physicsClientId=client)
    root = p.getBodyInfo(robot, client)[0].decode()
    bodies = [(-1, root)] + [(info[0], info[12].decode()) for info in infos]
    for number, name in bodies:
        dynamics = p.getDynamicsInfo(robot, number, client)
        turn = _rotation_xyzw(dynamics[4])
        matrix = turn @ np.diag(dynamics[2]) @ turn.T
        links[name] = _body(dynamics[0], dynamics[3], matrix) if dynamics[0] else {}
    position, orientation = p.getBasePositionAndOrientation(robot, client)
    local, turned = p.getDynamicsInfo(robot, -1, client)[3:5]
    base = p.multiplyTransforms(position, orientation, *p.invertTransform(local, turned))
    base_rotation = _rotation_xyzw(base[1])
    frames[root] = _frame(base[0], base_rotation, base[0], base_rotation)
    for info in infos:
        state = p.getLinkState(robot, info[0], computeForwardKinematics=1, physicsClientId=client)
        frames[info[12].decode()] = _frame(state[4], _rotation_xyzw(state[5]), base[0], base_rotation)
    p.disconnect(client)
    return {"links": links, "joints": joints, "frames": frames}


def drake(path: Path, positions: dict[str, float]) -> Reading:
    """Drake's MultibodyPlant; links without a joint to the world float."""
    import logging

    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    logging.getLogger("drake").setLevel(logging.ERROR)
    plant = MultibodyPlant(0.001)
    (instance,) = Parser(plant).AddModels(str(path))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    joints: dict[str, Reading] = {}
    values = plant.GetPositions(context)
    for index in plant.GetJointIndices(instance):
        joint = plant.get_joint(index)
        is_moving = joint.num_positions() == 1
        joints[joint.name()] = {"type": joint.type_name()}
        if is_moving:
            joints[joint.name()] |= {
                "lower": _bound(joint.position_lower_limits()[0]),
                "upper": _bound(joint.position_upper_limits()[0]),
                "velocity": _bound(joint.velocity_upper_limits()[0]),
            }
            values[joint.position_start()] = positions.get(joint.name(), 0.0)
    plant.SetPositions(context, values)
    links, bodies = {}, {}
    for index in plant.GetBodyIndices(instance):
        body = plant.get_body(index)
        inertia = body.CalcSpatialInertiaInBodyFrame(context)
        mass = inertia.get_mass()
        centre = inertia.get_com()
        bodies[body.name()] = plant.EvalBodyPoseInWorld(context, body)
        about = inertia.Shift(centre).CalcRotationalInertia().CopyToFullMatrix3()
        links[body.name()] = _body(mass, centre, about) if mass else {}
    root_name = _root(path)
    root = bodies.get(root_name) or plant.EvalBodyPoseInWorld(context, plant.world_body())
    frames = {
        name: _frame(pose.translation(), pose.rotation().matrix(), root.translation(), root.rotation().matrix())
        for name, pose in bodies.items()
    }
    return {"links": links, "joints": joints, "frames": frames}


def pinocchio(path: Path, positions: dict[str, float]) -> Reading:
    """Pinocchio with a free base; `links` are then bodies: links that are welded together are one."""
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
    data, q = model.createData(), pin.neutral(model)
    joints: dict[str, Reading] = {}
    for index in range(2, model.njoints):
        joint, name = model.joints[index], model.names[index]
        at, speed = joint.idx_q, joint.idx_v
        value = positions.get(name, 0.0)
        if joint.nv != 1:
            joints[name] = {"type": "floating" if joint.nv == 6 else "planar"}
            continue
        unbounded = joint.nq == 2
        q[at : at + joint.nq] = [math.cos(value), math.sin(value)] if unbounded else [value]
        joints[name] = {
            "type": "continuous" if unbounded else joint.shortname(),
            "lower": None if unbounded else _bound(model.lowerPositionLimit[at]),
            "upper": None if unbounded else _bound(model.upperPositionLimit[at]),
            "effort": _bound(model.effortLimit[speed]),
            "velocity": _bound(model.velocityLimit[speed]),
        }
    pin.framesForwardKinematics(model, data, q)
    bodies = [frame for frame in model.frames if frame.type == pin.FrameType.BODY]
    placed = {frame.name: data.oMf[model.getFrameId(frame.name, pin.FrameType.BODY)] for frame in bodies}
    root = placed[bodies[0].name]
    frames = {name: _frame(at.translation, at.rotation, root.translation, root.rotation) for name, at in placed.items()}
    links: dict[str, Reading] = {}
    for frame in bodies:
        joint_id, inertia = frame.parentJoint, model.inertias[frame.parentJoint]
        if joint_id not in {model.frames[model.getFrameId(name, pin.FrameType.BODY)].parentJoint for name in links}:
            moved = frame.placement.inverse().act(inertia)
            links[frame.name] = _body(moved.mass, moved.lever, moved.inertia) if moved.mass else {}
    return {"bodies": links, "joints": joints, "frames": frames}


def urchin(path: Path, positions: dict[str, float]) -> Reading:
    """Read with urchin; it moves joints that mimic others by itself."""
    from urchin import URDF

    robot = URDF.load(str(path))
    joints, links = {}, {}
    for joint in robot.joints:
        limit = joint.limit
        joints[joint.name] = {"type": joint.joint_type}
        if limit is not None:
            known = {name: getattr(limit, name) for name in ("lower", "upper", "effort", "velocity")}
            joints[joint.name] |= {name: None if value is None else _bound(value) for name, value in known.items()}
    for link in robot.links:
        inertial = link.inertial
        turn = inertial.origin[:3, :3]
        matrix = turn @ inertial.inertia @ turn.T
        links[link.name] = _body(inertial.mass, inertial.origin[:3, 3], matrix) if inertial.mass else {}
    mimics = {joint.name for joint in robot.joints if joint.mimic is not None}
    moved = {joint.name for joint in robot.actuated_joints} - mimics
    placed = robot.link_fk({name: value for name, value in positions.items() if name in moved}, use_names=True)
    root = placed[robot.base_link.name]
    frames = {name: _frame(at[:3, 3], at[:3, :3], root[:3, 3], root[:3, :3]) for name, at in placed.items()}
    return {"links": links, "joints": joints, "frames": frames}


READERS: Final[dict[str, Callable[[Path, dict[str, float]], Reading]]] = {
    "sim-action": sim_action,
    "mujoco": mujoco,
    "pybullet": pybullet,
    "drake": drake,
    "pinocchio": pinocchio,
    "urchin": urchin,
}


def main() -> None:
    """Print a line for each file; what the libraries themselves print goes nowhere."""
    lines = os.fdopen(os.dup(1), "w", buffering=1)
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    read = READERS[sys.argv[1]]
    for name in sys.argv[2:]:
        path = Path(name)
        positions = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        try:
            reading = read(path, positions)
        except Exception as error:  # noqa: BLE001 - readers refuse with errors of many kinds
            reading = {"error": f"{type(error).__name__}: {error}"[:500]}
        lines.write(json.dumps([name, reading]) + "\n")
    lines.flush()
    os._exit(0)


if __name__ == "__main__":
    main()

"""What MuJoCo's compiler made of MJCF -> RobotModel."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim_action.core.geometry import Pose
from sim_action.robot.robot_model import WORLD, Joint, JointType, Link, Mimic, RobotModel, Shape, Surface, Visual

_SHAPES: Final = ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")
"""By mujoco.mjtGeom."""

_ENDLESS: Final = ("plane", "hfield", "sdf")
_LAST_SEEN: Final = 2
# What the engine has for a geom that states none.
_NO_COLOUR: Final = (0.5, 0.5, 0.5, 1.0)


def model_of_text(text: str, path: Path, limits: Mapping[str, float]) -> RobotModel:
    """The model of a text that compiles; `limits`: the most that a joint's actuators exert, in N m or N."""
    spec = mujoco.MjSpec.from_string(text)
    model = spec.compile()
    links = tuple(_link(model, body) for body in range(1, model.nbody))
    joints = tuple(joint for body in range(1, model.nbody) for joint in _joints(model, body, limits))
    if any(joint.parent == WORLD for joint in joints):
        links = (Link(WORLD, None), *links)
    return RobotModel(spec.modelname, str(path), links, joints, urdf="", mjcf=text)


def _link(model: Any, body: int) -> Link:
    first, count = model.body_geomadr[body], model.body_geomnum[body]
    # What is only looked at touches nothing.
    geoms = [geom for geom in range(first, first + count) if model.geom_contype[geom] or model.geom_conaffinity[geom]]
    friction = float(model.geom_friction[geoms[0], 0]) if geoms else 0.5
    shapes = tuple(_shape(model, geom) for geom in geoms)
    x, y, z = map(float, model.body_ipos[body])
    # As the engine's own viewer has it: what is in another group is not seen.
    seen = [geom for geom in range(first, first + count) if model.geom_group[geom] <= _LAST_SEEN]
    visuals = tuple(visual for visual in (_visual(model, geom) for geom in seen) if visual.kind not in _ENDLESS)
    return Link(model.body(body).name, float(model.body_mass[body]), shapes, Surface(friction), (x, y, z), visuals)


def _visual(model: Any, geom: int) -> Visual:
    kind = _SHAPES[model.geom_type[geom]]
    mesh = model.mesh(int(model.geom_dataid[geom])).name if kind == "mesh" else ""
    stated = tuple(map(float, model.geom_rgba[geom]))
    red, green, blue = stated[:3]
    *_, along_x, along_y, along_z = map(float, model.geom_aabb[geom])
    return Visual(
        kind,
        _pose(model.geom_pos[geom], model.geom_quat[geom]),
        None if stated == _NO_COLOUR else (red, green, blue),
        (2 * along_x, 2 * along_y, 2 * along_z),
        mesh,
    )


def surfaces_of_text(text: str) -> dict[str, tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Name of a mesh -> its points (P, 3) in m, where the engine has them, and its triangles (T, 3)."""
    model = mujoco.MjSpec.from_string(text).compile()
    found = {}
    for mesh in range(model.nmesh):
        point, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        points = model.mesh_vert[point : point + model.mesh_vertnum[mesh]].astype(np.float64)
        faces = model.mesh_face[face : face + model.mesh_facenum[mesh]].astype(np.int64)
        found[model.mesh(mesh).name] = points, faces
    return found


def _shape(model: Any, geom: int) -> Shape:
    kind = _SHAPES[model.geom_type[geom]]
    radius = float(model.geom_size[geom, 0]) if kind in {"sphere", "cylinder", "capsule"} else None
    x, y, z, along_x, along_y, along_z = map(float, model.geom_aabb[geom])
    lower, upper = (x - along_x, y - along_y, z - along_z), (x + along_x, y + along_y, z + along_z)
    return Shape(kind, _pose(model.geom_pos[geom], model.geom_quat[geom]), radius, lower, upper)


def _joints(model: Any, body: int, limits: Mapping[str, float]) -> Iterator[Joint]:
    """All that a body hangs on: one joint, several one after the other, or none: it is welded to its parent then."""
    kinds = mujoco.mjtJoint
    first, count = model.body_jntadr[body], model.body_jntnum[body]
    numbers = [number for number in range(first, first + count) if model.jnt_type[number] != kinds.mjJNT_BALL]
    if numbers and model.jnt_type[numbers[0]] == kinds.mjJNT_FREE:
        return
    name, parent = model.body(body).name, model.body(int(model.body_parentid[body])).name
    hangs = {"parent": parent, "child": name, "origin": _pose(model.body_pos[body], model.body_quat[body])}
    if not numbers:
        yield Joint(name=f"{name}_joint", type="fixed", axis_xyz=(0.0, 0.0, 1.0), **hangs)
    mimics = _mimics(model)
    for number in numbers:
        joint = model.joint(number).name
        limited = bool(model.jnt_limited[number])
        turns = model.jnt_type[number] == kinds.mjJNT_HINGE
        kind: JointType = ("revolute" if limited else "continuous") if turns else "prismatic"
        x, y, z = map(float, model.jnt_axis[number])
        ax, ay, az = map(float, model.jnt_pos[number])
        lower, upper = map(float, model.jnt_range[number]) if limited else (None, None)
        yield Joint(
            name=joint,
            type=kind,
            axis_xyz=(x, y, z),
            lower=lower,
            upper=upper,
            max_effort=limits.get(joint),
            mimic=mimics.get(joint),
            anchor_xyz=(ax, ay, az),
            **hangs,
        )


def _mimics(model: Any) -> dict[str, Mimic]:
    """Joints that an equality ties to another; what bends the tie is left to the engine."""
    tied = {}
    for number in range(model.neq):
        one, other = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
        if model.eq_type[number] == mujoco.mjtEq.mjEQ_JOINT and model.eq_active0[number] and other >= 0:
            offset, multiplier = map(float, model.eq_data[number, :2])
            tied[model.joint(one).name] = Mimic(model.joint(other).name, multiplier, offset)
    return tied


def _pose(position: Any, wxyz: Any) -> Pose:
    x, y, z = map(float, position)
    qw, qx, qy, qz = map(float, wxyz)
    return Pose((x, y, z), (qx, qy, qz, qw))

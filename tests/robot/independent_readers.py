"""Readers of models that share no code with this project: they read masses, inertias, axes, limits and mimics.

They are urchin for URDF, MuJoCo's compiler for MJCF, and a few lines of matrices for SDF. urchin was chosen over
yourdfpy because it brings half as many packages and takes half the time to import.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
MOMENTS: Final = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
UNLIMITED: Final = 1e16  # the default of a limit in SDF 1.5 and 1.6


@dataclass(frozen=True)
class Body:
    """A link with a mass."""

    mass: float
    centre: Matrix  # its centre of mass, in the base frame
    inertia: Matrix  # about that centre, along the axes of the base frame

    @property
    def about_base(self) -> Matrix:
        """The inertia about the origin of the base frame."""
        moved: Matrix = self.inertia + self.mass * (
            self.centre @ self.centre * np.eye(3) - np.outer(self.centre, self.centre)
        )
        return moved


@dataclass(frozen=True)
class Joined:
    """A joint; `axis` in the base frame, None if it is fixed; `mimic`: (leader, multiplier, offset)."""

    ends: tuple[str, str]
    axis: Matrix | None
    limits: tuple[float, float] = (-math.inf, math.inf)
    mimic: tuple[str, float, float] | None = None


@dataclass(frozen=True)
class Read:
    """The result of one reader."""

    bodies: dict[str, Body] = field(default_factory=dict)
    joints: dict[str, Joined] = field(default_factory=dict)

    @property
    def mass(self) -> float:
        return sum(body.mass for body in self.bodies.values())

    @property
    def inertia(self) -> Matrix:
        """The inertia of all links about the origin of the base frame."""
        return sum((body.about_base for body in self.bodies.values()), np.zeros((3, 3)))


def frame(xyz: Matrix, turn: Matrix) -> Matrix:
    """Return a pose as a 4 x 4 matrix."""
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = turn, xyz
    return made


def turn_of_rpy(roll: float, pitch: float, yaw: float) -> Matrix:
    """Return the rotation about the fixed axes x, then y, then z."""
    (cr, cp, cy), (sr, sp, sy) = map(math.cos, (roll, pitch, yaw)), map(math.sin, (roll, pitch, yaw))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    made: Matrix = about_z @ about_y @ about_x
    return made


def turn_of_quaternion(x: float, y: float, z: float, w: float) -> Matrix:
    """Return the rotation of a unit quaternion."""
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    made: Matrix = np.eye(3) + 2 * w * cross + 2 * cross @ cross
    return made


def tensor(moments: Mapping[str, float]) -> Matrix:
    xx, xy, xz, yy, yz, zz = (moments[name] for name in MOMENTS)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def numbers(text: str) -> Matrix:
    return np.array([float(word) for word in text.split()])


def placed(mass: float, at: Matrix, inertia: Matrix) -> Body:
    """Return a body; `at`: the frame of its inertia in the base frame, with its origin at the centre of mass."""
    return Body(mass, at[:3, 3], at[:3, :3] @ inertia @ at[:3, :3].T)


def bounds(lower: float | None, upper: float | None) -> tuple[float, float]:
    return -math.inf if lower is None else float(lower), math.inf if upper is None else float(upper)


# --- URDF: urchin ---


def without_shapes(path: Path) -> ET.Element:
    """Return the root of a URDF without what is not compared, and without an XML declaration of version 0.0."""
    text = path.read_text(encoding="utf-8", errors="replace").rstrip("\0")
    root = ET.fromstring(re.sub(r"<\?xml[^>]*\?>", "", text).strip())
    for link in root.findall("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    for other in [child for child in root if child.tag not in {"link", "joint"}]:
        root.remove(other)
    return root


class NamedText(io.BytesIO):
    """A file in memory, with the name that urchin asks for."""

    name = "model.urdf"


def urchins(path: Path) -> Read:
    """Return urchin's reading of a URDF."""
    import urchin

    root = without_shapes(path)
    massive = {link.attrib["name"] for link in root.findall("link") if link.find("inertial/mass") is not None}
    robot = urchin.URDF.load(NamedText(ET.tostring(root)))
    at = {link.name: pose for link, pose in robot.link_fk(dict.fromkeys(robot.actuated_joint_names, 0.0)).items()}
    bodies = {}
    for link in robot.links:
        if link.name in massive and link.inertial.mass:
            bodies[link.name] = placed(link.inertial.mass, at[link.name] @ link.inertial.origin, link.inertial.inertia)
    return Read(bodies, {joint.name: urchins_joint(joint, at) for joint in robot.joints})


def urchins_joint(joint: Any, at: Mapping[str, Matrix]) -> Joined:
    fixed = joint.joint_type not in {"revolute", "continuous", "prismatic"}
    axis = None if fixed else at[joint.child][:3, :3] @ joint.axis
    limited = joint.limit is not None and joint.joint_type in {"revolute", "prismatic"}
    limits = bounds(joint.limit.lower, joint.limit.upper) if limited else bounds(None, None)
    tied = joint.mimic
    mimic = None if tied is None else (tied.joint, tied.multiplier, tied.offset)
    return Joined((joint.parent, joint.child), axis, limits, mimic)


# --- SDF: the models of old files, which have neither frames nor nested models ---


def pose_of(element: ET.Element) -> Matrix:
    x, y, z, *angles = numbers(element.findtext("pose") or "0 0 0 0 0 0")
    return frame(np.array([x, y, z]), turn_of_rpy(*angles))


def plain_sdf(model: ET.Element) -> Read:
    """Return the reading of a <model> of SDF 1.5 or 1.6, by its specification."""
    in_model = {link.attrib["name"]: pose_of(link) for link in model.findall("link")}
    ends = {joint: (joint.findtext("parent") or "", joint.findtext("child") or "") for joint in model.findall("joint")}
    roots = in_model.keys() - {child for _, child in ends.values()}
    to_base = pose_of(model)
    for root in roots:
        to_base = np.asarray(np.linalg.inv(in_model[root]), dtype=np.float64)
    bodies = {}
    for link in model.findall("link"):
        found = link.find("inertial")
        if found is not None and float(found.findtext("mass") or 1):
            moments = {name: float(found.findtext(f"inertia/{name}") or 0) for name in MOMENTS}
            at = to_base @ in_model[link.attrib["name"]] @ pose_of(found)
            bodies[link.attrib["name"]] = placed(float(found.findtext("mass") or 1), at, tensor(moments))
    return Read(bodies, {joint.attrib["name"]: plain_joint(joint, *ends[joint], in_model, to_base) for joint in ends})


def plain_joint(joint: ET.Element, parent: str, child: str, in_model: Mapping[str, Matrix], to_base: Matrix) -> Joined:
    axis = joint.find("axis")
    if joint.attrib["type"] == "fixed" or axis is None:
        return Joined((parent, child), None)
    in_joint = (axis.findtext("use_parent_model_frame") or "false") in {"0", "false"}
    turn = to_base @ in_model[child] @ pose_of(joint) if in_joint else to_base
    direction = numbers(axis.findtext("xyz") or "")
    stated = [float(axis.findtext(f"limit/{side}") or sign * math.inf) for side, sign in (("lower", -1), ("upper", 1))]
    lower, upper = (limit if abs(limit) < UNLIMITED else math.copysign(math.inf, limit) for limit in stated)
    return Joined((parent, child), turn[:3, :3] @ direction / np.linalg.norm(direction), (lower, upper))


# --- MJCF: MuJoCo's compiler ---


def compiled(model: Any, without: frozenset[str] = frozenset()) -> Read:
    """Return what MuJoCo's compiler made of a model; joints and bodies without a name have numbers.

    :param without: bodies to leave out, with their joints.
    """
    import mujoco

    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    for joint in range(model.njnt):
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            first = model.jnt_qposadr[joint]
            data.qpos[first : first + 7] = (0, 0, 0, 1, 0, 0, 0)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    is_free = bool(model.body_jntnum[1]) and model.jnt_type[model.body_jntadr[1]] == mujoco.mjtJoint.mjJNT_FREE
    base = frame(data.xpos[int(is_free)], data.xmat[int(is_free)].reshape(3, 3))
    bodies = {}
    names = [model.body(body).name or f"body_{body}" for body in range(model.nbody)]
    for body in range(1, model.nbody):
        if names[body] in without:
            continue
        at = np.linalg.inv(base) @ frame(data.xipos[body], data.ximat[body].reshape(3, 3))
        bodies[names[body]] = placed(float(model.body_mass[body]), at, np.diag(model.body_inertia[body]))
    joints = dict[str, Joined]()
    for joint in range(model.njnt):
        if names[model.jnt_bodyid[joint]] in without:
            continue
        if int(model.jnt_type[joint]) in {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}:
            limits = bounds(*model.jnt_range[joint]) if model.jnt_limited[joint] else bounds(None, None)
            joints[str(len(joints))] = Joined(("", ""), base[:3, :3].T @ data.xaxis[joint], limits)
    return Read(bodies, joints)

"""Joints of SDF -> those of URDF."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import ZERO, Pose, Quaternion, Vector3
from sim_action.robot.packages import Version
from sim_action.robot.robot_model import WORLD
from sim_action.robot.sdf.composition import MODEL_FRAME, Entry
from sim_action.robot.sdf.elements import Notes, SdfProblem, flag_of, limit_of, needed, number_of, vector_of
from sim_action.robot.sdf.frames import Frames
from sim_action.robot.sdf.unsupported_parts import tell_parts
from sim_action.robot.sdf.urdf_writer import UrdfWriter, numbers
from sim_action.robot.urdf_elements import UNLIMITED

_KEPT: Final = ("revolute", "continuous", "prismatic", "fixed")
_UNSUPPORTED: Final = {
    "ball": "three revolute joints, or a caster without friction, take its place",
    "universal": "two revolute joints take its place",
    "revolute2": "two revolute joints take its place",
    "screw": "a revolute and a prismatic joint with a <mimic> take its place",
}
_AXES_IN_MODEL_FRAME: Final[Version] = (1, 4)
_EXPRESSED_IN: Final[Version] = (1, 7)
# In m: what poses are written with is rounded.
_OFF_AXIS: Final = 1e-9


@dataclass(frozen=True, eq=False)
class Hinge:
    """A joint with all that is looked up in frames.

    Attributes:
        type: of URDF.
        parent: None is the world.
        pose: of the joint's frame, in the outermost model's.
        axis_xyz: in the frame of the child link; None if it does not move.
    """

    entry: Entry
    type: str
    parent: Entry | None
    child: Entry
    pose: Pose
    axis_xyz: Vector3 | None

    def shift(self, child_pose: Pose) -> Vector3:
        """How far the child's frame has to go so that it lies on the axis, in m, in the child link's frame."""
        if self.axis_xyz is None or self.type == "prismatic":
            return ZERO
        origin = geometry.compose(geometry.inverse(child_pose), self.pose).position_xyz
        length = math.hypot(*self.axis_xyz)
        away = math.hypot(*geometry.cross(origin, self.axis_xyz)) / length if length else 0.0
        return origin if away > _OFF_AXIS else ZERO


def hinge_of(notes: Notes, frames: Frames, entry: Entry) -> Hinge:
    """Looks up what a joint joins, and how. Raises SdfProblem."""
    element, scope = entry.element, entry.owner
    ends = {tag: (needed(element, tag).text or "").strip() for tag in ("parent", "child")}
    if "" in ends.values():
        raise SdfProblem("missing-part", element, f"joint '{entry.full_name}' with an empty <parent> or <child>")
    if ends["child"] == WORLD and scope.find(WORLD) is None:
        message = f"joint '{entry.full_name}' has the world as its child: make it the parent"
        raise SdfProblem("unknown-link", element, message)
    child = frames.link_of(frames.named(scope, ends["child"], needed(element, "child")), scope)
    bolted = ends["parent"] == WORLD and scope.find(WORLD) is None
    parent = None if bolted else frames.link_of(frames.named(scope, ends["parent"], needed(element, "parent")), scope)
    kind = _type(notes, entry)
    pose = frames.in_root(entry)
    axis = None if kind == "fixed" else _axis(frames, entry, pose.orientation_xyzw, frames.in_root(child))
    return Hinge(entry, kind, parent, child, pose, axis)


def _type(notes: Notes, entry: Entry) -> str:
    element, name = entry.element, entry.full_name
    kind = element.get("type", "")
    if kind in _UNSUPPORTED and not entry.owner.static:
        message = f"joint '{name}' is a {kind} joint, which is not simulated: {_UNSUPPORTED[kind]}; let go, it is fixed"
        notes.tell("unsupported-joint", element, message)
    elif kind == "gearbox":
        raise SdfProblem("joint-type", element, f"joint '{name}' is a gearbox: a <mimic> in a joint's axis is one, too")
    elif kind not in {*_KEPT, *_UNSUPPORTED}:
        allowed = ", ".join(_KEPT)
        raise SdfProblem("joint-type", element, f"joint '{name}' is of the unknown type '{kind}'; there are {allowed}")
    if kind not in _KEPT or entry.owner.static:
        return "fixed"
    return "continuous" if kind == "revolute" and not _is_limited(element.find("axis/limit")) else kind


def _is_limited(limit: Element | None) -> bool:
    return limit_of(limit, "lower", -UNLIMITED) > -UNLIMITED or limit_of(limit, "upper", UNLIMITED) < UNLIMITED


def _axis(frames: Frames, entry: Entry, joint_orientation: Quaternion, child: Pose) -> Vector3:
    """The axis in the child link's frame. Raises SdfProblem."""
    axis = needed(entry.element, "axis")
    xyz = axis.find("xyz")
    vector = (0.0, 0.0, 1.0) if xyz is None else vector_of(xyz)
    scope, version = entry.owner, entry.owner.file.version
    name = "" if xyz is None or version < _EXPRESSED_IN else xyz.get("expressed_in", "")
    if version <= _AXES_IN_MODEL_FRAME or (version < _EXPRESSED_IN and flag_of(axis, "use_parent_model_frame")):
        name = MODEL_FRAME
    orientation = joint_orientation
    if name:
        frame = frames.named(scope, name, axis if xyz is None else xyz)
        orientation = (frames.in_root(frame) if frame else frames.model_in_root(scope)).orientation_xyzw
    return geometry.rotate(geometry.conjugate(child.orientation_xyzw), geometry.rotate(orientation, vector))


class JointWriter:
    """Writes joints into a URDF."""

    def __init__(self, notes: Notes, frames: Frames, writer: UrdfWriter) -> None:
        self._notes, self._frames, self._writer = notes, frames, writer

    def write(self, hinge: Hinge, origin: Pose) -> None:
        """Writes a joint; `origin`: of the child link's frame in the parent's. Raises SdfProblem."""
        element, writer = hinge.entry.element, self._writer
        joint = writer.add(writer.root, "joint", element, name=hinge.entry.full_name, type=hinge.type)
        writer.add_origin(joint, element, origin)
        writer.add(joint, "parent", element, link=WORLD if hinge.parent is None else hinge.parent.full_name)
        writer.add(joint, "child", element, link=hinge.child.full_name)
        if hinge.axis_xyz is not None:
            axis = needed(element, "axis")
            writer.add(joint, "axis", axis, xyz=numbers(*hinge.axis_xyz))
            self._write_limits(joint, axis, hinge.type)
            self._write_dynamics(joint, axis)
            self._write_mimic(joint, axis, hinge.entry)
            tell_parts(self._notes, axis, f"joint '{hinge.entry.full_name}'")

    def _write_limits(self, joint: Element, axis: Element, kind: str) -> None:
        limit = axis.find("limit")
        bounds = {"lower": limit_of(limit, "lower", -UNLIMITED), "upper": limit_of(limit, "upper", UNLIMITED)}
        attributes = {} if kind == "continuous" else {tag: numbers(bound) for tag, bound in bounds.items()}
        for tag in ("effort", "velocity"):
            most = limit_of(limit, tag, -1.0)
            if 0 <= most < UNLIMITED:
                attributes[tag] = numbers(most)
        if attributes:
            self._writer.add(joint, "limit", axis if limit is None else limit, **attributes)

    def _write_dynamics(self, joint: Element, axis: Element) -> None:
        name = joint.attrib["name"]
        start = number_of(axis, "initial_position", 0.0)
        if start:
            message = f"<initial_position> is passed over: write robot.joints: {{{name}: {start:g}}}"
            self._notes.tell("passed-over", axis, message)
        dynamics = axis.find("dynamics")
        if dynamics is None:
            return
        stated = {tag: numbers(number_of(dynamics, tag, 0.0)) for tag in ("damping", "friction")}
        self._writer.add(joint, "dynamics", dynamics, **stated)

    def _write_mimic(self, joint: Element, axis: Element, entry: Entry) -> None:
        mimic = axis.find("mimic")
        if mimic is None:
            return
        name = mimic.get("joint", "")
        leader = self._frames.named(entry.owner, name, mimic) if name else None
        if leader is None or leader.kind != "joint" or mimic.get("axis", "axis") != "axis":
            raise SdfProblem("unknown-frame", mimic, f"<mimic> of '{name}': it follows the one axis of a joint")
        multiplier = number_of(mimic, "multiplier", 1.0)
        offset = number_of(mimic, "offset", 0.0) - multiplier * number_of(mimic, "reference", 0.0)
        stated = {"multiplier": numbers(multiplier), "offset": numbers(offset)}
        self._writer.add(joint, "mimic", mimic, joint=leader.full_name, **stated)

"""Resolve the joints of SDF, and write them as URDF.

An SDF joint has a frame of its own, and its axis goes through the origin of that frame. In URDF, it is the frame of the
child link. So the axis is rotated into the child link's frame. If it does not go through the origin of that frame, the
frame of the link in URDF is moved to the joint, without a rotation.
"""

from __future__ import annotations

import math
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import ZERO, Pose, Quaternion, Vector3
from sim_action.core.records import dataclass
from sim_action.robot.audit.unsupported_parts import note_parts, note_sensors
from sim_action.robot.documents.sdf_elements import (
    MODEL_FRAME,
    Notes,
    SdfProblem,
    flag_of,
    limit_of,
    needed,
    number_of,
    vector_of,
)
from sim_action.robot.documents.urdf_elements import UNLIMITED
from sim_action.robot.model.robot_model import WORLD
from sim_action.robot.reading.sdf.composition import Entry
from sim_action.robot.reading.sdf.frames import Frames
from sim_action.robot.reading.sdf.old_versions import FRAMES_NAMED, PARENT_MODEL_FLAG
from sim_action.robot.reading.sdf.urdf_writer import UrdfWriter, numbers

_SUPPORTED: Final = ("revolute", "continuous", "prismatic", "ball", "universal", "revolute2", "fixed")
_URDF_TYPES: Final = {"ball": "spherical", "revolute2": "universal"}
_UNSUPPORTED: Final = {
    "screw": "no engine couples a rotation and a translation in one joint; use a revolute and a prismatic joint with "
    "<mimic>",
}
_TWO_AXES: Final = ("universal", "revolute2")
# Poses in files are rounded.
_AXIS_TOLERANCE_M: Final = 1e-9


@dataclass(frozen=True, eq=False)
class ResolvedJoint:
    """A joint whose links, frame and axis are resolved.

    Attributes:
        type: the URDF type.
        parent: the parent link; None is the world.
        pose: the joint's frame, in the outermost model's frame.
        axis_xyz: in the frame of the child link; None for a fixed joint and a ball joint.
        axis2_xyz: the second axis of a universal joint, in the same frame.
    """

    entry: Entry
    type: str
    parent: Entry | None
    child: Entry
    pose: Pose
    axis_xyz: Vector3 | None
    axis2_xyz: Vector3 | None = None

    def shift(self, child_pose: Pose) -> Vector3:
        """Return the offset in m, in the child link's frame, that moves the child's origin onto the axis."""
        if self.type in ("fixed", "prismatic"):
            return ZERO
        origin = geometry.compose(geometry.inverse(child_pose), self.pose).position_xyz
        if self.axis_xyz is None or self.axis2_xyz is not None:
            return origin if math.hypot(*origin) > _AXIS_TOLERANCE_M else ZERO
        length = math.hypot(*self.axis_xyz)
        away = math.hypot(*geometry.cross(origin, self.axis_xyz)) / length if length else 0.0
        return origin if away > _AXIS_TOLERANCE_M else ZERO


def resolve_joint(notes: Notes, frames: Frames, entry: Entry) -> ResolvedJoint:
    """Resolve the links, the frame and the axis of a joint. Raises SdfProblem."""
    element, scope = entry.element, entry.owner
    ends = {tag: (needed(element, tag).text or "").strip() for tag in ("parent", "child")}
    if "" in ends.values():
        raise SdfProblem("missing-part", element, f"joint '{entry.full_name}' has an empty <parent> or <child>")
    if ends["child"] == WORLD and scope.find(WORLD) is None:
        message = f"joint '{entry.full_name}' has the world as its child: the world must be the parent"
        raise SdfProblem("unknown-link", element, message)
    child = frames.link_of(frames.named(scope, ends["child"], needed(element, "child")), scope)
    to_world = ends["parent"] == WORLD and scope.find(WORLD) is None
    parent = None if to_world else frames.link_of(frames.named(scope, ends["parent"], needed(element, "parent")), scope)
    kind = _type(notes, entry)
    pose = frames.in_root(entry)
    has_axis = kind not in ("fixed", "ball")
    turned = pose.orientation_xyzw
    tags = ["axis", "axis2"] if kind in _TWO_AXES else ["axis"] if has_axis else []
    to_child = geometry.conjugate(frames.in_root(child).orientation_xyzw)
    axes = [geometry.rotate(to_child, _axis(notes, frames, entry, turned, tag)) for tag in tags]
    return ResolvedJoint(entry, kind, parent, child, pose, *axes, *[None] * (1 - len(axes)))


def _type(notes: Notes, entry: Entry) -> str:
    element, name = entry.element, entry.full_name
    kind = element.get("type", "")
    if kind in _UNSUPPORTED and not entry.owner.static:
        message = f"{kind} joint '{name}' is not supported: {_UNSUPPORTED[kind]}; if allowed, it is fixed"
        notes.add("unsupported-joint", element, message)
    elif kind == "gearbox":
        raise SdfProblem(
            "joint-type",
            element,
            f"joint '{name}' is a gearbox, which is not supported: use <mimic> in the <axis> of a joint",
        )
    elif kind not in {*_SUPPORTED, *_UNSUPPORTED}:
        allowed = ", ".join(_SUPPORTED)
        raise SdfProblem(
            "joint-type", element, f"joint '{name}' has the unknown type '{kind}'; the types are {allowed}"
        )
    if kind not in _SUPPORTED or entry.owner.static:
        return "fixed"
    return "continuous" if kind == "revolute" and not _is_limited(element.find("axis/limit")) else kind


def _kind_of_axis(kind: str, axis: Element) -> str:
    return ("revolute" if _is_limited(axis.find("limit")) else "continuous") if kind in _TWO_AXES else kind


def _is_limited(limit: Element | None) -> bool:
    return limit_of(limit, "lower", -UNLIMITED) > -UNLIMITED or limit_of(limit, "upper", UNLIMITED) < UNLIMITED


def _axis(notes: Notes, frames: Frames, entry: Entry, turned: Quaternion, tag: str = "axis") -> Vector3:
    """Return an axis in the frame of the outermost model; `turned`: the joint's frame in it. Raises SdfProblem."""
    axis = needed(entry.element, tag)
    xyz = axis.find("xyz")
    vector = (0.0, 0.0, 1.0) if xyz is None else vector_of(xyz)
    scope, name = entry.owner, "" if xyz is None else xyz.get("expressed_in", "")
    _check_flag(notes, entry, axis)
    orientation = turned
    if name:
        frame = frames.named(scope, name, axis if xyz is None else xyz)
        orientation = (frames.in_root(frame) if frame else frames.model_in_root(scope)).orientation_xyzw
    return geometry.rotate(orientation, vector)


def _check_flag(notes: Notes, entry: Entry, axis: Element) -> None:
    """Check the flag of SDF 1.5 and 1.6 for axes in the model's frame; newer versions ignore it. Raises SdfProblem."""
    flag = axis.find(PARENT_MODEL_FLAG)
    if flag is None or not flag_of(axis, PARENT_MODEL_FLAG) or entry.owner.file.version < FRAMES_NAMED:
        return
    message = f"<{PARENT_MODEL_FLAG}> of joint '{entry.full_name}' is ignored: it is a part of SDF 1.5 and 1.6"
    notes.add("passed-over", flag, f'{message}; for an axis in that frame, write <xyz expressed_in="{MODEL_FRAME}">')


class JointWriter:
    """Writes joints into a URDF."""

    def __init__(self, notes: Notes, frames: Frames, writer: UrdfWriter) -> None:
        self._notes, self._frames, self._writer = notes, frames, writer

    def write(self, resolved: ResolvedJoint, origin: Pose) -> None:
        """Write a joint. Raises SdfProblem.

        :param origin: the child link's frame in the parent link's frame.
        """
        element, writer = resolved.entry.element, self._writer
        joint = writer.add(
            writer.root,
            "joint",
            element,
            name=resolved.entry.full_name,
            type=_URDF_TYPES.get(resolved.type, resolved.type),
        )
        writer.add_origin(joint, element, origin)
        note_sensors(self._notes, element, f"joint '{resolved.entry.full_name}'")
        writer.add(joint, "parent", element, link=WORLD if resolved.parent is None else resolved.parent.full_name)
        writer.add(joint, "child", element, link=resolved.child.full_name)
        if resolved.axis_xyz is not None:
            axis = needed(element, "axis")
            kind = _kind_of_axis(resolved.type, axis)
            self._write_axis(joint, axis, resolved.axis_xyz, kind)
            if resolved.axis2_xyz is None:
                self._write_mimic(joint, axis, resolved.entry)
        damping = number_of(element, "axis/dynamics/damping", 0.0)
        if resolved.type == "ball" and damping:
            writer.add(joint, "dynamics", element, damping=numbers(damping))
        if resolved.axis2_xyz is not None:
            second = needed(element, "axis2")
            self._write_axis(joint, second, resolved.axis2_xyz, _kind_of_axis(resolved.type, second), "2")

    def _write_axis(self, joint: Element, axis: Element, xyz: Vector3, kind: str, number: str = "") -> None:
        """Write an axis with its limits and dynamics; `number`: at the end of the tags."""
        self._writer.add(joint, f"axis{number}", axis, xyz=numbers(*xyz))
        self._write_limits(joint, axis, kind, number)
        self._write_dynamics(joint, axis, number)
        note_parts(self._notes, axis, f"joint '{joint.attrib['name']}'")

    def _write_limits(self, joint: Element, axis: Element, kind: str, number: str) -> None:
        limit = axis.find("limit")
        bounds = {"lower": limit_of(limit, "lower", -UNLIMITED), "upper": limit_of(limit, "upper", UNLIMITED)}
        attributes = {} if kind == "continuous" else {tag: numbers(bound) for tag, bound in bounds.items()}
        for tag in ("effort", "velocity"):
            most = limit_of(limit, tag, -1.0)
            if 0 <= most < UNLIMITED:
                attributes[tag] = numbers(most)
        if attributes:
            self._writer.add(joint, f"limit{number}", axis if limit is None else limit, **attributes)

    def _write_dynamics(self, joint: Element, axis: Element, number: str) -> None:
        name = f"{joint.attrib['name']}_{number or 1}" if "universal" in joint.attrib["type"] else joint.attrib["name"]
        start = number_of(axis, "initial_position", 0.0)
        if start:
            message = f"<initial_position> is ignored: set robot.joints: {{{name}: {start:g}}} in the scenario"
            self._notes.add("passed-over", axis, message)
        dynamics = axis.find("dynamics")
        if dynamics is None:
            return
        stated = {tag: numbers(number_of(dynamics, tag, 0.0)) for tag in ("damping", "friction")}
        if number_of(dynamics, "spring_stiffness", 0.0):
            tags = ("spring_stiffness", "spring_reference")
            stated |= {tag: numbers(number_of(dynamics, tag, 0.0)) for tag in tags}
        self._writer.add(joint, f"dynamics{number}", dynamics, **stated)

    def _write_mimic(self, joint: Element, axis: Element, entry: Entry) -> None:
        mimic = axis.find("mimic")
        if mimic is None:
            return
        name = mimic.get("joint", "")
        leader = self._frames.named(entry.owner, name, mimic) if name else None
        if leader is None or leader.kind != "joint" or mimic.get("axis", "axis") != "axis":
            raise SdfProblem(
                "unknown-frame", mimic, f"<mimic> refers to '{name}'; it must refer to a joint with one axis"
            )
        multiplier = number_of(mimic, "multiplier", 1.0)
        offset = number_of(mimic, "offset", 0.0) - multiplier * number_of(mimic, "reference", 0.0)
        stated = {"multiplier": numbers(multiplier), "offset": numbers(offset)}
        self._writer.add(joint, "mimic", mimic, joint=leader.full_name, **stated)

"""What joints of SDF join, and about which axes.

A joint of SDF has a frame of its own in its child link, through which its axis runs. In URDF that frame is the child
link's. So the axis is turned into the child's frame; where it does not run through the child's own origin, the link's
frame in URDF is moved, unturned, to the joint's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import ZERO, Pose, Quaternion, Vector3
from sim_action.robot.model_files import Version
from sim_action.robot.robot_model import WORLD
from sim_action.robot.sdf.frames import Frames
from sim_action.robot.sdf.problems import Notes, SdfProblem
from sim_action.robot.sdf.scopes import MODEL_FRAME, Entry
from sim_action.robot.sdf.values import flag_of, limit_of, needed, vector_of
from sim_action.robot.values import UNLIMITED

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

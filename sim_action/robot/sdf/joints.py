"""Joints of SDF -> those of URDF."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from sim_action.core.geometry import Pose
from sim_action.robot.robot_model import WORLD
from sim_action.robot.sdf.frames import Frames
from sim_action.robot.sdf.hinges import Hinge
from sim_action.robot.sdf.passed_over import tell_parts
from sim_action.robot.sdf.problems import Notes, SdfProblem
from sim_action.robot.sdf.scopes import Entry
from sim_action.robot.sdf.values import limit_of, needed, number_of
from sim_action.robot.sdf.writing import UrdfWriter, numbers
from sim_action.robot.values import UNLIMITED


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

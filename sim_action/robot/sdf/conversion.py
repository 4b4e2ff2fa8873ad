"""An SDF whose frames are known -> URDF."""

from __future__ import annotations

import math
from typing import Final

from sim_action.core import geometry
from sim_action.robot.document import ModelDocument
from sim_action.robot.robot_model import WORLD
from sim_action.robot.sdf.frames import Frames
from sim_action.robot.sdf.joints import JointWriter
from sim_action.robot.sdf.kinematics import Kinematics, kinematics_of
from sim_action.robot.sdf.links import LinkWriter
from sim_action.robot.sdf.passed_over import tell_parts
from sim_action.robot.sdf.problems import Notes
from sim_action.robot.sdf.scopes import SEPARATOR, Entry, Scope
from sim_action.robot.sdf.writing import UrdfWriter

_TURNED: Final = 1e-6  # rad


def convert(scope: Scope, notes: Notes) -> ModelDocument:
    """The URDF, or as much of it as there can be; what is wrong or odd is noted."""
    frames = Frames(scope)
    kinematics = kinematics_of(scope, frames, notes)
    writer = UrdfWriter(scope.element.get("name") or scope.file.path.stem, scope.element, notes.places)
    if notes.hopeless:
        return writer.document()
    if kinematics.needs_world and scope.find(WORLD) is None:
        writer.add(writer.root, "link", scope.element, name=WORLD)
    _write_tree(kinematics, LinkWriter(notes, frames, writer), JointWriter(notes, frames, writer), notes)
    for link in kinematics.bolted:
        _bolt(writer, kinematics, link)
    _copy_plugins(writer, scope)
    _tell_turned_base(notes, kinematics)
    _tell_what_is_passed_over(notes, scope)
    return writer.document()


def _write_tree(kinematics: Kinematics, links: LinkWriter, joints: JointWriter, notes: Notes) -> None:
    for placed in kinematics.placed.items():
        notes.attempt(lambda placed: links.write(*placed), placed)
    for hinge in kinematics.hinges:
        origin = kinematics.seen_from(hinge.parent, hinge.child)
        notes.attempt(lambda placed: joints.write(*placed), (hinge, origin))


def _bolt(writer: UrdfWriter, kinematics: Kinematics, link: Entry) -> None:
    """What is static hangs on the world by a joint of ours."""
    source = link.element
    joint = writer.add(writer.root, "joint", source, name=f"{WORLD}{SEPARATOR}{link.full_name}", type="fixed")
    writer.add_origin(joint, source, kinematics.seen_from(None, link))
    writer.add(joint, "parent", source, link=WORLD)
    writer.add(joint, "child", source, link=link.full_name)


def _copy_plugins(writer: UrdfWriter, scope: Scope) -> None:
    includes = [entry.element for entry in scope.all_of("model") if entry.element.tag == "include"]
    for holder in (*(inner.element for inner in scope.scopes()), *includes):
        for plugin in holder.findall("plugin"):
            writer.copy(writer.add(writer.root, "gazebo", plugin), plugin)


def _tell_turned_base(notes: Notes, kinematics: Kinematics) -> None:
    """A scenario says how the base link stands, and the model's own word is lost."""
    if kinematics.needs_world or len(kinematics.free) != 1:
        return
    (root,) = kinematics.free
    orientation = kinematics.seen_from(None, root).orientation_xyzw
    angles = dict(zip(("roll", "pitch", "yaw"), geometry.rpy_from_quaternion(orientation), strict=True))
    turned = [f"{name}: {math.degrees(angle):.6g} deg" for name, angle in angles.items() if abs(angle) > _TURNED]
    if turned:
        message = f"root link '{root.full_name}' is turned in the SDF; a scenario says so itself: robot.pose: "
        notes.tell("turned-base", root.element, f"{message}{{{', '.join(turned)}}}")


def _tell_what_is_passed_over(notes: Notes, scope: Scope) -> None:
    for inner in scope.scopes():
        name = f"model '{inner.element.get('name', '')}'"
        notes.attempt(lambda model: tell_parts(notes, *model), (inner.element, name))
    for model in {inner.file.model: None for inner in scope.scopes()}:
        for pose in model.iter("pose"):
            if pose.get("frame"):
                message = f"<pose frame=\"{pose.get('frame')}\"> never had a meaning: since SDF 1.7 it is 'relative_to'"
                notes.tell("passed-over", pose, message)

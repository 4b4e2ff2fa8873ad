"""An SDF whose frames are known -> URDF."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim_action.core import geometry
from sim_action.core.geometry import ZERO, Pose
from sim_action.robot.audit.rules import refuse_errors
from sim_action.robot.packages import NEWEST, Packages
from sim_action.robot.robot_model import WORLD, Finding
from sim_action.robot.sdf.composition import SEPARATOR, Assembly, Entry, Scope
from sim_action.robot.sdf.elements import Notes
from sim_action.robot.sdf.files import read_sdf_file
from sim_action.robot.sdf.frames import Frames
from sim_action.robot.sdf.joints import Hinge, JointWriter, hinge_of
from sim_action.robot.sdf.links import LinkWriter
from sim_action.robot.sdf.unsupported_parts import tell_parts
from sim_action.robot.sdf.urdf_writer import UrdfWriter
from sim_action.robot.xml_document import ModelDocument


@dataclass(frozen=True)
class Kinematics:
    """The tree, if it is one.

    Attributes:
        placed: link -> its frame in URDF, in the outermost model's frame.
        in_world: the outermost model's frame, in the world.
        bolted: static links, which hang on the world by no joint of the file's.
        free: links that hang on nothing; a robot has one.
    """

    placed: Mapping[Entry, Pose]
    hinges: tuple[Hinge, ...]
    in_world: Pose
    bolted: tuple[Entry, ...]
    free: tuple[Entry, ...]

    @property
    def needs_world(self) -> bool:
        """Whether something hangs on the world."""
        return bool(self.bolted) or any(hinge.parent is None for hinge in self.hinges)

    def seen_from(self, parent: Entry | None, child: Entry) -> Pose:
        """The frame of a link in that of another, or in the world."""
        outer = self.in_world if parent is None else geometry.inverse(self.placed[parent])
        return geometry.compose(outer, self.placed[child])


def kinematics_of(scope: Scope, frames: Frames, notes: Notes) -> Kinematics:
    """Looks up all frames and joints; what is wrong is noted."""
    in_world = notes.attempt(Frames.root_in_world, frames) or Pose()
    for entry in (*scope.all_of("frame"), *scope.all_of("model")):
        notes.attempt(frames.check, entry)
    found = [notes.attempt(lambda entry: hinge_of(notes, frames, entry), joint) for joint in scope.all_of("joint")]
    hinges = tuple(hinge for hinge in found if hinge)
    carriers = {hinge.child: hinge for hinge in reversed(hinges)}
    links = tuple(scope.all_of("link"))
    poses = [notes.attempt(lambda link: _placed(frames, link, carriers.get(link)), link) for link in links]
    loose = [link for link in links if link not in carriers]
    bolted = dict.fromkeys(link for link in loose if link.owner.static and link.full_name != WORLD)
    placed = {link: pose for link, pose in zip(links, poses, strict=True) if pose}
    return Kinematics(placed, hinges, in_world, tuple(bolted), tuple(link for link in loose if link not in bolted))


def _placed(frames: Frames, link: Entry, carrier: Hinge | None) -> Pose:
    pose = frames.in_root(link)
    return geometry.compose(pose, Pose(carrier.shift(pose) if carrier else ZERO))


_TURNED: Final = 1e-6  # rad


def urdf_of_sdf(
    document: ModelDocument, path: Path, packages: Packages, allow: Iterable[str]
) -> tuple[ModelDocument, tuple[Finding, ...]]:
    """The URDF of a parsed SDF, and what was odd or let go; `path`: of its file. Raises ModelError."""
    file, notes = read_sdf_file(path.resolve(), document), Notes()
    scope = Assembly(file, packages, notes).read()
    if file.version > NEWEST:
        message = f"SDF {document.root.get('version')} is read as {NEWEST[0]}.{NEWEST[1]}"
        notes.tell("passed-over", document.root, message)
    allowed = set(allow)
    refuse_errors(notes.findings, allowed)
    urdf = convert(scope, notes)
    refuse_errors(notes.findings, allowed)
    return urdf, tuple(notes.findings)


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

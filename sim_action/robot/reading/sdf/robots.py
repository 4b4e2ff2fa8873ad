"""Read a model of SDF (sdformat.org/spec, versions 1.3 to 1.12) into the draft of a robot.

The base link's frame is the frame of the root link. The frame of a link is the same as in SDF, with one exception: if
the axis of its joint does not go through its origin, its frame is at the joint (`links_and_joints.py`). A model that is
fixed to the world gets a root link named `world`. Its frame is the world of the file, in which the <pose> of the
outermost <model> counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

from sim_action.core import geometry
from sim_action.core.errors import Location
from sim_action.core.geometry import ZERO, Pose
from sim_action.core.records import dataclass
from sim_action.robot.audit.elements import note_parts, note_plugin
from sim_action.robot.documents.packages import NEWEST, Packages
from sim_action.robot.documents.sdf_elements import Notes
from sim_action.robot.documents.urdf_elements import plugin_of
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.draft import JointDraft, LinkDraft, RobotDraft, origin_at
from sim_action.robot.model.findings import Finding, refuse_errors
from sim_action.robot.model.robot_model import WORLD
from sim_action.robot.reading.sdf.composition import SEPARATOR, Assembly, Entry, Scope, read_sdf_file
from sim_action.robot.reading.sdf.frames import Frames
from sim_action.robot.reading.sdf.links_and_joints import JointReader, LinkReader, ResolvedJoint, resolve_joint
from sim_action.robot.reading.sdf.worlds import robot_scope

_MIN_ROTATION_RAD: Final = 1e-6


@dataclass(frozen=True)
class Kinematics:
    """The links and joints with all poses; not yet checked to be a tree."""

    placed: Mapping[Entry, Pose]  # link -> its frame in the draft, in the outermost model's frame
    joints: tuple[ResolvedJoint, ...]  # the joints of the file
    in_world: Pose  # the outermost model's frame, in the world
    static: tuple[Entry, ...]  # static links without a joint; they are fixed to the world
    roots: tuple[Entry, ...]  # other links without a parent; a robot has one

    @property
    def needs_world(self) -> bool:
        """Return True if a link is fixed to the world or has it as its parent."""
        return bool(self.static) or any(joint.parent is None for joint in self.joints)

    def pose_in(self, parent: Entry | None, child: Entry) -> Pose:
        """Return the frame of a link in the frame of another link, or in the world if `parent` is None."""
        outer = self.in_world if parent is None else geometry.inverse(self.placed[parent])
        return geometry.compose(outer, self.placed[child])


def kinematics_of(scope: Scope, frames: Frames, notes: Notes) -> Kinematics:
    """Resolve all frames and joints. Problems become findings in `notes`."""
    in_world = notes.attempt(Frames.root_in_world, frames) or Pose()
    for entry in (*scope.all_of("frame"), *scope.all_of("model")):
        notes.attempt(frames.check, entry)
    resolved = [
        notes.attempt(lambda entry: resolve_joint(notes, frames, entry), joint) for joint in scope.all_of("joint")
    ]
    joints = tuple(joint for joint in resolved if joint)
    carriers = {joint.child: joint for joint in reversed(joints)}
    links = tuple(scope.all_of("link"))
    poses = [notes.attempt(lambda link: _placed(frames, link, carriers.get(link)), link) for link in links]
    loose = [link for link in links if link not in carriers]
    static = dict.fromkeys(link for link in loose if link.owner.static and link.full_name != WORLD)
    placed = {link: pose for link, pose in zip(links, poses, strict=True) if pose}
    return Kinematics(placed, joints, in_world, tuple(static), tuple(link for link in loose if link not in static))


def _placed(frames: Frames, link: Entry, carrier: ResolvedJoint | None) -> Pose:
    pose = frames.in_root(link)
    return geometry.compose(pose, Pose(carrier.shift(pose) if carrier else ZERO))


def draft_of_sdf(
    document: ModelDocument, path: Path, packages: Packages, allow: Iterable[str], name: str = ""
) -> tuple[RobotDraft | None, list[Finding]]:
    """Return the robot of a parsed SDF, and the findings; no robot if one of them is fatal. Raises ModelError.

    `path`: the file of the document; `allow`: rules whose errors are accepted; `name`: name of the model in a world;
    empty: the file has one model.
    """
    notes = Notes(findings=list(document.findings))
    if name:
        scope, version = robot_scope(path.resolve(), document, name, packages, notes)
    else:
        file = read_sdf_file(path.resolve(), document)
        scope, version = Assembly(file, packages, notes).read(), file.version
    if version > NEWEST:
        message = (
            f"SDF {document.root.get('version')} is newer than {NEWEST[0]}.{NEWEST[1]}, and is read as that version"
        )
        notes.add("passed-over", document.root, message)
    refuse_errors(notes.findings, allow)
    if document.root.tag == "sdf":
        notes.places.setdefault(document.root, document.places[document.root])
        note_parts(notes, document.root, "the file", frozenset({"world"}))
    draft = _draft_of(scope, notes, places_base=bool(name))
    is_fatal = any(finding.level == "fatal" for finding in notes.findings)
    return None if is_fatal else draft, notes.findings


def _draft_of(scope: Scope, notes: Notes, *, places_base: bool = False) -> RobotDraft | None:
    """Return the robot of a model as far as possible; `places_base`: the base starts where the file has it."""
    frames = Frames(scope)
    kinematics = kinematics_of(scope, frames, notes)
    if any(finding.level == "fatal" for finding in notes.findings):
        return None
    place = notes.places[scope.element]
    is_fixed = kinematics.needs_world and scope.find(WORLD) is None
    links = [LinkDraft(WORLD, place)] if is_fixed else []
    link_reader = LinkReader(notes, frames)
    for link in kinematics.placed.items():
        links += filter(None, [notes.attempt(lambda link: link_reader.read(*link), link)])
    joint_reader = JointReader(notes, frames)
    joints = list[JointDraft]()
    for joint in kinematics.joints:
        origin = kinematics.pose_in(joint.parent, joint.child)
        joints += filter(None, [notes.attempt(lambda placed: joint_reader.read(*placed), (joint, origin))])
    joints += [_bolt(link, notes.places[link.element], kinematics.pose_in(None, link)) for link in kinematics.static]
    plugins = list(scope.plugins())
    for plugin in plugins:
        note_plugin(notes, plugin)
    if not places_base:
        _note_rotated_base(notes, kinematics)
    # Note the parts of models and of <include> that are not read. Parts of links and joints are noted elsewhere.
    for inner in scope.scopes():
        note_parts(notes, inner.element, f"model '{inner.element.get('name', '')}'")
        for entry in inner.members:
            if entry.element.tag == "include":
                note_parts(notes, entry.element, "<include>")
    notes.report_parts()
    _note_frames(notes, scope)
    name = scope.element.get("name") or scope.file.path.stem
    return RobotDraft(
        name, place, tuple(links), tuple(joints), tuple(plugin_of(plugin, notes.places[plugin]) for plugin in plugins)
    )


def _bolt(link: Entry, place: Location, pose: Pose) -> JointDraft:
    """Return the joint that fixes a static link to the world."""
    name = f"{WORLD}{SEPARATOR}{link.full_name}"
    return JointDraft(name, "fixed", WORLD, link.full_name, place, origin_at(pose, place))


def _note_rotated_base(notes: Notes, kinematics: Kinematics) -> None:
    """Add a finding if the SDF rotates the base link: the scenario sets the pose of the base, so this is lost."""
    if kinematics.needs_world or len(kinematics.roots) != 1:
        return
    (root,) = kinematics.roots
    orientation = kinematics.pose_in(None, root).orientation_xyzw
    angles = dict(zip(("roll", "pitch", "yaw"), geometry.rpy_from_quaternion(orientation), strict=True))
    turned = [
        f"{name}: {math.degrees(angle):.6g} deg" for name, angle in angles.items() if abs(angle) > _MIN_ROTATION_RAD
    ]
    if turned:
        message = f"the SDF rotates root link '{root.full_name}', which is ignored; set robot.pose: "
        notes.add("turned-base", root.element, f"{message}{{{', '.join(turned)}}}")


def _note_frames(notes: Notes, scope: Scope) -> None:
    """Add a finding for each <pose frame> without an effect."""
    for model in {inner.file.model: None for inner in scope.scopes()}:
        for pose in model.iter("pose"):
            if pose.get("frame", "") not in {"", pose.get("relative_to")}:
                message = f"<pose frame=\"{pose.get('frame')}\"> is ignored: use 'relative_to', available since SDF 1.7"
                notes.add("passed-over", pose, message)

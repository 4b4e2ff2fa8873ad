"""Read the <world> of an SDF file: its models in their frames, and one of them as a robot.

A world is composed like a model that contains the models of the world, so names such as `table::leg` and poses
relative to other models have one reader.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count
from pathlib import Path, PurePosixPath
from typing import Final
from urllib.parse import unquote
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.core.records import dataclass, field, replace
from sim_action.core.wording import did_you_mean
from sim_action.robot.documents.packages import Packages, Version
from sim_action.robot.documents.sdf_elements import Notes, SdfProblem, pose_of, text_of
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.findings import refuse_errors
from sim_action.robot.reading.sdf.composition import Assembly, Entry, Scope, SdfFile, sdf_version, upgraded
from sim_action.robot.reading.sdf.frames import Frames

OWN_MODELS: Final = frozenset({"ground_plane", "sun"})
"""The models of Gazebo that need no file: every world has a ground, and lights are only drawn."""

_MODELS: Final = ("model", "include")
_BARE_VERSION: Final[Version] = (1, 6)  # of a <world> without an <sdf> around it


@dataclass(frozen=True, eq=False)
class SdfWorld:
    """A world whose models are composed."""

    element: Element  # the <world>
    scope: Scope  # its models, as if an outermost model contained them
    frames: Frames
    states: Mapping[str, Element]  # name of a model -> its <model> in <state>
    has_ground: bool  # True if it includes the ground plane of Gazebo
    renamed: Mapping[Element, str] = field(default_factory=dict)  # models with the name of an earlier one -> that name
    version: Version = _BARE_VERSION  # of the file

    @property
    def models(self) -> Mapping[str, Entry]:
        """The models of the world by name."""
        return {entry.name: entry for entry in self.scope.members if entry.kind == "model" and entry.name}

    def pose(self, model: Entry) -> Pose:
        """Return the pose of a model in the world; <state> comes first. Raises SdfProblem."""
        stated = self._stated(self.states.get(model.name))
        return self.frames.in_root(model) if stated is None else stated

    def link_pose(self, model: Entry, link: Entry) -> Pose:
        """Return the pose in the world of a link of a model, or of a model in it. Raises SdfProblem."""
        state = self.states.get(model.name)
        inner = link.full_name.removeprefix(f"{model.name}::")
        for holder in state.findall("link") if state is not None else ():
            if holder.get("name") == inner and (stated := self._stated(holder)) is not None:
                return stated
        in_model = geometry.compose(geometry.inverse(self.frames.in_root(model)), self.frames.in_root(link))
        return geometry.compose(self.pose(model), in_model)

    @staticmethod
    def _stated(state: Element | None) -> Pose | None:
        pose = None if state is None else state.find("pose")
        return None if pose is None else pose_of(pose)


def world_of(document: ModelDocument) -> Element | None:
    """Return the <world> of a document, if it has one."""
    return document.root if document.root.tag == "world" else document.root.find("world")


def read_sdf_world(path: Path, document: ModelDocument, packages: Packages, notes: Notes) -> SdfWorld:
    """Compose the models of a world in a resolved file; problems are noted. Raises ModelError."""
    element = world_of(document)
    if element is None:
        message = "this file has no <world>; name a .world or .sdf file with one"
        document.refuse("not-a-robot", document.root, message)
    version = _BARE_VERSION if document.root is element else sdf_version(document)
    document = upgraded(document, version)
    kept = Element("world", element.attrib)
    kept.extend(child for child in element if not _is_own(child))
    renamed = _rename_doubles(kept)
    document = replace(document, places={**document.places, kept: document.places[element]})
    scope = Assembly(SdfFile(path, version, kept, document), packages, notes).read()
    state = element.find("state")
    states = {} if state is None else {model.get("name", ""): model for model in state.findall("model")}
    has_ground = any(is_ground(child) for child in element)
    for other in document.root.findall("world")[1:]:
        notes.add("passed-over", other, f"only the first <world> is read; '{other.get('name', '')}' is ignored")
    return SdfWorld(element, scope, Frames(scope), states, has_ground, renamed, version)


def robot_scope(
    path: Path, document: ModelDocument, name: str, packages: Packages, notes: Notes
) -> tuple[Scope, Version]:
    """Return one model of a world as an outermost model, and its file's version. Raises ModelError."""
    others = Notes()
    world = read_sdf_world(path, document, packages, others)
    notes.places.update(others.places)
    entry = world.models.get(name)
    if entry is None or entry.scope is None:
        refuse_errors(others.findings)
        message = f"the world has no model '{name}'{did_you_mean(name, world.models)}"
        document.refuse("not-a-robot", world.element, message)
    inner = entry.scope
    model = Element("model", {**inner.element.attrib, "name": name})
    model.extend([*inner.element, *entry.included_plugins])
    notes.places[model] = others.places[inner.element]
    places = {**inner.file.document.places, model: notes.places[model]}
    file = replace(inner.file, model=model, document=replace(inner.file.document, places=places))
    scope = Assembly(file, packages, notes, static=inner.static).read()
    scope.placement_frame = ""
    pose = notes.attempt(world.pose, entry) or Pose()
    element = Element("pose", {"rotation_format": "quat_xyzw"})
    element.text = " ".join(map(repr, (*pose.position_xyz, *pose.orientation_xyzw)))
    scope.pose = element
    notes.places[scope.pose] = others.places[entry.element]
    return scope, inner.file.version


def base_pose(world: SdfWorld, name: str) -> Pose | None:
    """Return the pose of a model's root link in the world; None if it is fixed to it. Raises SdfProblem."""
    entry = world.models[name]
    scope = entry.scope
    assert scope is not None
    carried = {joint_end(world.frames, joint, "child") for joint in scope.all_of("joint")}
    roots = [link for link in scope.all_of("link") if link not in carried]
    if not roots or any(root.owner.static for root in roots):
        return None
    return world.link_pose(entry, roots[0])


def joint_end(frames: Frames, joint: Entry, tag: str) -> Entry | None:
    """Return the link that <parent> or <child> of a joint leads to; None if that is the world, or no link."""
    try:
        return frames.end_of(joint, tag)
    except SdfProblem:
        return None


def _rename_doubles(world: Element) -> Mapping[Element, str]:
    """Give models with the name of an earlier one another name, such as `crate_1`; return the old names."""
    stated = {child: child.get("name", "") or text_of(child, "name") for child in world if child.tag in _MODELS}
    taken = set(stated.values())
    renamed = dict[Element, str]()
    seen = set[str]()
    for child, name in stated.items():
        if name and name in seen:
            number = next(number for number in count(1) if f"{name}_{number}" not in taken)
            holder = child.find("name")
            if holder is None:
                child.set("name", f"{name}_{number}")
            else:
                holder.text = f"{name}_{number}"
            renamed[child] = name
            taken.add(f"{name}_{number}")
        seen.add(name)
    return renamed


def is_ground(child: Element) -> bool:
    """Return True if an element includes the ground plane of Gazebo."""
    return _is_own(child) and _own_name(child) == "ground_plane"


def _is_own(child: Element) -> bool:
    return child.tag == "include" and _own_name(child) in OWN_MODELS


def _own_name(include: Element) -> str:
    uri = unquote(text_of(include, "uri"))
    return PurePosixPath(uri).name.lower().replace(" ", "_")

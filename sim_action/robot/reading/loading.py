"""Load the robot model that a scenario names: a built-in model, or a file of URDF, xacro, SDF or MJCF."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import TYPE_CHECKING, Final
from xml.etree.ElementTree import Element

from sim_action.core.errors import ModelError, Problem, RefusedModel
from sim_action.core.records import replace
from sim_action.core.wording import FirstFew, did_you_mean
from sim_action.core.workspace import PathError, Workspace, similar_name
from sim_action.robot.audit.elements import unread_parts_of_srdf
from sim_action.robot.built_in import BUILT_IN, FOLDER
from sim_action.robot.documents.packages import (
    PackageError,
    Packages,
    find_model_file,
    is_folder,
    is_model_folder,
    model_files_in,
)
from sim_action.robot.documents.urdf_elements import is_numbers
from sim_action.robot.documents.xml_document import ModelDocument, read_document
from sim_action.robot.model.findings import Finding, limited_notes, without_harmless
from sim_action.robot.model.robot_model import RobotModel, Srdf, keyframe_of
from sim_action.robot.reading.building import built
from sim_action.robot.reading.urdf import model_of, read_urdf

if TYPE_CHECKING:
    from sim_action.robot.model.robot_spec import Robot


_SELF_COLLIDE: Final = ("<self_collide>", "<selfCollide>")
_PACKAGE_NOTES: Final = frozenset({"several-packages", "package-folder"})


class ModelLibrary:
    """A cache of loaded models: each model of a suite is read once, even when many scenarios name it.

    A cached model does not change when its files change. Create one library for each call that reads scenarios.
    """

    def __init__(self) -> None:
        self._models: dict[Hashable, RobotModel | ModelError] = {}

    def load(self, robot: Robot, workspace: Workspace) -> RobotModel:
        """Return the model as `load_model` does, or from the cache. Raises ModelError, also from the cache."""
        key = (workspace.root, workspace.allow_outside, workspace.packages, *_place(robot, workspace), _options(robot))
        if key not in self._models:
            self._models[key] = _read_or_error(robot, workspace)
        outcome = self._models[key]
        if isinstance(outcome, ModelError):
            raise outcome.with_traceback(None)
        return outcome


def _read_or_error(robot: Robot, workspace: Workspace) -> RobotModel | ModelError:
    try:
        return load_model(robot, workspace)
    except ModelError as error:
        # The context would keep alive all that was being read when the error was raised.
        error.__context__ = error.__cause__ = None
        return error.with_traceback(None)


def _place(robot: Robot, workspace: Workspace) -> tuple[Hashable, ...]:
    """Return the part of the key that names the file; a package name means another one in each folder."""
    if robot.model in BUILT_IN and robot.srdf is None:
        return (robot.model,)
    if not robot.packages and "://" not in robot.model and robot.srdf is None:
        try:
            return (workspace.file(robot.file), robot.name_in_world)
        except PathError:
            pass  # load_model reports it
    return workspace.directory, robot.model


def _options(robot: Robot) -> str:
    return robot.model_dump_json(include={"args", "packages", "allow", "keyframe", "srdf", "self_collision"})


def load_model(robot: Robot, workspace: Workspace) -> RobotModel:
    """Read the model that a robot names; this runs the expressions of a xacro file. Raises ModelError."""
    model = _read_model(robot, workspace)
    if robot.keyframe is not None:
        _check_keyframe(robot.keyframe, model)
    if robot.srdf is not None:
        model = with_srdf(model, _srdf_file(robot.srdf, Packages(workspace, robot.packages)))
    return replace(model, findings=limited_notes(_about_self_collision(robot, _without_repeats(model.findings))))


def _about_self_collision(robot: Robot, findings: Iterable[Finding]) -> Iterator[Finding]:
    """Yield findings; those on <self_collide> name the key of the scenario, which makes them superfluous."""
    for note in findings:
        if note.rule != "passed-over" or not note.message.startswith(_SELF_COLLIDE):
            yield note
        elif not robot.self_collision:
            yield replace(note, message=f"{note.message}; robot.self_collision: true simulates it")


def _without_repeats(findings: Iterable[Finding]) -> Iterator[Finding]:
    """Yield findings, each note about a package only once: includes and meshes may both need the package."""
    seen = set[tuple[str, str]]()
    for note in findings:
        key = (note.rule, note.message)
        if note.rule not in _PACKAGE_NOTES or key not in seen:
            seen.add(key)
            yield note


def _check_keyframe(name: str | int, model: RobotModel) -> None:
    if not model.keyframes:
        raise ModelError(f"the model has no keyframes; remove 'keyframe: {name}'")
    keyframe = keyframe_of(model.keyframes, name)
    if keyframe is None:
        raise ModelError(f"the model has no keyframe '{name}'{did_you_mean(str(name), model.keyframes)}")
    if keyframe.flaw:
        raise ModelError(f"keyframe '{name}' cannot be used: {keyframe.flaw}; correct it", keyframe.place)


def _read_model(robot: Robot, workspace: Workspace) -> RobotModel:
    if robot.model in BUILT_IN:
        return read_urdf(FOLDER / f"{robot.model}.urdf")
    packages = Packages(workspace, robot.packages)
    path = _path(robot.file, packages)
    if path.suffix == ".srdf":
        raise ModelError("an SRDF has no links of its own: name the model in robot.model, and this file in robot.srdf")
    if not robot.is_xacro:
        return _model(read_document(path), path, packages, robot.allow, robot.name_in_world)
    # xacro takes 40 ms to import.
    from sim_action.robot.reading.xacro_expansion import read_xacro

    document, warnings = read_xacro(path, robot.args, packages)
    model = _model(document, path, packages, robot.allow)
    return replace(model, findings=(*model.findings, *warnings))


def _model(document: ModelDocument, path: Path, packages: Packages, allow: Iterable[str], name: str = "") -> RobotModel:
    """Return the model of a document, whose root element decides the format; `name`: of a model in a world file."""
    if document.root.tag == "mujoco" and path.suffix == ".xml":
        # MuJoCo takes 0.1 s to import.
        from sim_action.robot.reading.mjcf.mjcf_reader import read_mjcf

        model = read_mjcf(path, packages, allow)
        return replace(model, findings=(*model.findings, *document.findings))
    if document.root.tag != "sdf":
        return model_of(document, path, packages, allow)
    from sim_action.robot.reading.sdf.robots import draft_of_sdf  # a usual run does without it

    return built(*draft_of_sdf(document, path, packages, allow, name), path, packages, allow)


def check_text(robot: Robot, workspace: Workspace) -> tuple[str, ...]:
    """Check a file of xacro or MJCF as text, without running it. Return what was not checked. Raises ModelError."""
    packages = Packages(workspace, robot.packages)
    path = _path(robot.model, packages)
    if robot.srdf is not None:
        read_srdf_text(_srdf_file(robot.srdf, packages))
    if robot.is_mjcf:
        from sim_action.robot.reading.mjcf.mjcf_files import collect_files  # a usual run does without it

        collect_files(path, packages)
        return (f"links and joints of {robot.model}: MuJoCo reads the file when the scenario runs",)
    from sim_action.robot.reading.xacro_documents import check_xacro_text  # a usual run does without it

    return check_xacro_text(path, robot.args, packages)


def package_problems(robot: Robot, workspace: Workspace) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield a problem, with its path in the scenario, for each key of `robot.packages` that leads to no folder."""
    # Packages copy the environment.
    problems = Packages(workspace, robot.packages).mapped_problems() if robot.packages else ()
    for name, message in problems:
        yield ("robot", "packages", name), message


def srdf_problems(robot: Robot, workspace: Workspace) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield a problem, with its path in the scenario, if `robot.srdf` leads to no file."""
    if robot.srdf is None:
        return
    try:
        _srdf_file(robot.srdf, Packages(workspace, robot.packages))
    except ModelError as error:
        yield ("robot", "srdf"), str(error)


def _srdf_file(name: str, packages: Packages) -> Path:
    if name.endswith(".xacro"):
        expanded = name.removesuffix(".xacro")
        raise ModelError(f"an SRDF must be expanded: run xacro {name} > {expanded}, and name '{expanded}'")
    try:
        if "://" in name:
            return find_model_file(name, packages.workspace.directory / "scenario", packages).path
        return packages.workspace.file(name)
    except (PathError, PackageError) as error:
        place = packages.workspace.directory / name
        hint = "" if "://" in name or place.exists() else similar_name(place)
        raise ModelError(f"{error}{hint}") from None


def _path(name: str, packages: Packages) -> Path:
    place = packages.workspace.directory / name
    if "/" not in name and "." not in name and not is_folder(place):
        built_in = f"unknown robot '{name}'{did_you_mean(name, BUILT_IN)}"
        raise ModelError(f"{built_in}, or the path of a .urdf, .xacro, .sdf or .xml file")

    workspace = packages.workspace
    try:
        if "://" in name or is_model_folder(workspace.directory / name):
            return find_model_file(name, workspace.directory / "scenario", packages).path
        return workspace.file(name)
    except (PathError, PackageError) as error:
        raise ModelError(f"{error}{'' if '://' in name else _next_step(name, place, packages)}") from None


def _next_step(name: str, place: Path, packages: Packages) -> str:
    """Return the end of a message about a path that is no model file: a similar name, or the files in the folder."""
    try:
        path = place.resolve()
        if not packages.may_read(path):
            return ""
        if not path.exists():
            return similar_name(path)
        files = model_files_in(path)
    except (OSError, ValueError, RuntimeError):
        return ""
    if not files:
        return ""
    return f"; the model files in it are: {', '.join(files)}; write 'model: {name.rstrip('/')}/{files[0]}'"


def with_srdf(model: RobotModel, path: Path) -> RobotModel:
    """Return a model with its SRDF, and notes on the parts that are not read. Raises ModelError."""
    document = read_srdf_text(path)
    kept, harmless = without_harmless(unread_parts_of_srdf(document))
    return replace(
        model,
        srdf=read_srdf(document, model),
        findings=(*model.findings, *document.findings, *kept),
        harmless=(*model.harmless, *harmless),
    )


_MAX_PROBLEMS: Final = 100


def read_srdf(document: ModelDocument, model: RobotModel) -> Srdf:
    """Read an SRDF and check it against its model. Raises RefusedModel with all problems."""
    reader = _Reader(document, model)
    srdf = reader.read()
    if reader.problems:
        raise RefusedModel(reader.problems[:_MAX_PROBLEMS])
    return srdf


def read_srdf_text(path: Path) -> ModelDocument:
    """Read an SRDF without its model. Raises ModelError."""
    document = read_document(path)
    if document.root.tag != "robot":
        place = document.places[document.root]
        raise ModelError(f"an SRDF begins with <robot name=...>, found <{document.root.tag}>", place)
    if any(True for _ in document.elements("link", "joint[@type]")):
        place = document.places[next(document.elements("link", "joint[@type]"))]
        raise ModelError("this is a URDF, which has links and joints; robot.srdf names the .srdf file beside it", place)
    return document


class _Reader:
    """Reads one document; `problems` grows meanwhile."""

    def __init__(self, document: ModelDocument, model: RobotModel) -> None:
        self._document, self._model = document, model
        self.problems: list[Problem] = []
        self._hinted = FirstFew()
        self._above = {joint.child: joint for joint in model.joints}
        self._groups = {element.get("name", ""): element for element in document.elements("group")}
        # MoveIt's <virtual_joint> joins the robot to the world.
        self._virtual = {element.get("name", "") for element in document.elements("virtual_joint")}
        self._parts: dict[str, set[str]] = {}
        for joint in model.joints:
            for whole in filter(None, (joint.ball, joint.series)):
                self._parts.setdefault(whole, set()).add(joint.name)

    def read(self) -> Srdf:
        name, root = self._document.root.get("name"), self._document.root
        if name is not None and name != self._model.name:
            problem = f"this SRDF is of robot '{name}', and the model is '{self._model.name}'"
            self._note(root, f"{problem}; name the SRDF of the model, or correct <robot name=...>")
        order = {joint.name: place for place, joint in enumerate(self._model.joints)}
        groups = self._joints_of_groups()
        self._check_states(groups)
        for passive in self._document.elements("passive_joint"):
            self._joint(passive, "name")
        return Srdf(
            {name: tuple(sorted(joints, key=order.__getitem__)) for name, joints in groups.items()},
            frozenset(self._pairs()),
        )

    def _joints_of_groups(self) -> dict[str, set[str]]:
        """Return the joints of each group: its own, and the joints of its links, chains and groups."""
        inner = {name: dict.fromkeys(self._inner_groups(element)) for name, element in self._groups.items()}
        try:
            order = [*TopologicalSorter(inner).static_order()]
        except CycleError as error:
            # Each group of the cycle is followed by the group that contains it.
            inside, outside = error.args[1][:2]
            part = next(group for group in self._groups[outside].iterfind("group") if group.get("name", "") == inside)
            self._note(part, f"group '{inside}' contains itself; remove it from group '{outside}'")
            return {name: set() for name in self._groups}
        joints: dict[str, set[str]] = {}
        # A group stands after all groups in it.
        for name in order:
            joints[name] = self._own_joints(self._groups[name]).union(*(joints[group] for group in inner[name]))
        return {name: joints[name] for name in self._groups}

    def _inner_groups(self, group: Element) -> Iterator[str]:
        for part in group.iterfind("group"):
            name = part.get("name", "")
            if name in self._groups:
                yield name
            else:
                self._note(part, f"there is no group '{name}'{self._hint(name, self._groups)}")

    def _own_joints(self, group: Element) -> set[str]:
        joints = set[str]()
        for part in group:
            if part.tag == "joint":
                joints |= self._joint(part, "name")
            elif part.tag == "link":
                link = self._link(part, "name")
                joints |= {self._above[link].name} if link in self._above else set()
            elif part.tag == "chain":
                joints |= self._chain(part)
        return joints

    def _joint(self, element: Element, attribute: str) -> set[str]:
        name = element.get(attribute, "")
        if name in self._model.joints_by_name:
            return {name}
        parts = self._parts.get(name, set())
        if not parts and name not in self._virtual:
            hint = self._hint(name, self._model.joints_by_name)
            self._note(element, f"the model has no joint '{name}'{hint}")
        return parts

    def _link(self, element: Element, attribute: str) -> str:
        name = element.get(attribute, "")
        if name not in self._model.links_by_name:
            self._note(element, f"the model has no link '{name}'{self._hint(name, self._model.links_by_name)}")
        return name

    def _chain(self, element: Element) -> set[str]:
        base, tip = self._link(element, "base_link"), self._link(element, "tip_link")
        joints, link = set[str](), tip
        while link != base and link in self._above:
            joints.add(self._above[link].name)
            link = self._above[link].parent
        links = self._model.links_by_name
        if link != base and base in links and tip in links:
            problem = f"no chain of joints leads from link '{base}' to link '{tip}'"
            self._note(element, f"{problem}; swap them, or correct one")
            return set()
        return joints

    def _check_states(self, groups: Mapping[str, set[str]]) -> None:
        for element in self._document.elements("group_state"):
            group = element.get("group", "")
            if group not in groups:
                self._note(element, f"there is no group '{group}'{self._hint(group, groups)}")
            for part in element.iterfind("joint"):
                written = part.get("value", "")
                for name in self._joint(part, "name"):
                    if not is_numbers(written, 1):
                        self._note(part, f"value=\"{written}\" of joint '{name}': expected a finite number in rad or m")

    def _pairs(self) -> Iterator[frozenset[str]]:
        enabled = {self._pair(element) for element in self._document.elements("enable_collisions")}
        for element in self._document.elements("disable_collisions"):
            yield self._pair(element)
        for element in self._document.elements("disable_default_collisions"):
            link = self._link(element, "link")
            yield from {frozenset((link, other)) for other in self._model.links_by_name if other != link} - enabled

    def _pair(self, element: Element) -> frozenset[str]:
        return frozenset((self._link(element, "link1"), self._link(element, "link2")))

    def _hint(self, name: str, allowed: Mapping[str, object]) -> str:
        return did_you_mean(name, allowed) if self._hinted.one_more() else ""

    def _note(self, element: Element, message: str) -> None:
        if len(self.problems) <= _MAX_PROBLEMS:
            problem = Problem(self._document.places[element], message)
            if problem not in self.problems:
                self.problems.append(problem)

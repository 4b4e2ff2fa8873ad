"""Read SDF files, and compose a model from its nested and included models, as a tree of scopes with names.

The input is not trusted, and is read in the caller's process, within limits on the size of the whole model.

Files below version 1.7 get the meaning of version 1.7, as libsdformat converts them. It renames the parts that changed
and then reads the file by the newest specification. So an attribute of a newer version, such as `expressed_in` or
`relative_to`, also counts in an older file. The changes (sdformat.org/spec):

- up to 1.4, an axis is in the frame of the joint's model; 1.5 and 1.6 have <use_parent_model_frame> for that; since 1.7
  it is <xyz expressed_in="__model__">. The flag comes before `expressed_in`.
- `frame` of a <pose> is called `relative_to` since 1.7.

From outside, names in a nested model are `model::name`. The parts of a model that is included with merge="true" belong
to the outer model (SDFormat's proposals on composition and merge-include).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Final, Literal, get_args
from urllib.parse import unquote
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core.records import dataclass, field, replace
from sim_action.core.wording import shown
from sim_action.robot.audit.joints import MAX_NAME_BYTES
from sim_action.robot.documents import sdf_elements
from sim_action.robot.documents.packages import PackageError, Packages, Version, find_model_file, parsed_version
from sim_action.robot.documents.sdf_elements import MODEL_FRAME
from sim_action.robot.documents.xml_document import MAX_BYTES, MAX_ELEMENTS, ModelDocument, read_document
from sim_action.robot.model.findings import finding, refuse_errors

_OLDEST_VERSION: Final[Version] = (1, 3)
_MAX_INCLUDES: Final = 500


@dataclass(frozen=True, eq=False)
class SdfFile:
    """A file with one <model> in it."""

    path: Path
    version: Version
    model: Element
    document: ModelDocument


def read_sdf_file(path: Path, document: ModelDocument | None = None) -> SdfFile:
    """Read a file that describes one model. Raises ModelError."""
    document = document or read_document(path)
    root = document.root
    if root.tag != "sdf":
        message = f"the root element of an SDF file is <sdf>, but this file has <{root.tag}>"
        hint = "; an SDF file can include only SDF: convert the file" if root.tag == "robot" else ""
        document.refuse("not-a-robot", root, message + hint)
    version = sdf_version(document)
    document = upgraded(document, version)
    return SdfFile(path, version, _only_model(document), document)


def sdf_version(document: ModelDocument) -> Version:
    """Return the version that a document states. Raises ModelError if it is missing or not supported."""
    stated = document.root.get("version")
    if stated is None:
        document.refuse("missing-part", document.root, "<sdf> has no attribute 'version'")
    version = parsed_version(stated)
    if version < _OLDEST_VERSION:
        message = f"SDF {shown(stated)} is not supported; versions 1.3 to 1.12 are: convert it with 'gz sdf -p'"
        document.refuse("not-a-robot", document.root, message)
    return version


def _only_model(document: ModelDocument) -> Element:
    root = document.root
    models = root.findall("model")
    world = root.find("world")
    if world is not None:
        names = ", ".join(f"'{model.get('name', '')}'" for model in world.findall("model")) or "none"
        message = f"this SDF describes a world with the models {names}; name file and robot in the section world"
        document.refuse("not-a-robot", world, f"{message}: world: {{file: ..., robot: NAME}}")
    if not models:
        document.refuse("not-a-robot", root, "this SDF has no <model>; one is required")
    if len(models) > 1:
        names = ", ".join(f"'{model.get('name', '')}'" for model in models)
        message = f"this SDF has {len(models)} models: {names}; a robot must be one model, which may contain others"
        document.refuse("not-a-robot", models[1], message)
    return models[0]


class ModelTooLarge(Exception):
    """The files of a model exceed a size limit; reading stops."""


class SizeBudget:
    """Reads the files of one model, each once, and counts includes, elements and bytes."""

    def __init__(self, document: ModelDocument) -> None:
        self._read: dict[Path, ModelDocument] = {}
        self._includes = 0
        self._elements = len(document.places)
        self._bytes = document.size

    def begin_include(self) -> None:
        """Count one more include. Raises ModelTooLarge."""
        self._includes += 1
        if self._includes > _MAX_INCLUDES:
            raise ModelTooLarge(f"a model may include at most {_MAX_INCLUDES} others")

    def read(self, path: Path) -> ModelDocument:
        """Return a file, read at the first call. Raises ModelError, ModelTooLarge."""
        if path not in self._read:
            document = read_document(path)
            self.count_elements(document)
            self._bytes += document.size
            if self._bytes > MAX_BYTES:
                raise ModelTooLarge(
                    f"a model may have at most {MAX_BYTES // 1_000_000} MB, all included files together"
                )
            self._read[path] = document
        return self._read[path]

    def count_elements(self, document: ModelDocument) -> None:
        """Count the elements of a document that is used once more. Raises ModelTooLarge."""
        self._elements += len(document.places)
        if self._elements > MAX_ELEMENTS:
            raise ModelTooLarge(f"a model may have at most {MAX_ELEMENTS:,} elements, all included files together")


PARENT_MODEL_FLAG: Final = "use_parent_model_frame"  # an element of <axis> in SDF 1.5 and 1.6
FRAMES_NAMED: Final[Version] = (1, 7)  # from this version on, `relative_to` and `expressed_in` name frames
_AXES_IN_MODEL_FRAME: Final[Version] = (1, 4)
_TRUE: Final = frozenset({"true", "1"})


def upgraded(document: ModelDocument, version: Version) -> ModelDocument:
    """Return a document of any version with the meaning of SDF 1.7 or newer. It changes elements in place."""
    if version >= FRAMES_NAMED:
        return document
    # Copy `frame` of each <pose> to `relative_to`. A name that exists nowhere is left: Gazebo ignored it.
    names = {MODEL_FRAME, "world", *(element.get("name") for element in document.root.iter())}
    names |= {(name.text or "").strip() for name in document.root.iterfind(".//include/name")}
    # The name of a model that is included without one is in its own file.
    is_any = any(include.find("name") is None for include in document.root.iter("include"))
    for pose in document.root.iter("pose"):
        frame = pose.get("frame")
        if frame and (is_any or frame.partition("::")[0] in names):
            pose.set("relative_to", frame)
    added = dict(_express_axes(document.root, version))
    places = {element: document.places[axis] for element, axis in added.items()}
    return replace(document, places={**document.places, **places}) if places else document


def _express_axes(root: Element, version: Version) -> Iterator[tuple[Element, Element]]:
    """Set `expressed_in` of axes in the frame of their model. Yield each <xyz> that is added, with its <axis>."""
    for joint in root.iter("joint"):
        for axis in (*joint.findall("axis"), *joint.findall("axis2")):
            flag = axis.find(PARENT_MODEL_FLAG)
            stated = version <= _AXES_IN_MODEL_FRAME if flag is None else (flag.text or "").strip().lower() in _TRUE
            if not stated:
                continue
            xyz = axis.find("xyz")
            if xyz is None:
                xyz = ET.SubElement(axis, "xyz")
                xyz.text = "0 0 1"
                yield xyz, axis
            xyz.set("expressed_in", MODEL_FRAME)


Kind = Literal["link", "model", "frame", "joint"]
SEPARATOR: Final = "::"
_MAX_DEPTH: Final = 50
_MAX_SHOWN_CHARS: Final = 40
_CHANGES: Final = "experimental:params"
_KINDS: Final[tuple[Kind, ...]] = get_args(Kind)
_UNIQUE_NAMES: Final[Version] = (1, 7)  # from this version on, names are unique across kinds


@dataclass(frozen=True, eq=False)
class Entry:
    """A link, joint, frame or model: an element with a frame."""

    kind: Kind
    name: str
    element: Element
    owner: Scope  # the scope in which the references of the element are resolved
    pose: Element | None  # the <pose> that places it; None if there is none
    scope: Scope | None = None  # the inside of a model; None for other kinds

    @property
    def flat_model(self) -> Element:
        """A new <model> with the plugins and links of a model and of all models in it; links have their names in it."""
        assert self.scope is not None
        model = Element("model", self.scope.element.attrib)
        model.extend([*self.scope.plugins(), *self.included_plugins])
        for link in self.scope.all_of("link"):
            flat = ET.SubElement(model, "link", name=link.full_name.removeprefix(self.scope.prefix))
            flat.extend(link.element)
        return model

    @property
    def included_plugins(self) -> list[Element]:
        """The plugins of the <include> of a model."""
        return self.element.findall("plugin") if self.element.tag == "include" else []

    @property
    def full_name(self) -> str:
        """The name as seen from the outermost model."""
        return self.owner.prefix + self.name


@dataclass(eq=False)
class Scope:
    """The inside of a <model>; `members` and `names` grow while it is read."""

    file: SdfFile
    prefix: str  # the prefix of all names in it, as seen from the outermost model
    element: Element
    placement_frame: str  # the frame in it that the model's pose places; empty: the model's own frame
    static: bool  # True if nothing in it moves
    parent: Scope | None  # the scope around it; None for the outermost model
    pose: Element | None  # the <pose> that places it; None if there is none
    members: list[Entry] = field(default_factory=list)  # its links, joints, frames and models, in the order of the file
    names: dict[str, Entry] = field(default_factory=dict)  # name -> the entry that it refers to

    def all_of(self, kind: Kind) -> Iterator[Entry]:
        """Yield all entries of a kind, in it and below, in the order of the file."""
        for entry in self.members:
            if entry.kind == kind:
                yield entry
            if entry.scope is not None:
                yield from entry.scope.all_of(kind)

    def scopes(self) -> Iterator[Scope]:
        """Yield this scope and all scopes below it."""
        yield self
        for entry in self.members:
            if entry.scope is not None:
                yield from entry.scope.scopes()

    def plugins(self) -> Iterator[Element]:
        """Yield the plugins of the models, then the plugins of their <include> elements."""
        includes = (entry.element for entry in self.all_of("model") if entry.element.tag == "include")
        for holder in (*(scope.element for scope in self.scopes()), *includes):
            yield from holder.findall("plugin")

    def innermost(self, name: str) -> tuple[Scope, str]:
        """Return the innermost scope that the parts of a name lead to, and the rest of the name."""
        head, separator, rest = name.partition(SEPARATOR)
        model = self.names.get(head)
        return model.scope.innermost(rest) if separator and model and model.scope else (self, name)

    def find(self, name: str) -> Entry | None:
        """Return the entry with a name, else None. In old files, the name of a link may contain `::`."""
        if name in self.names:
            return self.names[name]
        head, separator, rest = name.partition(SEPARATOR)
        model = self.names.get(head)
        if not separator or model is None or model.scope is None:
            return None
        return model if rest == sdf_elements.MODEL_FRAME else model.scope.find(rest)


class Assembly:
    """The composition of one model. Problems become findings in `notes`.

    `file`: the file with the outermost model; `static`: True if nothing in it moves, even if it states otherwise.
    """

    def __init__(self, file: SdfFile, packages: Packages, notes: sdf_elements.Notes, *, static: bool = False) -> None:
        self._static = static
        self.packages, self.notes = packages, notes
        self._file = file
        self._budget = SizeBudget(file.document)
        self._files: dict[Path, SdfFile] = {}

    def read(self) -> Scope:
        """Return the outermost model with all models below it. Raises RefusedModel if it is too large."""
        file = self._file
        self.notes.places.update(file.document.places)
        model = file.model
        static = self._static or self.notes.attempt(lambda model: sdf_elements.flag_of(model, "static"), model) or False
        scope = Scope(file, "", model, model.get("placement_frame", ""), static, None, model.find("pose"))
        return self._filled(scope, (file.path,))

    def _filled(self, scope: Scope, path: tuple[Path, ...]) -> Scope:
        """Fill a scope. `path`: the files that are open, each one included by the one before it."""
        members: Mapping[str, Callable[[Element], None]] = {
            **dict.fromkeys(("link", "joint", "frame"), lambda element: self._add(scope, element)),
            "model": lambda element: self._nest(scope, element, path),
            "include": lambda element: self._include(scope, element, path),
        }
        for element in scope.element:
            if element.tag in members:
                self.notes.attempt(members[element.tag], element)
        return scope

    def _add(self, scope: Scope, element: Element) -> None:
        name = _named(element, scope.prefix)
        kind: Kind = next(kind for kind in _KINDS if kind == element.tag)
        self._enter(scope, Entry(kind, name, element, scope, element.find("pose")))

    def _nest(self, scope: Scope, element: Element, path: tuple[Path, ...]) -> None:
        name = _named(element, scope.prefix)
        pose = element.find("pose")
        static = scope.static or sdf_elements.flag_of(element, "static")
        frame = element.get("placement_frame", "")
        inner = Scope(scope.file, f"{scope.prefix}{name}{SEPARATOR}", element, frame, static, scope, pose)
        self._enter(scope, Entry("model", name, element, scope, pose, self._checked(inner, path)))

    def _include(self, scope: Scope, include: Element, path: tuple[Path, ...]) -> None:
        file = self._included(scope, include)
        changes = include.find(_CHANGES)
        if changes is not None:
            message = f"<{_CHANGES}> is not supported; if allowed, the included model is not changed"
            self.notes.add("unsupported-part", changes, message)
        if file.path in path:
            names = " -> ".join(path.name for path in (*path[path.index(file.path) :], file.path))
            raise sdf_elements.SdfProblem("include-loop", include, f"the model includes itself: {names}")
        if sdf_elements.flag_attribute(include, "merge"):
            self._merge(scope, include, file, path)
            return
        name = _short(include, scope.prefix, sdf_elements.text_of(include, "name")) or _named(file.model, scope.prefix)
        static = scope.static or sdf_elements.flag_of(
            file.model if include.find("static") is None else include, "static"
        )
        pose, frame = _placement(include, file.model)
        inner = Scope(file, f"{scope.prefix}{name}{SEPARATOR}", file.model, frame, static, scope, pose)
        self._enter(scope, Entry("model", name, include, scope, pose, self._checked(inner, (*path, file.path))))

    def _merge(self, scope: Scope, include: Element, file: SdfFile, path: tuple[Path, ...]) -> None:
        """Add the parts of an included model to the outer model; an unnamed entry keeps the frame of that model."""
        pose, frame = _placement(include, file.model)
        inner = Scope(file, scope.prefix, file.model, frame, scope.static, scope, pose)
        scope.members.append(Entry("model", "", include, scope, pose, self._checked(inner, (*path, file.path))))
        for member in inner.names.values():
            self._name(scope, member, include)

    def _checked(self, scope: Scope, path: tuple[Path, ...]) -> Scope:
        """Fill a scope, unless it is nested too deeply."""
        depth, outer = 0, scope.parent
        while outer is not None:
            depth, outer = depth + 1, outer.parent
        if depth > _MAX_DEPTH:
            raise sdf_elements.SdfProblem("include-loop", scope.element, f"more than {_MAX_DEPTH} models are nested")
        return self._filled(scope, path)

    def _included(self, scope: Scope, include: Element) -> SdfFile:
        try:
            return self._read_within_budget(scope, include)
        except ModelTooLarge as error:
            # This problem comes first: the number of problems that are reported is limited.
            problem = finding("include-loop", str(error), self.notes.places[include])
            refuse_errors([problem, *self.notes.findings])
            raise AssertionError("a fatal finding raises") from None

    def _read_within_budget(self, scope: Scope, include: Element) -> SdfFile:
        self._budget.begin_include()
        reference = _local((sdf_elements.needed(include, "uri").text or "").strip())
        if not reference:
            raise sdf_elements.SdfProblem("missing-part", include, "<include> has an empty <uri>")
        try:
            file = find_model_file(reference, scope.file.path, self.packages, self._budget.read)
        except PackageError as error:
            rule = "missing-include" if error.rule == "missing-file" else error.rule
            raise sdf_elements.SdfProblem(rule, include, str(error)) from None
        for note in file.notes:
            self.notes.add(note.rule, include, note.text)
        return self._opened(file.path)

    def _opened(self, path: Path) -> SdfFile:
        file = self._files.get(path)
        if file is not None:
            self._budget.count_elements(file.document)
            return file
        file = self._files[path] = read_sdf_file(path, self._budget.read(path))
        self.notes.places.update(file.document.places)
        self.notes.findings += file.document.findings
        return file

    def _enter(self, scope: Scope, entry: Entry) -> None:
        scope.members.append(entry)
        self._name(scope, entry, entry.element)

    def _name(self, scope: Scope, entry: Entry, source: Element) -> None:
        taken = scope.names.get(entry.name)
        if taken is None:
            scope.names[entry.name] = entry
        elif taken.kind == entry.kind or scope.file.version >= _UNIQUE_NAMES:
            kinds = f"two {entry.kind}s" if taken.kind == entry.kind else f"a {taken.kind} and a {entry.kind}"
            raise sdf_elements.SdfProblem(
                "duplicate-name", source, f"{kinds} have the name '{entry.name}'; names must be unique"
            )
        elif _KINDS.index(entry.kind) < _KINDS.index(taken.kind):
            scope.names[entry.name] = entry


def _local(reference: str) -> str:
    """Return the local address of a model of Gazebo Fuel, which is not downloaded: `model://NAME`."""
    if not reference.startswith(("http://", "https://")):
        return reference
    name = unquote(reference).partition("/models/")[2].partition("/")[0]
    return f"model://{name}" if name else reference


def _placement(include: Element, model: Element) -> tuple[Element | None, str]:
    """Return the pose of an included model, and the frame that it places; <include> overrides the model."""
    stated = include.find("pose")
    frame = sdf_elements.text_of(include, "placement_frame")
    if frame and stated is None:
        raise sdf_elements.SdfProblem("missing-part", include, "<include> has <placement_frame> but no <pose>; add one")
    return model.find("pose") if stated is None else stated, frame or model.get("placement_frame", "")


def _named(element: Element, prefix: str) -> str:
    name = element.get("name", "")
    if not name:
        raise sdf_elements.SdfProblem("missing-part", element, f"<{element.tag}> has no attribute 'name'")
    return _short(element, prefix, name)


def _short(element: Element, prefix: str, name: str) -> str:
    """Return a name unless it is too long, together with the names of the models around it."""
    if len(prefix) + len(name) > MAX_NAME_BYTES:
        full, size = prefix + name[:_MAX_SHOWN_CHARS], f"the name has {len(prefix) + len(name):,} characters"
        message = f"{size}, '{full[:_MAX_SHOWN_CHARS]}...'; at most {MAX_NAME_BYTES} are allowed"
        raise sdf_elements.SdfProblem("bad-name", element, message)
    return name

"""Compose an SDF model from its nested and included models, as a tree of scopes with names.

From outside, names in a nested model are `model::name`. The parts of a model that is included with merge="true" belong
to the outer model (SDFormat's proposals on composition and merge-include).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Final, Literal, get_args
from urllib.parse import unquote
from xml.etree.ElementTree import Element

from sim_action.core.records import dataclass, field
from sim_action.robot.audit.kinematic_tree import MAX_NAME_BYTES
from sim_action.robot.documents import sdf_elements
from sim_action.robot.documents.packages import PackageError, Packages, Version, find_model_file
from sim_action.robot.model.findings import finding, refuse_errors
from sim_action.robot.reading.sdf.sdf_files import ModelTooLarge, SdfFile, SizeBudget, read_sdf_file

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
    def whole_model(self) -> Element:
        """A new <model> with all parts of a model, and the plugins of the <include> that names it."""
        assert self.scope is not None
        model = Element("model", self.scope.element.attrib)
        model.extend([*self.scope.element, *self.included_plugins])
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

    `file`: the file with the outermost model; `static`: True if nothing in it moves, whatever it states.
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
        name, pose = _named(element, scope.prefix), element.find("pose")
        static = scope.static or sdf_elements.flag_of(element, "static")
        frame = element.get("placement_frame", "")
        inner = Scope(scope.file, f"{scope.prefix}{name}{SEPARATOR}", element, frame, static, scope, pose)
        self._enter(scope, Entry("model", name, element, scope, pose, self._checked(inner, path)))

    def _include(self, scope: Scope, include: Element, path: tuple[Path, ...]) -> None:
        file = self._included(scope, include)
        self._note_changes(include)
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

    def _note_changes(self, include: Element) -> None:
        changes = include.find(_CHANGES)
        if changes is not None:
            message = f"<{_CHANGES}> is not supported; if allowed, the included model is not changed"
            self.notes.add("unsupported-part", changes, message)

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
            found = find_model_file(reference, scope.file.path, self.packages, self._budget.read)
        except PackageError as error:
            rule = "missing-include" if error.rule == "missing-file" else error.rule
            raise sdf_elements.SdfProblem(rule, include, str(error)) from None
        for note in found.notes:
            self.notes.add(note.rule, include, note.text)
        return self._opened(found.path)

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
    stated, frame = include.find("pose"), sdf_elements.text_of(include, "placement_frame")
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

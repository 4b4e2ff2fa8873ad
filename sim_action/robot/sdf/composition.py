"""Models of SDF as scopes: what can be named inside each, with nested and included ones below it.

Names of a nested model are seen from outside as `model::name`; what is in a model that was included with merge="true"
is seen as the outer model's own (SDFormat's proposals on composition and merge-include).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal, get_args
from xml.etree.ElementTree import Element

from sim_action.robot.audit.kinematic_tree import LONGEST_NAME
from sim_action.robot.audit.rules import finding, refuse_errors
from sim_action.robot.packages import PackageError, Packages, Version, find_model_file
from sim_action.robot.sdf.elements import Notes, SdfProblem, flag_of, needed, says_yes, text_of
from sim_action.robot.sdf.files import Budget, OverBudget, SdfFile, read_sdf_file

Kind = Literal["link", "model", "frame", "joint"]

MODEL_FRAME: Final = "__model__"
SEPARATOR: Final = "::"


@dataclass(frozen=True, eq=False)
class Entry:
    """Something that has a frame.

    Attributes:
        owner: the model in whose scope the element's references are looked up.
        pose: the <pose> that places it, if there is one.
        scope: of a model: what is inside it.
    """

    kind: Kind
    name: str
    element: Element
    owner: Scope
    pose: Element | None
    scope: Scope | None = None

    @property
    def full_name(self) -> str:
        """The name as it is seen from the outermost model."""
        return self.owner.prefix + self.name


@dataclass(eq=False)
class Scope:
    """A <model> from inside; `members` and `names` grow while it is read.

    Attributes:
        prefix: of all names in it, seen from the outermost model.
        placement_frame: which of its frames the model's pose places; empty: its own.
        static: whether nothing in it moves.
        parent: the model that it is nested in.
        pose: the <pose> that places it, if there is one.
        members: links, joints, frames and models in it, in the order of the file.
        names: what can be referred to in it.
    """

    file: SdfFile
    prefix: str
    element: Element
    placement_frame: str
    static: bool
    parent: Scope | None
    pose: Element | None
    members: list[Entry] = field(default_factory=list)
    names: dict[str, Entry] = field(default_factory=dict)

    def all_of(self, kind: Kind) -> Iterator[Entry]:
        """Everything of a kind in it and below, in the order of the file."""
        for entry in self.members:
            if entry.kind == kind:
                yield entry
            if entry.scope is not None:
                yield from entry.scope.all_of(kind)

    def scopes(self) -> Iterator[Scope]:
        """This one, and all below it."""
        yield self
        for entry in self.members:
            if entry.scope is not None:
                yield from entry.scope.scopes()

    def innermost(self, name: str) -> tuple[Scope, str]:
        """The model that a name leads into, as far as it leads, and what is left of the name."""
        head, separator, rest = name.partition(SEPARATOR)
        model = self.names.get(head)
        return model.scope.innermost(rest) if separator and model and model.scope else (self, name)

    def find(self, name: str) -> Entry | None:
        """What a name leads to; links of old files may have `::` in their own name."""
        if name in self.names:
            return self.names[name]
        head, separator, rest = name.partition(SEPARATOR)
        model = self.names.get(head)
        if not separator or model is None or model.scope is None:
            return None
        return model if rest == MODEL_FRAME else model.scope.find(rest)


_DEEPEST: Final = 50
_SHOWN: Final = 40
_CHANGES: Final = "experimental:params"
_KINDS: Final[tuple[Kind, ...]] = get_args(Kind)
_UNIQUE_NAMES: Final[Version] = (1, 7)
"""From here on a name stands for one thing, whatever its kind."""


class Assembly:
    """One model while it is put together; what is wrong is noted.

    Args:
        file: with the outermost model.
    """

    def __init__(self, file: SdfFile, packages: Packages, notes: Notes) -> None:
        self.packages, self.notes = packages, notes
        self._file = file
        self._budget = Budget(file.document)
        self._files: dict[Path, SdfFile] = {}

    def read(self) -> Scope:
        """The outermost model and all below it. Raises RefusedModel if that is too much to go on with."""
        file = self._file
        self.notes.places.update(file.document.places)
        model = file.model
        static = self.notes.attempt(lambda model: flag_of(model, "static"), model) or False
        scope = Scope(file, "", model, model.get("placement_frame", ""), static, None, model.find("pose"))
        return self._filled(scope, (file.path,))

    def _filled(self, scope: Scope, path: tuple[Path, ...]) -> Scope:
        """`path`: the files that are open, each included by the one before it."""
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
        static = scope.static or flag_of(element, "static")
        frame = element.get("placement_frame", "")
        inner = Scope(scope.file, f"{scope.prefix}{name}{SEPARATOR}", element, frame, static, scope, pose)
        self._enter(scope, Entry("model", name, element, scope, pose, self._checked(inner, path)))

    def _include(self, scope: Scope, include: Element, path: tuple[Path, ...]) -> None:
        file = self._included(scope, include)
        self._tell_changes(include)
        if file.path in path:
            names = " -> ".join(path.name for path in (*path[path.index(file.path) :], file.path))
            raise SdfProblem("include-loop", include, f"a model that includes itself: {names}")
        if says_yes(include, "merge"):
            self._merge(scope, include, file, path)
            return
        name = _short(include, scope.prefix, text_of(include, "name")) or _named(file.model, scope.prefix)
        static = scope.static or flag_of(file.model, "static") or flag_of(include, "static")
        pose, frame = _placement(include, file.model)
        inner = Scope(file, f"{scope.prefix}{name}{SEPARATOR}", file.model, frame, static, scope, pose)
        self._enter(scope, Entry("model", name, include, scope, pose, self._checked(inner, (*path, file.path))))

    def _tell_changes(self, include: Element) -> None:
        changes = include.find(_CHANGES)
        if changes is not None:
            message = f"<{_CHANGES}> would change what is included; let go, it is included as it is"
            self.notes.tell("unsupported-part", changes, message)

    def _merge(self, scope: Scope, include: Element, file: SdfFile, path: tuple[Path, ...]) -> None:
        """What is in the included model becomes the outer one's own; where it was is told by its model's frame."""
        pose, frame = _placement(include, file.model)
        inner = Scope(file, scope.prefix, file.model, frame, scope.static, scope, pose)
        scope.members.append(Entry("model", "", include, scope, pose, self._checked(inner, (*path, file.path))))
        for member in inner.names.values():
            self._name(scope, member, include)

    def _checked(self, scope: Scope, path: tuple[Path, ...]) -> Scope:
        """The scope with all that is in it, if it is not too deep."""
        depth, outer = 0, scope.parent
        while outer is not None:
            depth, outer = depth + 1, outer.parent
        if depth > _DEEPEST:
            raise SdfProblem("include-loop", scope.element, f"more than {_DEEPEST} models inside each other")
        return self._filled(scope, path)

    def _included(self, scope: Scope, include: Element) -> SdfFile:
        try:
            return self._paid(scope, include)
        except OverBudget as error:
            # First, as what was found before it may be more than is told.
            problem = finding("include-loop", str(error), self.notes.places[include])
            refuse_errors([problem, *self.notes.findings])
            raise AssertionError("what is fatal is refused") from None

    def _paid(self, scope: Scope, include: Element) -> SdfFile:
        self._budget.begin_include()
        reference = (needed(include, "uri").text or "").strip()
        if not reference:
            raise SdfProblem("missing-part", include, "<include> with an empty <uri>")
        try:
            found = find_model_file(reference, scope.file.path, self.packages, self._budget.read)
        except PackageError as error:
            rule = "missing-include" if error.rule == "missing-file" else error.rule
            raise SdfProblem(rule, include, str(error)) from None
        if found.warning:
            self.notes.tell("several-packages", include, found.warning)
        return self._opened(found.path)

    def _opened(self, path: Path) -> SdfFile:
        file = self._files.get(path)
        if file is not None:
            self._budget.spend(file.document)
            return file
        file = self._files[path] = read_sdf_file(path, self._budget.read(path))
        self.notes.places.update(file.document.places)
        return file

    def _enter(self, scope: Scope, entry: Entry) -> None:
        scope.members.append(entry)
        self._name(scope, entry, entry.element)

    def _name(self, scope: Scope, entry: Entry, source: Element) -> None:
        taken = scope.names.get(entry.name)
        if taken is None:
            scope.names[entry.name] = entry
        elif taken.kind == entry.kind or scope.file.version >= _UNIQUE_NAMES:
            kinds = f"a second {entry.kind}" if taken.kind == entry.kind else f"a {taken.kind} and a {entry.kind}"
            raise SdfProblem("duplicate-name", source, f"{kinds} named '{entry.name}'")
        elif _KINDS.index(entry.kind) < _KINDS.index(taken.kind):
            scope.names[entry.name] = entry


def _placement(include: Element, model: Element) -> tuple[Element | None, str]:
    """The pose of an included model, and which of its frames it is meant for: what <include> says counts for more."""
    stated, frame = include.find("pose"), text_of(include, "placement_frame")
    if frame and stated is None:
        raise SdfProblem("missing-part", include, "<include> with <placement_frame> and without <pose>")
    return model.find("pose") if stated is None else stated, frame or model.get("placement_frame", "")


def _named(element: Element, prefix: str) -> str:
    name = element.get("name", "")
    if not name:
        raise SdfProblem("missing-part", element, f"<{element.tag}> without 'name'")
    return _short(element, prefix, name)


def _short(element: Element, prefix: str, name: str) -> str:
    """A name that is none too long: everything in a model has the model's before its own."""
    if len(prefix) + len(name) > LONGEST_NAME:
        size = f"a name of {len(prefix) + len(name):,} characters"
        message = f"{size}, '{(prefix + name[:_SHOWN])[:_SHOWN]}...'; the engine takes {LONGEST_NAME}"
        raise SdfProblem("bad-name", element, message)
    return name

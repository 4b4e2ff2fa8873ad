"""Models of SDF as scopes: what can be named inside each, with nested and included ones below it.

Names of a nested model are seen from outside as `model::name`; what is in a model that was included with merge="true"
is seen as the outer model's own (SDFormat's proposals on composition and merge-include).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, Literal
from xml.etree.ElementTree import Element

from sim_action.robot.sdf.files import SdfFile

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

"""The elements of MJCF that may name a file, those that are removed, and limits on numbers that demand memory.

A format that is read later gets a row in `FILES`. An attribute whose name looks like that of a file, and that has no
row, is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Final, Literal, NoReturn
from xml.etree.ElementTree import Element

from sim_action.core.errors import Location, Problem, RefusedModel
from sim_action.core.records import dataclass
from sim_action.core.wording import shown
from sim_action.robot.documents.part_table import ALL, part_table
from sim_action.robot.documents.xml_document import MAX_ELEMENTS

Use = Literal["include", "model", "mesh", "unused"]


@dataclass(frozen=True, slots=True)
class FileRow:
    """An element that may name files."""

    attributes: tuple[str, ...]  # the attributes that name a file
    # the attribute of <compiler> with the folder of these files; empty: the folder of the model
    folder: Literal["", "meshdir", "texturedir"]
    # "include": its elements replace the element; "model": a model to attach; "mesh": our reader reads it; "unused": it
    # must be in the workspace and may be missing, because it is not opened
    use: Use


_SIDES: Final = ("fileback", "filedown", "filefront", "fileleft", "fileright", "fileup")

FILES: Final[Mapping[str, FileRow]] = {
    "include": FileRow(("file",), "", "include"),
    "model": FileRow(("file",), "", "model"),
    "mesh": FileRow(("file",), "meshdir", "mesh"),
    "texture": FileRow(("file", *_SIDES), "texturedir", "unused"),
    "hfield": FileRow(("file",), "meshdir", "unused"),
    "skin": FileRow(("file",), "meshdir", "unused"),
}
"""The elements that may name files. A format that is read later needs a row here, and a reader."""

FOLDERS: Final = ("assetdir", "meshdir", "texturedir")
"""The attributes of <compiler> that name folders. The first one sets both others."""

DROPPED: Final = frozenset({*FOLDERS, "strippath", "content_type"})
"""Attributes that state how MuJoCo opens a file. The text for MuJoCo has none of them."""

LIKE_A_FILE: Final = re.compile(r"file|path|dir$|^ur[il]$|librar|^content_type$")
"""The names of attributes that may name a file."""

NO_FILES: Final = frozenset({("light", "dir")})  # attributes that match `LIKE_A_FILE`, but are directions

REMOVED: Final = frozenset({"light", "camera", "skin", "sensor", "texture", "layer", "visual", "statistic"})
"""Elements that are removed from the text for MuJoCo, because they have no effect on a simulation."""

SECTIONS: Final = frozenset({"sensor"})  # elements of `REMOVED` whose children count

UNDRAWN: Final = frozenset({"texture", "texrepeat", "texuniform"})
"""Attributes of <material> that are removed from the text."""

_GIGABYTE: Final = 1 << 30

LIMITS: Final[Mapping[tuple[str, str], int]] = {
    ("replicate", "count"): MAX_ELEMENTS,
    ("hfield", "nrow"): 1_000,
    ("hfield", "ncol"): 1_000,
    ("texture", "width"): 4_096,
    ("texture", "height"): 4_096,
    ("mesh", "params"): 300,
    ("numeric", "size"): 100_000,
    ("size", "memory"): _GIGABYTE,
    ("size", "nkey"): 1_000,
    ("size", "nuserdata"): 100_000,
    **{("size", name): 20_000 for name in ("nconmax", "njmax")},
    ("size", "nstack"): _GIGABYTE // 8,
    **{
        ("size", f"nuser_{kind}"): 100
        for kind in ("actuator", "body", "cam", "geom", "jnt", "sensor", "site", "tendon")
    },
}
"""An element and its attribute -> the largest value. MuJoCo allocates memory in proportion."""

_UNITS: Final[Mapping[str, int]] = {"": 0, **{unit: 10 * (n + 1) for n, unit in enumerate("KMGTPE")}}
_NUMBER: Final = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{1,3})?")
_SIZE: Final = re.compile(r"(-?\d{1,18})([KMGTPE]?)", re.IGNORECASE)
_MAX_SHOWN: Final = 60
_MAX_TEXT: Final = 1_000
NUMBERS_PER_ELEMENT: Final = 200  # as many numbers of a heightfield, mesh or <numeric> count as one element
_AREAS: Final = {"hfield": ("nrow", "ncol"), "mesh": ("params", "params"), "numeric": ("size",)}


def refusal(message: str, place: Location) -> RefusedModel:
    """Return the error of a model with one problem."""
    return RefusedModel([Problem(place, message)])


def check_element(element: Element, place: Location) -> None:
    """Raise RefusedModel if an element is not simulated, may not name a file, or demands too much memory."""
    tag = element.tag
    row = part_table("mjcf").row(ALL, tag)
    if row is not None and row.effect == "refused":
        raise refusal(f"<{tag}> is not simulated, because {row.text}; remove it from the model", place)
    check_attributes(element, place)
    for name, text in element.attrib.items():
        most = LIMITS.get((tag, name))
        if most is not None:
            _check_number(tag, name, text, most, place)


def numbers_in(element: Element) -> int:
    """Return the number of values that MuJoCo allocates for an element that has passed `check_element`."""
    sizes = _AREAS.get(element.tag, ())
    stated = [max(map(float, element.get(name, "0").split())) for name in sizes]
    return int(abs(math.prod(stated))) if stated else 0


def check_attributes(element: Element, place: Location) -> None:
    """Raise RefusedModel if an element has an attribute that may name a file, and that is not in the table."""
    known = FILES[element.tag].attributes if element.tag in FILES else ()
    for name in element.attrib:
        if not LIKE_A_FILE.search(name) or name in known or (element.tag, name) in NO_FILES:
            continue
        if name in DROPPED and (element.tag in FILES or element.tag == "compiler"):
            continue
        allowed = ", ".join(f"<{tag} {row.attributes[0]}>" for tag, row in FILES.items())
        found = f"<{shown_name(element.tag)} {shown_name(name)}> may not name a file"
        raise refusal(f"{found}; allowed are {allowed}: remove the attribute", place)


def shown_name(name: str) -> str:
    """Return the name of an element or attribute as messages show it."""
    return name if len(name) <= _MAX_SHOWN else f"{name[:_MAX_SHOWN]}..."


def _check_number(tag: str, name: str, text: str, most: int, place: Location) -> None:
    """Raise RefusedModel if a number is above the limit, or is not a plain number."""

    def refuse(found: str) -> NoReturn:
        raise refusal(f"<{tag} {name}={shown(text)}>: {found}; at most {most:,} is allowed", place)

    if name == "memory":
        size = _SIZE.fullmatch(text.strip())
        if size is None:
            refuse("this is not a size in bytes, such as 10M")
        if int(size[1]) << _UNITS[size[2].upper()] > most:
            refuse("this is too much memory")
        return
    if len(text) > _MAX_TEXT:
        refuse("this is too large")
    words = text.split()
    if not words or not all(map(_NUMBER.fullmatch, words)) or (name == "count" and not text.isdecimal()):
        refuse("this is not a whole number" if name == "count" else "this is not a number")
    if max(map(float, words)) > most:
        refuse("this is too large")

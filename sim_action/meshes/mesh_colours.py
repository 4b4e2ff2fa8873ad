"""The colour of a mesh file: the diffuse colour of the material with the most faces.

A material with a picture has no colour of its own. A material file is opened only beside its mesh, and no link is
followed.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from sim_action.core.files import open_regular
from sim_action.meshes.collada_document import parse

Colour = tuple[float, float, float]
"""Red, green and blue, each 0 to 1."""

_MAX_MATERIAL_BYTES: Final = 1_000_000
_MAX_FILES: Final = 8

_SURFACES: Final = ("triangles", "polylist", "polygons", "trifans", "tristrips")


def colour_of(path: Path, data: bytes) -> Colour | None:
    """Return the colour of a mesh file with these bytes, which were read as a mesh before; None if it has none."""
    kind = path.suffix.lower()
    if kind == ".obj":
        return _of_obj(path, data)
    return _of_collada(data) if kind == ".dae" else None


def _of_obj(path: Path, data: bytes) -> Colour | None:
    head, *parts = b"\n".join((b"", data)).split(b"\nusemtl ")
    faces = Counter[bytes]()
    for part in parts:
        faces[part.partition(b"\n")[0].strip()] += part.count(b"\nf ")
    if not faces:
        return None
    name = faces.most_common(1)[0][0]
    named = head.split(b"\nmtllib ")[1 : _MAX_FILES + 1]
    libraries = [library.partition(b"\n")[0].strip() for library in named]
    known = dict(pair for library in libraries for pair in _materials(_beside(path, library)))
    return known.get(name)


def _beside(path: Path, name: bytes) -> bytes:
    """Return the content of a file in the folder of a mesh; empty if there is none of this name."""
    plain = Path(name.decode(errors="replace")).name
    try:
        with open_regular(path.parent / plain, follow_link=False) as file:
            return file.read(_MAX_MATERIAL_BYTES)
    except (OSError, ValueError):  # a NUL in the name
        return b""


def _materials(text: bytes) -> Iterator[tuple[bytes, Colour | None]]:
    for part in re.split(rb"^[ \t]*newmtl[ \t]+", text, flags=re.MULTILINE)[1:]:
        name, _, rest = part.partition(b"\n")
        stated = re.search(rb"^[ \t]*Kd[ \t]+([^\r\n]+)", rest, re.MULTILINE)
        has_picture = re.search(rb"^[ \t]*map_Kd\b", rest, re.MULTILINE)
        yield name.strip(), None if stated is None or has_picture else stated_colour(stated[1].decode(errors="replace"))


def _of_collada(data: bytes) -> Colour | None:
    root, _ = parse(data)
    faces = Counter[str]()
    for surface in root.iterfind("library_geometries/geometry/mesh/*"):
        if surface.tag in _SURFACES:
            count = surface.get("count", "")
            faces[surface.get("material", "")] += int(count) if count.isdecimal() and len(count) < 10 else 0
    if not faces:
        return None
    symbol = faces.most_common(1)[0][0]
    bound = {each.get("symbol"): each.get("target", "").removeprefix("#") for each in root.iter("instance_material")}
    effects = {
        material.get("id"): effect.get("url", "").removeprefix("#")
        for material in root.iterfind("library_materials/material")
        for effect in material.iterfind("instance_effect")
    }
    colours = {
        effect.get("id"): effect.findtext("profile_COMMON/technique/*/diffuse/color")
        for effect in root.iterfind("library_effects/effect")
    }
    return stated_colour(colours.get(effects.get(bound.get(symbol, symbol))) or "")


def stated_colour(text: str) -> Colour | None:
    """Return the first three numbers of a text, from 0 to 1; None if they are no numbers."""
    try:
        red, green, blue = (float(word) for word in text.split()[:3])
    except ValueError:
        return None
    if not math.isfinite(red + green + blue):
        return None
    red, green, blue = (min(1.0, max(0.0, part)) for part in (red, green, blue))
    return red, green, blue

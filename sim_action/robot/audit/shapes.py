"""Check shapes: known kinds, positive sizes, and sizes and angles that are probably in another unit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.geometry import ZERO
from sim_action.robot.documents.urdf_elements import SHAPES, number, vector
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.findings import Finding

MAX_PART_SIZE_M: Final = 50.0
"""A part of a robot that is larger was probably drawn in millimetres."""

# Beyond this size, a part that is this many times as large as all usual ones was probably drawn in millimetres.
_MAX_USUAL_SIZE_M: Final = 10.0
_MAX_RATIO: Final = 100.0

_TURN: Final = 6.3
"""360 deg in rad, rounded up."""

KINDS: Final = (*SHAPES, "mesh")


def kinds(document: ModelDocument) -> Iterator[Finding]:
    """Yield shapes that URDF does not define. Only the first child of <geometry> is read."""
    for holder in document.elements("link/collision/geometry", "link/visual/geometry"):
        shape = next(iter(holder), None)
        if shape is not None and shape.tag not in KINDS:
            message = f"unknown shape <{shape.tag}>; the shapes are {', '.join(KINDS)}"
            yield document.finding("unknown-shape", shape, message)


def sizes(document: ModelDocument) -> Iterator[Finding]:
    """Yield shapes with a size that is not greater than 0."""
    for shape in _shapes(document):
        if is_empty(shape):
            message = f"<{shape.tag}> has no size, so nothing can touch it: it is ignored"
            yield document.finding("empty-shape", shape, message)
            continue
        for name, lengths in _lengths(shape).items():
            if min(lengths) <= 0:
                found = f'<{shape.tag} {name}="{shape.attrib[name]}">'
                wanted = f"the {name} must be greater than 0" if name != "size" else "all sizes must be greater than 0"
                yield document.finding("bad-shape", shape, f"{found}: {wanted}")


def is_empty(shape: Element) -> bool:
    """Return True if all sizes of a shape are 0; a cylinder or capsule has none without a radius."""
    lengths = _lengths(shape)
    return bool(lengths) and not any(lengths.get("radius", next(iter(lengths.values()))))


def extents(document: ModelDocument) -> Iterator[Finding]:
    """Yield shapes and offsets that are too large for a robot."""
    sizes = {shape: _extent(shape) for shape in _shapes(document)}
    usual = max((size for size in sizes.values() if size <= _MAX_USUAL_SIZE_M), default=0.0)
    # A mesh can be larger than the other parts.
    is_known = usual > 0 and document.root.find("link/collision/geometry/mesh") is None
    for shape, size in sizes.items():
        if size > MAX_PART_SIZE_M:
            message = f"<{shape.tag}> is {size:g} m large; models are in metres: is it in millimetres?"
            yield document.finding("absurd-size", shape, message)
        elif is_known and size > _MAX_USUAL_SIZE_M and size > _MAX_RATIO * usual:
            message = f"<{shape.tag}> is {size:g} m large, but the other parts at most {usual:g} m"
            yield document.finding("absurd-size", shape, f"{message}: is it in millimetres?")
    for origin in document.elements("joint/origin", "link/collision/origin", "link/inertial/origin"):
        offset = max(map(abs, vector(origin, "xyz", (0.0, 0.0, 0.0))))
        if offset > MAX_PART_SIZE_M:
            message = f"<origin> is {offset:g} m away; URDF is in metres: is it in millimetres?"
            yield document.finding("absurd-size", origin, message)


def angles(document: ModelDocument) -> Iterator[Finding]:
    """Yield origins that are rotated by more than a full turn."""
    for origin in document.elements("joint/origin", "link/collision/origin", "link/inertial/origin"):
        largest = max(map(abs, vector(origin, "rpy", ZERO)))
        if largest > _TURN:
            message = f"<origin> is rotated by {largest:g} rad, more than a full turn: is it in degrees?"
            yield document.finding("odd-angle", origin, message)


def presence(document: ModelDocument) -> Iterator[Finding]:
    """Yield a finding if no link has a collision shape."""
    if document.root.find("link/collision") is None:
        message = "no link has a <collision>: the robot falls through the ground"
        yield document.finding("no-collision-shape", document.root, message)


def _shapes(document: ModelDocument) -> Iterator[Element]:
    return document.elements(*(f"link/collision/geometry/{tag}" for tag in SHAPES))


def _extent(shape: Element) -> float:
    return max((max(sizes) * (2 if name == "radius" else 1) for name, sizes in _lengths(shape).items()), default=0.0)


def _lengths(shape: Element) -> dict[str, tuple[float, ...]]:
    named = {name: number(shape, name) for name in ("radius", "length")}
    lengths: dict[str, tuple[float, ...]] = {name: (value,) for name, value in named.items() if value is not None}
    return lengths | ({"size": vector(shape, "size", (0.0, 0.0, 0.0))} if shape.tag == "box" else {})

"""Sizes of collision shapes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.geometry import ZERO
from sim_action.robot.robot_model import Finding
from sim_action.robot.urdf_elements import SHAPES, number, vector
from sim_action.robot.xml_document import ModelDocument

LARGEST: Final = 50.0
"""In m. A part of a robot that is larger was drawn in millimetres."""

_TURN: Final = 6.3
"""In rad: 360 deg, rounded up as people do."""

KINDS: Final = (*SHAPES, "mesh")


def kinds(document: ModelDocument) -> Iterator[Finding]:
    """Each is one of URDF's; what follows the shape in its <geometry> is read by nobody."""
    for holder in document.elements("link/collision/geometry", "link/visual/geometry"):
        shape = next(iter(holder), None)
        if shape is not None and shape.tag not in KINDS:
            message = f"<{shape.tag}> is no shape; there are {', '.join(KINDS)}"
            yield document.finding("unknown-shape", shape, message)


def sizes(document: ModelDocument) -> Iterator[Finding]:
    """Lengths are greater than zero."""
    for shape in _shapes(document):
        for name, lengths in _lengths(shape).items():
            if min(lengths) <= 0:
                found = f'<{shape.tag} {name}="{shape.attrib[name]}">'
                wanted = f"a {name} is greater than 0" if name != "size" else "sizes are greater than 0"
                yield document.finding("bad-shape", shape, f"{found}: {wanted}")


def extents(document: ModelDocument) -> Iterator[Finding]:
    """No part is as large as a house."""
    for shape in _shapes(document):
        largest = max((max(lengths) for lengths in _lengths(shape).values()), default=0.0)
        if largest > LARGEST:
            message = f"a <{shape.tag}> of {largest:g} m; models are in metres: is this in millimetres?"
            yield document.finding("absurd-size", shape, message)
    for origin in document.elements("joint/origin", "link/collision/origin", "link/inertial/origin"):
        offset = max(map(abs, vector(origin, "xyz", (0.0, 0.0, 0.0))))
        if offset > LARGEST:
            message = f"an <origin> {offset:g} m away; URDF is in metres: is this in millimetres?"
            yield document.finding("absurd-size", origin, message)


def angles(document: ModelDocument) -> Iterator[Finding]:
    """Nobody turns a part by more than a whole turn."""
    for origin in document.elements("joint/origin", "link/collision/origin", "link/inertial/origin"):
        largest = max(map(abs, vector(origin, "rpy", ZERO)))
        if largest > _TURN:
            message = f"an <origin> turned by {largest:g} rad, more than a whole turn: is this in degrees?"
            yield document.finding("odd-angle", origin, message)


def presence(document: ModelDocument) -> Iterator[Finding]:
    """Something can be touched."""
    if document.root.find("link/collision") is None:
        message = "no link has a <collision>: the robot would fall through the ground"
        yield document.finding("no-collision-shape", document.root, message)


def _shapes(document: ModelDocument) -> Iterator[Element]:
    return document.elements(*(f"link/collision/geometry/{tag}" for tag in SHAPES))


def _lengths(shape: Element) -> dict[str, tuple[float, ...]]:
    named = {name: number(shape, name) for name in ("radius", "length")}
    lengths: dict[str, tuple[float, ...]] = {name: (value,) for name, value in named.items() if value is not None}
    return lengths | ({"size": vector(shape, "size", (0.0, 0.0, 0.0))} if shape.tag == "box" else {})

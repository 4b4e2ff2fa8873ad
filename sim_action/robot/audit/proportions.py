"""Masses and moments that do not fit the size of what they are of: in another unit, most often.

Bounds are far out, since exporters and people round, shapes are simplified, and a placeholder is not told in what
weighs next to nothing beside the rest: of the real robots in pybullet_data, none is near.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Vector3
from sim_action.robot.audit.inertia import principal_moments
from sim_action.robot.document import ModelDocument
from sim_action.robot.robot_model import Finding, Link, Shape
from sim_action.robot.values import origin

_FARTHEST: Final = 100.0
"""Radius of gyration over how far a link reaches; for a body that is as large as its shapes it is 0.1 to 1."""
_NEAREST: Final = 0.01

_NEGLIGIBLE: Final = 0.01
"""Of the mass of a model."""

_DENSEST: Final = 25_000.0
"""kg/m^3; osmium has 22,600."""

# In m: a flat mesh is no thinner than this for an engine.
_THINNEST: Final = 1e-3


def proportions(document: ModelDocument, links: Sequence[Link]) -> Iterator[Finding]:
    """What does not fit; `links`: as they were read from the document, meshes measured."""
    shaped = {link.name: link for link in links if link.collisions and link.mass}
    total = sum(link.mass or 0.0 for link in links)
    for element in document.elements("link"):
        link = shaped.get(element.attrib["name"])
        if link is not None:
            yield from _inertia(document, element, link, _NEGLIGIBLE * total)
    yield from _density(document, shaped)


def _inertia(document: ModelDocument, element: Element, link: Link, least_mass: float) -> Iterator[Finding]:
    inertial, inertia = element.find("inertial"), element.find("inertial/inertia")
    if inertial is None or inertia is None or not link.mass or link.mass < 0:
        return
    moments = principal_moments(inertia)
    reach = _reach(link, origin(inertial).position_xyz)
    if min(moments) <= 0:
        return  # which is told
    moment = max(moments)
    radius = math.sqrt(moment / link.mass)
    is_far = math.sqrt(moment / max(link.mass, least_mass)) > _FARTHEST * reach
    if is_far or radius < _NEAREST * max(map(_half_diagonal, link.collisions)):
        says = f"link '{link.name}' has {moment:.3g} kg m^2 for {link.mass:.3g} kg, as of a mass {radius:.2g} m away"
        message = f"{says} from its centre, and reaches {reach:.2g} m from there: is it in another unit than kg m^2?"
        yield document.finding("odd-inertia", inertia, message)


def _reach(link: Link, centre: Vector3) -> float:
    """Bound in m on how far the shapes of a link reach from its centre of mass."""
    return max(_distance(shape, centre) + _half_diagonal(shape) for shape in link.collisions)


def _distance(shape: Shape, point: Vector3) -> float:
    x, y, z = ((low + high) / 2 for low, high in zip(shape.lower_xyz, shape.upper_xyz, strict=True))
    middle = geometry.compose(shape.pose, geometry.Pose((x, y, z)))
    return math.dist(middle.position_xyz, point)


def _half_diagonal(shape: Shape) -> float:
    return math.hypot(*_sizes(shape)) / 2


def _sizes(shape: Shape) -> Iterator[float]:
    return (max(high - low, _THINNEST) for low, high in zip(shape.lower_xyz, shape.upper_xyz, strict=True))


def _density(document: ModelDocument, shaped: Mapping[str, Link]) -> Iterator[Finding]:
    """Of all that has a shape: one may be a mere token of what it stands for."""
    mass = sum(link.mass or 0.0 for link in shaped.values())
    volume = sum(math.prod(_sizes(shape)) for link in shaped.values() for shape in link.collisions)
    if mass > _DENSEST * volume:
        heaviest = max(shaped.values(), key=lambda link: link.mass or 0.0)
        links = (link for link in document.elements("link") if link.attrib["name"] == heaviest.name)
        place = next(mass for link in links for mass in link.iterfind("inertial/mass"))
        density = f"{mass:.4g} kg in {volume:.2g} m^3 at most, {mass / volume:,.0f} kg/m^3"
        yield document.finding("odd-mass", place, f"{density}: is a mass in grams, or a size too small?")

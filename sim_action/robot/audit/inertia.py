"""Masses and moments of inertia that a body can have."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Vector3
from sim_action.robot.audit.joints import is_free_base
from sim_action.robot.robot_model import WORLD, Finding, Link, Shape
from sim_action.robot.urdf_elements import number, origin, parent_of
from sim_action.robot.xml_document import ModelDocument

# Exporters round: what is off by less is not told.
_ROUNDING: Final = 1e-3


def masses(document: ModelDocument) -> Iterator[Finding]:
    """No mass is negative; one of zero is meant to be something else."""
    for mass in document.elements("link/inertial/mass"):
        value = number(mass, "value") or 0.0
        if value < 0:
            yield document.finding("negative-mass", mass, f'<mass value="{value:g}">: a mass is not negative')
        elif value == 0:
            message = '<mass value="0">: what weighs nothing leaves <inertial> out; an engine would hold a base still'
            yield document.finding("zero-mass", mass, message)


def tensors(document: ModelDocument) -> Iterator[Finding]:
    """The principal moments are positive, and none is greater than the sum of the others (any mechanics textbook)."""
    for inertia in document.elements("link/inertial/inertia"):
        a, b, c = sorted(principal_moments(inertia))
        found = f"principal moments of inertia {a:.3g}, {b:.3g}, {c:.3g} kg m^2"
        if a <= 0:
            yield document.finding("impossible-inertia", inertia, f"{found}: they must all be greater than 0")
        elif c > (a + b) * (1 + _ROUNDING):
            message = f"{found}: no body has one that is greater than the sum of the others"
            yield document.finding("impossible-inertia", inertia, message)


def presence(document: ModelDocument) -> Iterator[Finding]:
    """Links that do not say what they weigh."""
    joints = document.elements("joint")
    free_of_mass = {WORLD, *(parent_of(joint) for joint in joints if is_free_base(document, joint))}
    for link in document.elements("link"):
        if link.find("inertial") is None and link.attrib["name"] not in free_of_mass:
            message = f"link '{link.attrib['name']}' has no <inertial>: it gets a negligible mass"
            yield document.finding("missing-inertia", link, message)
    if not any(number(mass, "value") for mass in document.elements("link/inertial/mass")):
        message = "no link of the model has a mass; add <inertial> to what weighs something"
        yield document.finding("massless-model", document.root, message)


def principal_moments(inertia: Element) -> tuple[float, float, float]:
    """Eigenvalues of a symmetric 3 x 3 matrix, in kg m^2 (O. K. Smith, Communications of the ACM 4(4), 1961)."""
    xx, xy, xz, yy, yz, zz = (number(inertia, name) or 0.0 for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    mean = (xx + yy + zz) / 3
    off = xy**2 + xz**2 + yz**2
    spread = math.sqrt(((xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2 * off) / 6)
    if spread == 0:
        return (mean, mean, mean)
    u, v, w = ((value - mean) / spread for value in (xx, yy, zz))
    p, q, r = xy / spread, xz / spread, yz / spread
    half_determinant = (u * (v * w - r * r) - p * (p * w - r * q) + q * (p * r - v * q)) / 2
    angle = math.acos(max(-1.0, min(1.0, half_determinant))) / 3
    largest = mean + 2 * spread * math.cos(angle)
    least = mean + 2 * spread * math.cos(angle + 2 * math.pi / 3)
    return (least, 3 * mean - largest - least, largest)


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

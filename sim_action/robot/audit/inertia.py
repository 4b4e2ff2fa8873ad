"""Masses and moments of inertia that a body can have."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.robot.audit.joints import is_free_base
from sim_action.robot.document import ModelDocument
from sim_action.robot.robot_model import WORLD, Finding
from sim_action.robot.values import number, parent_of

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

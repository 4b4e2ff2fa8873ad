"""The inertia of a link: with <inertial auto="true">, it is computed from the collisions, as in libsdformat.

The density is <density> of the collision, else of the <inertial>, else 1000 kg/m^3. If <mass> is stated, the
result is scaled to it. Moments of the shapes about their centres, along their axes: the usual formulas of solid bodies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Solid, Vector3
from sim_action.core.records import dataclass
from sim_action.robot.documents.sdf_elements import SdfProblem, needed, number_of, numbers_of, vector_of
from sim_action.robot.documents.urdf_elements import MAX_NUMBER
from sim_action.robot.model.robot_model import MOMENTS, Moments

_DENSITY: Final = 1000.0


@dataclass(frozen=True)
class Inertia:
    """The mass in kg, the centre of mass in m, and the moments about it in kg m^2, along the axes of the link."""

    mass: float
    centre_xyz: Vector3
    moments: Moments


def stated_moments(inertia: Element) -> Moments:
    """Return the moments in <inertia> in kg m^2, or their defaults. Raises SdfProblem."""
    xx, xy, xz, yy, yz, zz = (number_of(inertia, name, float(row == column)) for name, (row, column) in MOMENTS.items())
    return xx, xy, xz, yy, yz, zz


def auto_inertia(inertial: Element, collisions: Iterable[tuple[Element, Pose]]) -> Inertia:
    """Return the inertia of a link from its collisions, placed in the frame of the link. Raises SdfProblem."""
    density = number_of(inertial, "density", _DENSITY)
    solids = [(number_of(holder, "density", density), _solid(inertial, holder), pose) for holder, pose in collisions]
    masses = [density * solid.volume for density, solid, _ in solids]
    total = sum(masses)
    if not total > 0:
        message = "<inertial auto> needs a <collision> with a volume and a density: write <mass> and <inertia>"
        raise SdfProblem("unsupported-part", inertial, message)
    weighted = [
        [mass * part / total for part in pose.position_xyz] for mass, (_, _, pose) in zip(masses, solids, strict=True)
    ]
    x, y, z = map(sum, zip(*weighted, strict=True))
    scale = number_of(inertial, "mass", total) / total
    moments = [0.0] * len(MOMENTS)
    for mass, (_, solid, pose) in zip(masses, solids, strict=True):
        at = tuple(part - centre for part, centre in zip(pose.position_xyz, (x, y, z), strict=True))
        turned = [geometry.rotate(pose.orientation_xyzw, axis) for axis in geometry.AXES]
        for index, (row, column) in enumerate(MOMENTS.values()):
            own = sum(moment * axis[row] * axis[column] for moment, axis in zip(solid.moments, turned, strict=True))
            away = (sum(part**2 for part in at) if row == column else 0.0) - at[row] * at[column]
            moments[index] += scale * mass * (own + away)
    if not all(abs(value) <= MAX_NUMBER for value in (scale * total, *moments)):
        message = f"<inertial auto> has a mass or moments of more than {MAX_NUMBER:g}: check the sizes and densities"
        raise SdfProblem("bad-number", inertial, message)
    xx, xy, xz, yy, yz, zz = moments
    return Inertia(scale * total, (x, y, z), (xx, xy, xz, yy, yz, zz))


def _solid(inertial: Element, holder: Element) -> Solid:
    shape = next(iter(needed(holder, "geometry")), None)
    if shape is None or shape.tag not in _SOLIDS:
        kind = "an empty <geometry>" if shape is None else f"<{shape.tag}>"
        message = f"<inertial auto> cannot be computed from {kind}: write <mass> and <inertia>"
        raise SdfProblem("unsupported-part", inertial, message)
    return _SOLIDS[shape.tag](shape)


def _capsule(shape: Element) -> Solid:
    """Return a cylinder of <length> with half a ball at each end."""
    radius, length = _size(shape, "radius"), _size(shape, "length")
    tube, ball = math.pi * radius**2 * length, 4 / 3 * math.pi * radius**3
    along = tube * radius**2 / 2 + ball * 2 / 5 * radius**2
    # The centre of mass of half a ball is 3/8 of the radius from its flat side.
    ends = ball * (2 / 5 * radius**2 + length**2 / 4 + 3 / 8 * radius * length)
    across = tube * (3 * radius**2 + length**2) / 12 + ends
    volume = tube + ball
    return Solid(volume, (across / volume, across / volume, along / volume) if volume else (0.0, 0.0, 0.0))


def _size(shape: Element, tag: str) -> float:
    return numbers_of(needed(shape, tag), 1)[0]


_SOLIDS: Final[Mapping[str, Callable[[Element], Solid]]] = {
    "box": lambda shape: geometry.box_solid(vector_of(needed(shape, "size"))),
    "sphere": lambda shape: geometry.ellipsoid_solid((_size(shape, "radius"),) * 3),
    "cylinder": lambda shape: geometry.cylinder_solid(_size(shape, "radius"), _size(shape, "length")),
    "capsule": _capsule,
    "ellipsoid": lambda shape: geometry.ellipsoid_solid(vector_of(needed(shape, "radii"))),
}

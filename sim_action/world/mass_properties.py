"""The mass properties of a body of the world: stated, or those of uniform density."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Quaternion, Vector3
from sim_action.core.records import dataclass
from sim_action.world.body import Body
from sim_action.world.parts import BoxPart, CylinderPart, HullPart, Part, SpherePart


@dataclass(frozen=True, eq=False)
class MassProperties:
    """The mass in kg, the centre of mass in m and the inertia (3, 3) about it in kg m^2, in the axes of the body."""

    mass: float
    centre_xyz: Vector3
    inertia: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Placed:
    """A solid of 1 kg: its volume in m^3, centre of mass, and inertia about that, in the axes of the body."""

    volume: float
    centre: NDArray[np.float64]
    inertia: NDArray[np.float64]


def mass_properties_of(body: Body, parts: Sequence[Part]) -> MassProperties:
    """Return the mass properties of a body with a mass. Where parts overlap, the density is the sum of both."""
    assert body.mass is not None
    middle, uniform = uniform_properties(parts)
    centre = middle if body.center_of_mass is None else np.array(body.center_of_mass)
    inertia = body.mass * uniform if body.inertia is None else np.array(body.inertia.rows)
    x, y, z = centre.tolist()
    return MassProperties(body.mass, (x, y, z), inertia)


def uniform_properties(parts: Sequence[Part]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the centre of mass (3,) of parts of uniform density, and the inertia (3, 3) of 1 kg about it."""
    solids = [_solid(part) for part in parts]
    volumes = np.array([solid.volume for solid in solids])
    shares = volumes / volumes.sum()
    middle: NDArray[np.float64] = np.zeros(3)
    for share, solid in zip(shares, solids, strict=True):
        middle += share * solid.centre
    inertia: NDArray[np.float64] = np.zeros((3, 3))
    for share, solid in zip(shares, solids, strict=True):
        inertia += share * (solid.inertia + displaced(solid.centre - middle))
    return middle, inertia


def displaced(arm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inertia (3, 3) of 1 kg at a distance (3,) from the axes."""
    found: NDArray[np.float64] = (arm @ arm) * np.eye(3) - np.outer(arm, arm)
    return found


def _solid(part: Part) -> _Placed:
    if isinstance(part, HullPart):
        from sim_action.meshes.convex_hull import mass_properties  # a usual run does without it

        hull = mass_properties(np.array(part.points_xyz))
        return _Placed(hull.volume, hull.centre_xyz, hull.inertia)
    if isinstance(part, BoxPart):
        return _placed(geometry.box_solid(part.size_xyz), part.pose)
    if isinstance(part, CylinderPart):
        return _placed(geometry.cylinder_solid(part.radius, part.height), part.pose)
    assert isinstance(part, SpherePart), "terrain and surfaces have no mass"
    return _placed(geometry.ellipsoid_solid((part.radius,) * 3), part.pose)


def _placed(solid: geometry.Solid, pose: Pose) -> _Placed:
    inertia = turned_tensor(np.diag(solid.moments), pose.orientation_xyzw)
    return _Placed(solid.volume, np.array(pose.position_xyz), inertia)


def turned_tensor(tensor: NDArray[np.float64], orientation: Quaternion) -> NDArray[np.float64]:
    """Return an inertia tensor (3, 3), stated in axes that have an orientation, in the outer axes."""
    axes = np.array([geometry.rotate(orientation, axis) for axis in geometry.AXES])
    found: NDArray[np.float64] = axes.T @ tensor @ axes
    return found


def symmetric(entries: Iterable[float]) -> NDArray[np.float64]:
    """Return the symmetric tensor (3, 3) with these entries: xx, xy, xz, yy, yz, zz."""
    xx, xy, xz, yy, yz, zz = entries
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

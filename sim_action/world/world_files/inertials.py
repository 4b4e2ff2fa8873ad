"""The mass properties of links that move as one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sim_action.core.geometry import Quaternion, Vector3
from sim_action.core.records import dataclass
from sim_action.world.mass_properties import displaced, symmetric, turned_tensor, uniform_properties
from sim_action.world.parts import Part


@dataclass(frozen=True, eq=False)
class Lump:
    """A mass in kg, its centre in m, and its inertia (3, 3) about that in kg m^2."""

    mass: float
    centre_xyz: Vector3
    inertia: NDArray[np.float64]


def lump_of(mass: float, parts: Sequence[Part], otherwise: Vector3) -> Lump:
    """Return a mass of uniform density in parts; without parts, at a point."""
    if not parts:
        return Lump(mass, otherwise, np.zeros((3, 3)))
    centre, inertia = uniform_properties(parts)
    x, y, z = centre.tolist()
    return Lump(mass, (x, y, z), mass * inertia)


def joined(lumps: Sequence[Lump]) -> Lump:
    """Return several masses as one."""
    total = sum(lump.mass for lump in lumps)
    centre = sum(lump.mass / total * np.array(lump.centre_xyz) for lump in lumps)
    arms = [np.array(lump.centre_xyz) - centre for lump in lumps]
    inertia = sum(lump.inertia + lump.mass * displaced(arm) for lump, arm in zip(lumps, arms, strict=True))
    x, y, z = np.asarray(centre).tolist()
    return Lump(total, (x, y, z), np.asarray(inertia))


def stated_tensor(moments: Mapping[str, float], orientation: Quaternion) -> NDArray[np.float64]:
    """Return the tensor of stated moments, whose axes have an orientation, in the outer axes."""
    entries = symmetric(moments[name] for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    return turned_tensor(entries, orientation)

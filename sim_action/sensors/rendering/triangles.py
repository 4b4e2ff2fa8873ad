"""Triangles, seen from both sides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from sim_action.core.geometry import Vector3
from sim_action.sensors.rendering.rays import FloatArray, Rays
from sim_action.sensors.rendering.solids import Entry, Solid


@dataclass(frozen=True)
class Triangle(Solid):
    """A flat one; `normal_xyz`: the unit vector across it, `edges`: (3, 3) vectors in it, out of each of its sides."""

    corners: FloatArray
    normal_xyz: Vector3
    edges: FloatArray

    @classmethod
    def about_its_middle(cls, corners: FloatArray) -> tuple[Self, Vector3]:
        """The triangle of corners (3, 3), and where its middle is."""
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        own = corners - middle
        normal = np.cross(own[1] - own[0], own[2] - own[0])
        normal /= np.linalg.norm(normal)
        edges = np.cross(np.roll(own, -1, axis=0) - own, normal)
        (nx, ny, nz), (x, y, z) = normal.tolist(), middle.tolist()
        return cls(own, (nx, ny, nz), edges), (x, y, z)

    @property
    def radius(self) -> float:
        """See Solid.radius."""
        return float(np.linalg.norm(self.corners, axis=1).max())

    def enter(self, rays: Rays) -> Entry:
        """See Solid.enter."""
        nx, ny, nz = self.normal_xyz
        wx, wy, wz = rays.ways
        towards = nx * wx + ny * wy + nz * wz
        starts = zip(self.normal_xyz, rays.start_xyz, self.corners[0].tolist(), strict=True)
        above = sum(across * (start - corner) for across, start, corner in starts)
        depth = -above / towards
        x, y, z = rays.points(depth)
        missed = ~np.isfinite(depth)
        for corner, (ex, ey, ez) in zip(self.corners.tolist(), self.edges.tolist(), strict=True):
            missed |= ex * (x - corner[0]) + ey * (y - corner[1]) + ez * (z - corner[2]) > 0
        side = -np.sign(towards)
        return np.where(missed, np.inf, depth), (nx * side, ny * side, nz * side)

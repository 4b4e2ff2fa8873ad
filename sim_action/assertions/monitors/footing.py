"""The feet of a robot on the ground: where they stand, and the polygon that supports the robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from sim_action.core.geometry import Vector3
from sim_action.core.records import dataclass

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from sim_action.state.trace import FloatArray, Trace

MAX_SLOPE_RAD: Final = math.radians(60)
"""A surface that is steeper than this carries no foot: it is a wall."""

# Pairs and triples of contact points are compared at once, for as many moments as this many numbers allow.
_MAX_NUMBERS: Final = 2_000_000
# m: points nearer to a line than this are on it.
_ON_LINE_M: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Footing:
    """The contacts that carry the robot.

    Attributes:
        feet: names of links.
        bodies: names of the bodies that they may stand on.
        up_xyz: the unit vector against gravity, world frame.
    """

    feet: tuple[str, ...]
    bodies: frozenset[str]
    up_xyz: Vector3

    def is_known(self, trace: Trace) -> bool:
        """Return True if the trace has the contacts of all feet."""
        return all(foot in trace.link_contacts for foot in self.feet)

    def standing(self, trace: Trace) -> NDArray[np.bool_]:
        """Return (F, T) True where a foot is on the ground."""
        import numpy as np

        moments = (self._points(trace, foot)[0] for foot in self.feet)
        return np.array([np.bincount(moment, minlength=len(trace)) > 0 for moment in moments])

    def points(self, trace: Trace) -> tuple[NDArray[np.intp], FloatArray]:
        """Return the contact points of all feet: the index (N,) of the moment, rising, and the place (N, 3) in m."""
        import numpy as np

        found = [self._points(trace, foot) for foot in self.feet]
        moment = np.concatenate([moments for moments, _ in found])
        order = np.argsort(moment, kind="stable")
        return moment[order], np.concatenate([points for _, points in found])[order]

    def level(self, points_xyz: FloatArray) -> FloatArray:
        """Return points (N, 3) as seen along gravity, (N, 2) m."""
        import numpy as np

        x, y, z = self.up_xyz
        # The axis that is least vertical gives a direction that is level.
        axis = np.eye(3)[int(np.argmin(np.abs((x, y, z))))]
        first = axis - np.dot(axis, self.up_xyz) * np.array(self.up_xyz)
        first /= math.sqrt(float(np.dot(first, first)))
        second = np.cross(self.up_xyz, first)
        # Element by element: the result for one moment must not depend on the others.
        return np.column_stack([(points_xyz * direction).sum(axis=1) for direction in (first, second)])

    def _points(self, trace: Trace, foot: str) -> tuple[NDArray[np.intp], FloatArray]:
        import numpy as np

        record = trace.link_contacts[foot]
        allowed = np.array([body in self.bodies for body in record.bodies], dtype=np.bool_)[record.body]
        moment = record.moment(trace.time)
        steepness = (record.normal_xyz * np.array(self.up_xyz)).sum(axis=1)
        carries = allowed & (moment >= 0) & (steepness >= math.cos(MAX_SLOPE_RAD))
        return moment[carries], record.position_xyz[carries]


def support_margins(centre_xy: FloatArray, moment: NDArray[np.intp], points_xy: FloatArray) -> FloatArray:
    """Return the distances (T,) in m of a point to the edge of the support polygon, negative outside.

    The polygon of a moment is the convex hull of its points; without a point, the distance is minus infinity.

    :param centre_xy: the point, (T, 2) m.
    :param moment: the index (N,) of the moment of each point of the polygons, rising.
    :param points_xy: the points of the polygons, (N, 2) m.
    """
    import numpy as np

    margins = np.full(len(centre_xy), -math.inf)
    counts = np.bincount(moment, minlength=len(centre_xy))
    starts = np.cumsum(counts) - counts
    for count in np.unique(counts[counts > 0]).tolist():
        rows = np.flatnonzero(counts == count)
        several = max(1, _MAX_NUMBERS // count**3)
        for first in range(0, len(rows), several):
            some = rows[first : first + several]
            polygons = points_xy[starts[some][:, None] + np.arange(count)]
            margins[some] = _margins(centre_xy[some], polygons)
    return margins


def _margins(centre: FloatArray, points: FloatArray) -> FloatArray:
    """Return the same (T,) for polygons (T, K, 2) of as many points."""
    import numpy as np

    ways = points[:, None, :, :] - points[:, :, None, :]
    lengths = np.sqrt((ways * ways).sum(axis=3))
    arms = centre[:, None, :] - points
    # The side of each point, and of the centre, as seen along the way from one point to another.
    others = points[:, None, None, :, :] - points[:, :, None, None, :]
    sides = ways[..., None, 0] * others[..., 1] - ways[..., None, 1] * others[..., 0]
    is_edge = (lengths > _ON_LINE_M) & (sides >= -_ON_LINE_M * lengths[..., None]).all(axis=3)
    safe = np.where(lengths > _ON_LINE_M, lengths, 1.0)
    inside = (ways[..., 0] * arms[:, :, None, 1] - ways[..., 1] * arms[:, :, None, 0]) / safe
    along = ((ways * arms[:, :, None, :]).sum(axis=3) / safe**2).clip(0.0, 1.0)
    away = arms[:, :, None, :] - along[..., None] * ways
    distance = np.sqrt((away * away).sum(axis=3))
    least = np.where(is_edge, inside, math.inf).min(axis=(1, 2))
    to_edge = np.where(is_edge, distance, math.inf).min(axis=(1, 2))
    to_point = np.sqrt((arms * arms).sum(axis=2)).min(axis=1)
    outside = np.minimum(to_edge, to_point)
    # Without an edge, all points are at one place. If all are on one line, `least` is 0 on the whole line.
    return np.asarray(np.where(np.isfinite(least) & (least > 0), least, 0.0 - outside))


def named(feet: Sequence[str]) -> str:
    """Return the names of a few feet as text."""
    return ", ".join(feet)

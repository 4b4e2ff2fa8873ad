"""How a mesh compares with its convex hull."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from sim_action.meshes.mesh import compacted

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# Of the largest extent: how far the points of what is flat may be off.
_FLAT: Final = 1e-5
# Of the largest extent: how far a point may lie before a plane of what is convex. Files hold 6 digits.
_CONVEX: Final = 1e-4
# Of the whole sphere about a point within: how much of it a closed surface may fail to cover.
_OPEN: Final = 1e-3
# Products of planes and points that the look for convexity may take: some ms.
_MAX_PRODUCTS: Final = 1_000_000
_PLANES_AT_A_TIME: Final = 64


def is_flat(points: NDArray[np.float64]) -> bool:
    """Whether there is a plane that all points lie in."""
    import numpy as np

    apart = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(np.einsum("pi,pj->ij", apart, apart))
    return bool(np.ptp(_along(apart, axes[None, :, 0])) <= _FLAT * np.ptp(points, axis=0).max())


def is_convex(points_xyz: NDArray[np.float64], triangles: NDArray[np.int64], sharers: int = 1) -> bool:
    """Whether the triangles are the surface of their convex hull: all of it, and nothing else.

    Of many triangles a sample is judged, of fewer if so many parts share the time that this may take.
    """
    import numpy as np

    used, rows = compacted(points_xyz, triangles)
    points = used - used.mean(axis=0)
    points /= np.abs(points).max()
    corners = points[rows]
    if _solid_angles(corners).sum() < 4 * np.pi * (1 - _OPEN):
        return False
    step = max(1, len(corners) * len(points) * sharers // _MAX_PRODUCTS)
    corners = corners[::step]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for start in range(0, len(corners), _PLANES_AT_A_TIME):
        planes = slice(start, start + _PLANES_AT_A_TIME)
        ahead = _along(points, normals[planes]) - (normals[planes] * corners[planes, 0]).sum(axis=1, keepdims=True)
        # Which side is out is left open: not every file keeps to it.
        if (np.minimum(ahead.max(axis=1), -ahead.min(axis=1)) > _CONVEX).any():
            return False
    return True


def _along(points: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far each point (P, 3) is along each direction (D, 3): (D, P).

    Written out, as a product of matrices would wake threads that cost more than they help with.
    """
    x, y, z = directions[:, :1], directions[:, 1:2], directions[:, 2:]
    distances: NDArray[np.float64] = x * points[:, 0] + y * points[:, 1] + z * points[:, 2]
    return distances


def _solid_angles(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """How much of the sphere about the origin each triangle covers (van Oosterom and Strackee, 1983)."""
    import numpy as np

    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    la, lb, lc = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=1)
    below = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    angles: NDArray[np.float64] = np.abs(2 * np.arctan2(volume, below))
    return angles

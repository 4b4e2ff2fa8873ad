"""Rays in PyBullet. They meet what is in the groups that they look for; the robot has one of its own.

Rays meet flat surfaces exactly. On round ones the engine stops its search within 1 mm of them.
"""

from __future__ import annotations

from operator import itemgetter
from typing import Final

import numpy as np
import pybullet
from numpy.typing import NDArray

from sim_action.core.geometry import Vector3
from sim_action.engines.pybullet.scene import BASE

# Bullet's own groups (btBroadphaseProxy.h) go up to 32; all bodies are in one of its first two.
_MOVING: Final = 1
_FIXED: Final = 2
_ROBOT: Final = 64
_ALL: Final = -1
# Of the batch that it calls its greatest, the engine loses the last ray.
_BATCH: Final = pybullet.MAX_RAY_INTERSECTION_BATCH_SIZE - 1

_HIT_FRACTION: Final = itemgetter(2)


def hide_from_rays(client: int, robot: int, *, fixed: bool) -> None:
    """Puts the robot into a group of its own, which touches what it touched before; `fixed`: its base is.

    What is fixed looks for all but what is fixed: the same that the engine gave it.
    """
    _join(client, robot, BASE, _ALL ^ _FIXED if fixed else _ALL)
    for link in range(pybullet.getNumJoints(robot, client)):
        _join(client, robot, link, _ALL)


def cast_rays(client: int, start_xyz: Vector3, ends_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """See EngineQueries.cast_rays."""
    shares: NDArray[np.float64] = np.empty(len(ends_xyz))
    for first in range(0, len(ends_xyz), _BATCH):
        # Lists are what the engine's Python reads fastest.
        ends = ends_xyz[first : first + _BATCH].tolist()
        hits = pybullet.rayTestBatch(
            [start_xyz] * len(ends), ends, numThreads=1, collisionFilterMask=_MOVING | _FIXED, physicsClientId=client
        )
        shares[first : first + len(ends)] = list(map(_HIT_FRACTION, hits))
    # So the engine says that a ray meets nothing.
    shares[shares >= 1] = np.inf
    return shares


def _join(client: int, robot: int, link: int, looks_for: int) -> None:
    pybullet.setCollisionFilterGroupMask(robot, link, _ROBOT, looks_for, client)

"""Connections to PyBullet, each with the plane z = 0: opened ahead, in use, or released for the next use."""

from __future__ import annotations

import ctypes
import sys
from functools import cache
from typing import Final, NamedTuple

import pybullet


class Connection(NamedTuple):
    """The numbers of a DIRECT connection and of the plane z = 0, the only body in it."""

    client: int
    plane: int


_AHEAD: Final[list[Connection]] = []
_RELEASED: Final[list[int]] = []

# Parameters of mallopt(3): how much free memory at the end of the heap goes back to the system, and from which size on
# a block is mapped on its own.
_TRIM_THRESHOLD: Final = -1
_MMAP_THRESHOLD: Final = -3
_MAX_KEPT_BYTES: Final = 32 << 20


def connect_ahead() -> None:
    """Open a connection ahead, for the next use in this process or in processes forked from it.

    Opening one takes as long as simulating a small robot for two seconds, mostly for memory that is hardly written to;
    forked processes share that memory.
    """
    if not _AHEAD:
        _AHEAD.append(_made())


def connected() -> Connection:
    """Return a connection of its own: the one that was opened ahead, one that was released, or a new one."""
    if _AHEAD:
        return _AHEAD.pop()
    client = _RELEASED.pop() if _RELEASED else None
    if client is None or not pybullet.isConnected(client):
        return _made()
    # Its first argument is not the connection.
    pybullet.resetSimulation(physicsClientId=client)
    return _with_plane(client)


def release(client: int) -> None:
    """End the use of a connection; one is kept, because a reset takes a tenth of the time of a new one."""
    if _AHEAD or _RELEASED:
        pybullet.disconnect(client)
    else:
        _keep_free_memory()
        _RELEASED.append(client)


@cache
def _keep_free_memory() -> None:
    """Let the C library keep what a reset frees: to get 14 MB from the system again would take 7 ms for each run."""
    if sys.platform == "linux":
        if (mallopt := getattr(ctypes.CDLL(None), "mallopt", None)) is not None:
            mallopt(_TRIM_THRESHOLD, _MAX_KEPT_BYTES)
            mallopt(_MMAP_THRESHOLD, _MAX_KEPT_BYTES)


def _made() -> Connection:
    return _with_plane(pybullet.connect(pybullet.DIRECT))


def _with_plane(client: int) -> Connection:
    shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    return Connection(client, int(pybullet.createMultiBody(0, shape, look(client), physicsClientId=client)))


def look(client: int) -> int:
    """Return the number of a visual shape that shows nothing; without it, PyBullet draws all shapes in up to 1 ms."""
    return int(pybullet.createVisualShape(pybullet.GEOM_BOX, halfExtents=(0.5, 0.5, 0.5), physicsClientId=client))

"""Connections to the engine, with the ground plane in them: one may be made ahead, for processes that are forked later.

To make one takes as long as two seconds of a small robot's, most of it for memory that is hardly ever written to. What
is forked with it shares that.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import pybullet


class Connection(NamedTuple):
    """The engine's numbers for a DIRECT connection, and for the plane z = 0, which is alone in it."""

    client: int
    plane: int


_AHEAD: Final[list[Connection]] = []


def connect_ahead() -> None:
    """Makes the connection that this process, and each that is forked from it, is going to use next."""
    if not _AHEAD:
        _AHEAD.append(_made())


def connected() -> Connection:
    """A connection that nobody else uses."""
    return _AHEAD.pop() if _AHEAD else _made()


def _made() -> Connection:
    client = pybullet.connect(pybullet.DIRECT)
    shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    return Connection(client, int(pybullet.createMultiBody(0, shape, physicsClientId=client)))

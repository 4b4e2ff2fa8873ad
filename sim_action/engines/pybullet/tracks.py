"""Where bodies of the world are in PyBullet, as cheaply as it can be asked."""

from __future__ import annotations

from collections.abc import Sequence

import pybullet

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.engines.body_tracks import Look


def looking_at(client: int, bodies: Sequence[tuple[int, Pose]]) -> Look:
    """`bodies`: the engine's number for a piece of each, and the pose of that piece in the body."""
    numbers = [number for number, _ in bodies]
    aside = {place: geometry.inverse(piece) for place, (_, piece) in enumerate(bodies) if piece != Pose()}

    def look() -> Sequence[float]:
        found = [pybullet.getBasePositionAndOrientation(number, client) for number in numbers]
        for place, back in aside.items():
            there = geometry.compose(Pose(*found[place]), back)
            found[place] = there.position_xyz, there.orientation_xyzw
        return [value for position, orientation in found for value in (*position, *orientation)]

    return look

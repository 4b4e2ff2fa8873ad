"""Where something begins, in the world frame."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from sim_action.core import geometry
from sim_action.core.quantities import FrozenModel, Metres, Radians

FARTHEST: Final = 100_000.0
"""m, from the origin of the world: beyond, the engines' numbers know no millimetres."""

Coordinate = Annotated[Metres, Field(ge=-FARTHEST, le=FARTHEST)]


class Placement(FrozenModel):
    """Where something begins, in the world frame."""

    x: Coordinate = 0.0
    y: Coordinate = 0.0
    z: Annotated[Coordinate | None, Field(description="left out: it stands on the ground")] = None
    roll: Radians = 0.0
    pitch: Radians = 0.0
    yaw: Radians = 0.0

    @property
    def orientation_xyzw(self) -> geometry.Quaternion:
        """The rotation by roll, pitch and yaw."""
        return geometry.quaternion_from_rpy(self.roll, self.pitch, self.yaw)

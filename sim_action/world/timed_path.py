"""Where a body of the world is over time: `path: [{at: 0 s, x: 0}, {at: 2 s, x: 1}]`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from sim_action.core.field_types import Coordinate, FrozenModel, NonNegativeSeconds, Placement, Radians

if TYPE_CHECKING:
    from sim_action.world.body import Body

# In m and rad: what is no farther apart is the same place.
_SAME: Final = 1e-6


class PathPoint(FrozenModel):
    """Where a body is at one time, in the world frame; a key that is left out stays as it was."""

    at: Annotated[NonNegativeSeconds, Field(description="sim time; each point is later than the one before")]
    x: Coordinate | None = None
    y: Coordinate | None = None
    z: Coordinate | None = None
    roll: Radians | None = None
    pitch: Radians | None = None
    yaw: Annotated[Radians | None, Field(description="it turns as far as is written: 360 deg is one turn")] = None

    def after(self, before: Placement) -> Placement:
        """Where it puts a body that was there before."""
        stated = self.model_dump(exclude={"at"}, exclude_none=True)
        return before.model_copy(update=stated)


def placements(start: Placement, points: Sequence[PathPoint]) -> tuple[Placement, ...]:
    """One for each point."""
    found: list[Placement] = []
    for point in points:
        found.append(point.after(found[-1] if found else start))
    return tuple(found)


def refuse_impossible_path(body: Body) -> None:
    """Raises ValueError if what a body says of its motion does not fit together."""
    if body.loop and not body.path:
        raise ValueError("'loop' goes with a 'path'")
    if not body.path:
        return
    if body.mass is not None:
        raise ValueError("a body on a 'path' goes its way whatever it weighs and whatever it meets; leave 'mass' out")
    if body.appears is not None:
        raise ValueError("a body on a 'path' is there from the start; leave out 'appears', or 'path'")
    if len(body.path) < 2:
        raise ValueError("a path has two points at the least; where a body stays, 'pose' says where")
    if body.loop and _differ(placements(body.pose, body.path)):
        raise ValueError(
            "a path with 'loop: true' ends where it begins; let its last point be at the pose of its first, with its z"
        )


def _differ(places: Sequence[Placement]) -> bool:
    """Whether the last is not at the first; turned by whole turns, it is."""
    first, last = places[0], places[-1]
    if (first.z is None) != (last.z is None):
        return True
    ways = [last.x - first.x, last.y - first.y, (last.z or 0.0) - (first.z or 0.0)]
    turns = [last.roll - first.roll, last.pitch - first.pitch, last.yaw - first.yaw]
    return any(abs(way) > _SAME for way in (*ways, *(math.remainder(turn, 2 * math.pi) for turn in turns)))

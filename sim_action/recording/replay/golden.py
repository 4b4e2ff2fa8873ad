"""The golden trajectories of a replay: the motions that expectations compare the run with."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from sim_action.core.field_types import FrozenModel
from sim_action.recording.replay.columns import Column, Index
from sim_action.recording.replay.scene_data import MAX_LINKS
from sim_action.recording.replay.shapes import Length

MAX_GOLDEN: Final = 8


class GoldenData(FrozenModel):
    """A golden trajectory, at its own moments.

    Attributes:
        expectation: the number of the expectation, counted from 0.
        time: the sim time in s.
        base: x, y, z in m and yaw in rad of the base link, in the world frame.
        joints: (index in `Replay.joint_names`, positions in rad, or m if prismatic) of the joints that the file has.
        position, yaw: the tolerances of the expectation in m and rad; None if it has none, and in older replays.
    """

    expectation: Index
    time: Column
    base: tuple[Column, Column, Column, Column]
    joints: Annotated[tuple[tuple[Index, Column], ...], Field(max_length=MAX_LINKS)] = ()
    position: Length | None = None
    yaw: Length | None = None

    @property
    def count(self) -> int:
        """The number of moments."""
        return 1 + len(self.time.deltas)

    def fits(self, joints: int) -> bool:
        """Return True if the columns are complete and the run has `joints` joints or more than the largest index."""
        columns = (*self.base, *(column for _, column in self.joints))
        are_whole = all(column.fits(self.count) and column.is_motion for column in columns)
        return self.time.rises and are_whole and self._has_joints(joints)

    def _has_joints(self, joints: int) -> bool:
        return all(index < joints for index, _ in self.joints)

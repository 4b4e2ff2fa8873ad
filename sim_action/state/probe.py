"""What sensors may ask an engine for, beside the state of the base and the joints. Nothing of it changes a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from sim_action.core.geometry import Pose, Twist, Vector3

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Probe(Protocol):
    """An engine, as sensors see it."""

    def link_pose(self, link: str) -> Pose:
        """Of a link's frame, which is not its centre of mass, in the world."""

    def link_twist(self, link: str) -> Twist:
        """Of the origin of a link's frame, in the world frame."""

    def body_pose(self, body: str) -> Pose:
        """Of the middle of a body of the world, by its name; not of the ground."""

    def cast_rays(self, start_xyz: Vector3, ends_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Casts rays that meet the bodies of the world and the ground, and never the robot.

        What `start_xyz` is inside of is not met, either: rays see surfaces from outside.

        Args:
            start_xyz: where all of them begin, in m, world frame.
            ends_xyz: (N, 3) where they end, in m, world frame.

        Returns:
            (N,) the share of its way, 0 to 1, after which each ray meets a surface; inf: it meets none.
        """

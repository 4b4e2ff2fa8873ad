"""What sensors may ask an engine for, beside the state of the base and the joints. Nothing of it changes a run."""

from __future__ import annotations

from typing import Protocol

from sim_action.geometry import Pose, Twist


class Probe(Protocol):
    """An engine, as sensors see it."""

    def link_pose(self, link: str) -> Pose:
        """Of a link's frame, which is not its centre of mass, in the world."""

    def link_twist(self, link: str) -> Twist:
        """Of the origin of a link's frame, in the world frame."""

    def body_pose(self, body: str) -> Pose:
        """Of the middle of a body of the world, by its name; not of the ground."""

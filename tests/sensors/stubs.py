"""What sensors are tested with that ask the engine for nothing, or for what a test says."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.sensors import Sight
from sim_action.state.observation import Observation
from sim_action.state.readings import EngineQueries


class OneLink:
    """An engine in which every link is at the same place."""

    def __init__(self, pose: Pose | None = None, twist: Twist | None = None) -> None:
        self._pose, self._twist = pose or Pose(), twist or Twist()

    def link_pose(self, link: str) -> Pose:
        return self._pose

    def link_twist(self, link: str) -> Twist:
        return self._twist

    def cast_rays(self, start_xyz: Vector3, ends_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.full(len(ends_xyz), np.inf)

    def body_pose(self, body: str) -> Pose:
        return Pose()


NO_PROBE = OneLink()


def sight_of(robot: Observation, probe: EngineQueries) -> Sight:
    return Sight(robot.time, probe, lambda: robot)

"""A camera that goes along with a robot, and looks at it from behind, from the side and from above."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from sim_action.core.geometry import Pose, Vector3, quaternion_from_rpy
from sim_action.robot.kinematics import link_poses, robot_box
from sim_action.robot.robot_model import RobotModel
from sim_action.sensors.rendering.rays import Pinhole

WIDTH: Final = 320
HEIGHT: Final = 240
_FIELD_OF_VIEW: Final = math.radians(60)
# Down to the robot, and to the right of where it heads at first.
_DOWN: Final = math.radians(35)
_ASIDE: Final = math.radians(40)
# Of the robot's size; and in m, for what is small and drives far.
_DISTANCE: Final = 2.5
_NEAREST: Final = 1.2


@dataclass(frozen=True, slots=True)
class FollowCamera:
    """It never turns: what seems to turn does.

    Attributes:
        heading: rad, of its view on the ground plane.
        distance: m, to what it looks at.
        above: m, of what it looks at, over the base link.
    """

    heading: float
    distance: float
    above: float

    @classmethod
    def of(cls, model: RobotModel, start: Pose) -> FollowCamera:
        """One from which all of a robot can be seen."""
        box = robot_box(model, link_poses(model, model.positions({})))
        low, high = box or ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        size = math.dist(low, high)
        return cls(start.yaw + _ASIDE, max(_NEAREST, _DISTANCE * size), (low[2] + high[2]) / 2)

    @property
    def pinhole(self) -> Pinhole:
        """Its lens."""
        return Pinhole(WIDTH, HEIGHT, _FIELD_OF_VIEW, 0.02 * self.distance, 100 * self.distance)

    def pose(self, base_xyz: Vector3) -> Pose:
        """Where it is in the world, for a base link that is there."""
        x, y, z = base_xyz
        back = self.distance * math.cos(_DOWN)
        up = self.above + self.distance * math.sin(_DOWN)
        place = (x - back * math.cos(self.heading), y - back * math.sin(self.heading), z + up)
        return Pose(place, quaternion_from_rpy(0.0, _DOWN, self.heading))

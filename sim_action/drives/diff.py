"""Differential drive: wheels on the left and on the right that turn at speeds of their own."""

from __future__ import annotations

from typing import ClassVar, Self

from sim_action.drives.plugins import DIFF_PLUGINS
from sim_action.drives.sided import SidedDrive
from sim_action.drives.wheels import radius
from sim_action.robot.robot_model import RobotModel


class DiffDrive(SidedDrive):
    """Two sides of wheels; forward speed is their mean, turning rate their difference over the separation.

    Wheel speeds follow a twist by a ramp, as Gazebo's diff drive plugin does (`wheelAcceleration`).
    No wheel turns faster than the velocity limit of its joint in the model: all are slowed alike, which keeps the
    curve, and the outcome has a note.
    """

    key: ClassVar[str] = "diff"
    title: ClassVar[str] = "diff drive"
    plugins: ClassVar[tuple[str, ...]] = DIFF_PLUGINS

    @classmethod
    def recognise(cls, model: RobotModel) -> Self | None:
        """What Gazebo's plugin in the model says, or else round wheels whose joints have telling names.

        That is one continuous joint with "left" in its name, and one with "right".
        """
        if (stated := cls.by_plugin(model)) is not None:
            return stated if len(stated.left) == len(stated.right) == 1 else None
        wheels = [joint.name for joint in model.joints if joint.type == "continuous" and radius(model, joint.name)]
        left, right = ([name for name in wheels if side in name.lower()] for side in ("left", "right"))
        return cls(left=tuple(left), right=tuple(right)) if len(left) == len(right) == len(wheels) / 2 == 1 else None

"""The drive that `inspect` offers for wheels whose drive is not plain."""

from __future__ import annotations

from typing import Final

from sim_action.drives import Drive
from sim_action.drives.diff import DiffDrive
from sim_action.drives.mecanum import MecanumDrive
from sim_action.drives.skid import SkidSteer, mecanum_names, sides_on_ground
from sim_action.robot.model.robot_model import RobotModel

_PAIR: Final = 2


def likely_drive(model: RobotModel) -> Drive | None:
    """Return a drive with the wheels on the ground, which the owner has to confirm; None if there is none."""
    left, right = sides_on_ground(model) or ((), ())
    if not left:
        return None
    if mecanum_names(model):
        # The front wheel of each side comes first.
        orders = [(left, right), (left[::-1], right[::-1])] if len(left) == len(right) == _PAIR else []
        drives = (MecanumDrive(left=(a, b), right=(c, d)) for (a, b), (c, d) in orders)
        return next((drive for drive in drives if not any(drive.problems(model))), None)
    return (SkidSteer if len(left) + len(right) > _PAIR else DiffDrive)(left=left, right=right)

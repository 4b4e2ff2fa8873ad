"""Which wheels of a model are on its left and on its right, if that is plain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from sim_action.drives.wheels import ASKEW, Wheel, steering_joint, wheels_on_ground
from sim_action.robot.robot_model import RobotModel

Sides = tuple[tuple[str, ...], tuple[str, ...]]

# In m: a wheel nearer to the middle is on no side.
_AMID: Final = 1e-3


def sides_on_ground(model: RobotModel) -> Sides | None:
    """Joints on the left, and on the right; None unless all roll the same way, on a side, and none is steered."""
    wheels = wheels_on_ground(model)
    if not wheels or any(steering_joint(model, found.joint) for found in wheels):
        return None
    by_place, by_name = _by_place(wheels), _by_name(wheels)
    # What rolls along x has its left where y is; of what rolls another way, only names tell what is its front.
    if by_place is None:
        return by_name if _parallel(wheels) else None
    return by_place if by_name in (None, by_place) else None


def _by_place(wheels: Sequence[Wheel]) -> Sides | None:
    if any(abs(found.axis_xyz[1]) < 1 - ASKEW or abs(found.position_xyz[1]) < _AMID for found in wheels):
        return None
    return _split(wheels, [found.position_xyz[1] > 0 for found in wheels])


def _by_name(wheels: Sequence[Wheel]) -> Sides | None:
    names = [found.joint.lower() for found in wheels]
    if any(("left" in name) == ("right" in name) for name in names):
        return None
    return _split(wheels, ["left" in name for name in names])


def _split(wheels: Sequence[Wheel], is_left: Sequence[bool]) -> Sides | None:
    left, right = (
        tuple(found.joint for found, here in zip(wheels, is_left, strict=True) if here is side)
        for side in (True, False)
    )
    return (left, right) if left and right else None


def _parallel(wheels: Sequence[Wheel]) -> bool:
    ax, ay, _ = wheels[0].axis_xyz
    return all(abs(ax * found.axis_xyz[0] + ay * found.axis_xyz[1]) > 1 - ASKEW for found in wheels)

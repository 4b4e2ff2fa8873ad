"""The names that a formula may use, and in what they are measured."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final, cast

from sim_action.assertions.temporal_logic.formula import Signal
from sim_action.core import units
from sim_action.core.messages import did_you_mean
from sim_action.core.units import Dimension
from sim_action.robot.robot_model import READINGS, Reading, RobotModel

BASE_SIGNALS: Final = MappingProxyType(
    {
        "time": units.TIME,
        "x": units.LENGTH,
        "y": units.LENGTH,
        "z": units.LENGTH,
        "roll": units.ANGLE,
        "pitch": units.ANGLE,
        "yaw": units.ANGLE,
        "tilt": units.ANGLE,
        "speed": units.SPEED,
        "turn_rate": units.ANGULAR_SPEED,
        "travel": units.LENGTH,
    }
)
"""Of the base link, as `Trace` has them; travel is the distance on the ground from where the robot settled."""

NAMES: Final = (*BASE_SIGNALS, *(f"{reading}(joint)" for reading in READINGS))
"""All of them, as messages list them."""


def dimension(signal: Signal, model: RobotModel) -> Dimension:
    """What a signal is measured in; the joint must be there."""
    if not signal.joint:
        return BASE_SIGNALS[signal.name]
    return model.joints_by_name[signal.joint].dimension(cast(Reading, signal.name))


def problem_with(signal: Signal, model: RobotModel) -> str | None:
    """A joint that is not there, or does not move."""
    moving = [joint.name for joint in model.moving_joints]
    if not signal.joint or signal.joint in moving:
        return None
    return f"the model has no moving joint '{signal.joint}'{did_you_mean(signal.joint, moving)}"

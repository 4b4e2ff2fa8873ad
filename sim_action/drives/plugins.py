"""Drive plugins of Gazebo in a model: their wheel and steering joints and their parameters.

The names are those of gazebo_ros_pkgs (ROS 1 and 2) and of gz-sim's DiffDrive, AckermannSteering and MecanumDrive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from sim_action.robot.robot_model import Plugin, RobotModel

DIFF_PLUGINS: Final = ("gazebo_ros_diff_drive", "gz-sim-diff-drive-system", "ignition-gazebo-diff-drive-system")
SKID_PLUGINS: Final = ("gazebo_ros_skid_steer_drive", *DIFF_PLUGINS)
"""Plugins of differential drives also accept several wheels per side."""
ACKERMANN_PLUGINS: Final = ("gz-sim-ackermann-steering-system", "ignition-gazebo-ackermann-steering-system")
MECANUM_PLUGINS: Final = ("gz-sim-mecanum-drive-system", "ignition-gazebo-mecanum-drive-system")
_LEFT: Final = ("leftJoint", "left_joint", "leftFrontJoint", "leftRearJoint")
_RIGHT: Final = ("rightJoint", "right_joint", "rightFrontJoint", "rightRearJoint")
_CORNERS: Final = ("front_left_joint", "front_right_joint", "back_left_joint", "back_right_joint")
_STEERING: Final = ("left_steering_joint", "right_steering_joint")
_SWAPPED: Final = (
    "sides swapped, as gazebo_ros_diff_drive does without <legacyMode>false</legacyMode>: rightJoint is the left wheel"
)
# Wheels that reach their speed in one step slip.
_NO_LIMIT: Final = "the plugin has no limit for wheel acceleration, so 1 m/s^2 is used"
_NO_LIMIT_AHEAD: Final = "the plugin has no limit for acceleration, so 1 m/s^2 is used"
# Tag -> key of the drive, and the factor from the value of the tag.
_FIGURES: Final = {
    "wheelDiameter": ("radius", 0.5),
    "wheel_diameter": ("radius", 0.5),
    "wheel_radius": ("radius", 1.0),
    "wheelSeparation": ("separation", 1.0),
    "wheel_separation": ("separation", 1.0),
    "wheelAcceleration": ("acceleration", 1.0),
    "max_wheel_acceleration": ("acceleration", 1.0),
    "wheelTorque": ("torque", 1.0),
    "max_wheel_torque": ("torque", 1.0),
    "torque": ("torque", 1.0),
}
_STEERING_FIGURES: Final = {
    "wheel_radius": ("radius", 1.0),
    "wheel_base": ("wheelbase", 1.0),
    "steering_limit": ("steering_limit", 1.0),
    "max_acceleration": ("acceleration", 1.0),
}
_MECANUM_FIGURES: Final = {"wheel_radius": ("radius", 1.0), "max_acceleration": ("acceleration", 1.0)}


@dataclass(frozen=True, slots=True)
class StatedSides:
    """The statements of a plugin: joints, parameters by YAML key, and remarks on their interpretation."""

    left: tuple[str, ...]
    right: tuple[str, ...]
    figures: dict[str, float]
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class StatedSteering:
    """The statements of a plugin: steering joints, wheel joints, parameters and remarks."""

    steering: tuple[str, ...]
    wheels: tuple[str, ...]
    figures: dict[str, float]
    remarks: tuple[str, ...] = ()


def sides_by_plugin(model: RobotModel, plugins: Sequence[str]) -> StatedSides | None:
    """Return the statements of the first of these plugins whose joints exist in the model, else None."""
    for plugin in model.plugins:
        left, right = _joints(plugin, _LEFT), _joints(plugin, _RIGHT)
        if plugin.name in plugins and left and right and _drivable(model, (*left, *right)):
            return _meant(plugin, left, right)
    return None


def steering_by_plugin(model: RobotModel) -> StatedSteering | None:
    """Return the statements of the first Ackermann plugin whose joints exist in the model, else None."""
    for plugin in model.plugins:
        steering, wheels = _joints(plugin, _STEERING), _joints(plugin, (*_LEFT, *_RIGHT))
        if plugin.name in ACKERMANN_PLUGINS and steering and wheels and _drivable(model, (*steering, *wheels)):
            figures = _figures(plugin, _STEERING_FIGURES)
            return StatedSteering(steering, wheels, figures, _unlimited(figures, _NO_LIMIT_AHEAD))
    return None


def corners_by_plugin(model: RobotModel) -> StatedSides | None:
    """Return the statements of the first mecanum plugin whose joints exist in the model, else None."""
    for plugin in model.plugins:
        corners = _joints(plugin, _CORNERS)
        if plugin.name in MECANUM_PLUGINS and len(corners) == len(_CORNERS) and _drivable(model, corners):
            figures = _figures(plugin, _MECANUM_FIGURES)
            return StatedSides(corners[::2], corners[1::2], figures, _unlimited(figures, _NO_LIMIT_AHEAD))
    return None


def _meant(plugin: Plugin, left: tuple[str, ...], right: tuple[str, ...]) -> StatedSides:
    figures = _figures(plugin, _FIGURES)
    remarks = _unlimited(figures, _NO_LIMIT)
    if _swaps_sides(plugin):
        return StatedSides(right, left, figures, (_SWAPPED, *remarks))
    return StatedSides(left, right, figures, remarks)


def _swaps_sides(plugin: Plugin) -> bool:
    """Return True for ROS 1's legacy mode, in which `leftJoint` is the right wheel."""
    is_ros_1 = plugin.name == "gazebo_ros_diff_drive" and plugin.texts("leftJoint")
    modes = [text.strip().lower() for text in plugin.texts("legacyMode")]
    return bool(is_ros_1) and modes[:1] not in (["false"], ["0"])


def _unlimited(figures: Mapping[str, float], remark: str) -> tuple[str, ...]:
    return () if "acceleration" in figures else (remark,)


def _drivable(model: RobotModel, names: Sequence[str]) -> bool:
    return all(model.why_not_driven(name) is None for name in names)


def _joints(plugin: Plugin, tags: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for tag in tags for name in plugin.texts(tag)))


def _figures(plugin: Plugin, known: Mapping[str, tuple[str, float]]) -> dict[str, float]:
    """Return the parameters that are numbers above zero; zero means no limit."""
    found = {}
    for tag, text in plugin.parameters:
        name, factor = known.get(tag, ("", 0.0))
        if name and (value := _positive(text)) is not None:
            found[name] = factor * value
    return found


def _positive(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if value > 0 and math.isfinite(value) else None

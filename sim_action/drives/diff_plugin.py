"""What Gazebo's plugins for differential drives say in a model: which joints turn wheels, and figures.

Names are those of gazebo_ros_pkgs (ROS 1 and 2) and of gz-sim's DiffDrive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from sim_action.robot_model import Plugin, RobotModel

PLUGINS: Final = ("gazebo_ros_diff_drive", "gz-sim-diff-drive-system", "ignition-gazebo-diff-drive-system")

_LEFT: Final = ("leftJoint", "left_joint")
_RIGHT: Final = ("rightJoint", "right_joint")
# Tag -> the figure of a drive, and what it is in units of the tag.
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
}

_SWAPPED: Final = (
    "sides swapped, as gazebo_ros_diff_drive does without <legacyMode>false</legacyMode>, so that rightJoint is left"
)
# Wheels that reach their speed at once slip.
_NO_LIMIT: Final = "the plugin limits no acceleration of wheels, here it is 1 m/s^2"


@dataclass(frozen=True, slots=True)
class StatedWheels:
    """What a plugin says: joints, figures by the keys of `DiffDrive`, and what has to be told of how it is taken."""

    left: tuple[str, ...]
    right: tuple[str, ...]
    figures: dict[str, float]
    remarks: tuple[str, ...] = ()


def stated_by_plugin(model: RobotModel) -> StatedWheels | None:
    """What the first plugin says whose joints the model has."""
    for plugin in model.plugins:
        left, right = _joints(plugin, _LEFT), _joints(plugin, _RIGHT)
        if plugin.name not in PLUGINS or not left or not right:
            continue
        if all(model.why_not_driven(name) is None for name in (*left, *right)):
            return _meant(plugin, left, right)
    return None


def _meant(plugin: Plugin, left: tuple[str, ...], right: tuple[str, ...]) -> StatedWheels:
    remarks, figures = [], _figures(plugin)
    if _swaps_sides(plugin):
        left, right = right, left
        remarks.append(_SWAPPED)
    if "acceleration" not in figures:
        remarks.append(_NO_LIMIT)
    return StatedWheels(left, right, figures, tuple(remarks))


def _swaps_sides(plugin: Plugin) -> bool:
    """ROS 1 kept a mistake of its past for models that had made up for it: what is called left goes as the right."""
    is_ros_1 = plugin.name == "gazebo_ros_diff_drive" and plugin.texts("leftJoint")
    modes = [text.strip().lower() for text in plugin.texts("legacyMode")]
    return bool(is_ros_1) and modes[:1] not in (["false"], ["0"])


def _joints(plugin: Plugin, tags: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(name for tag in tags for name in plugin.texts(tag))


def _figures(plugin: Plugin) -> dict[str, float]:
    """Those that are numbers above zero; zero is how a plugin says that there is no limit."""
    found = {}
    for tag, text in plugin.parameters:
        name, factor = _FIGURES.get(tag, ("", 0.0))
        if name and (value := _positive(text)) is not None:
            found[name] = factor * value
    return found


def _positive(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if value > 0 and math.isfinite(value) else None

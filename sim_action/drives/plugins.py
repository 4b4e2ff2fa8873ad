"""Statements of a model about its drive: plugins of Gazebo and controllers of ros2_control, with their parameters.

The names come from gazebo_ros_pkgs (ROS 1 and 2), Gazebo classic's own plugins, gz-sim's systems (also as
ignition-gazebo, and by class), ros_controllers and ros2_controllers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, Literal

from sim_action.core.records import dataclass
from sim_action.robot.model.robot_model import Plugin, RobotModel

Kind = Literal["diff", "skid", "ackermann", "mecanum", "mover", "tracks", "velocity joint", "position joint"]
"""The effect of a plugin. A mover moves the base itself, without wheels; `tracks` move belts under it."""

DIFF_PLUGINS: Final[tuple[Kind, ...]] = ("diff",)
SKID_PLUGINS: Final[tuple[Kind, ...]] = ("skid", "diff")
"""Plugins of differential drives also accept several wheels per side."""

_LEGACY_DIFF: Final = "gazebo_ros_diff_drive"
_BY_NAME: Final[Mapping[str, Kind]] = {
    _LEGACY_DIFF: "diff",
    "DiffDrivePlugin": "diff",
    "gazebo_ros_skid_steer_drive": "skid",
    "SkidSteerDrivePlugin": "skid",
    "gazebo_ros_ackermann_drive": "ackermann",
    "gazebo_ros_planar_move": "mover",
    "SimpleTrackedVehiclePlugin": "tracks",
    "diff_drive_controller/DiffDriveController": "diff",
    "ackermann_steering_controller/AckermannSteeringController": "ackermann",
    "bicycle_steering_controller/BicycleSteeringController": "ackermann",
    "tricycle_steering_controller/TricycleSteeringController": "ackermann",
    "tricycle_controller/TricycleController": "ackermann",
    "mecanum_drive_controller/MecanumDriveController": "mecanum",
}
# hector_gazebo's plugin and its copies for robots with mecanum wheels (ridgeback_ros_..., nexus_ros_...) push the base.
_PUSHED: Final = "_force_based_move"
_SYSTEM: Final = re.compile(r"(?:gz-sim|ignition-gazebo)\d*-(.+)-system")
_BY_SYSTEM: Final[Mapping[str, Kind]] = {
    "diff-drive": "diff",
    "ackermann-steering": "ackermann",
    "mecanum-drive": "mecanum",
    "velocity-control": "mover",
    "tracked-vehicle": "tracks",
    "track-controller": "tracks",
    "joint-controller": "velocity joint",
    "joint-position-controller": "position joint",
}
_CLASS: Final = re.compile(r"(?:gz::sim|ignition::gazebo)::(?:v\d+::)?systems::(\w+)")
_BY_CLASS: Final[Mapping[str, Kind]] = {
    "DiffDrive": "diff",
    "AckermannSteering": "ackermann",
    "MecanumDrive": "mecanum",
    "VelocityControl": "mover",
    "TrackedVehicle": "tracks",
    "TrackController": "tracks",
    "JointController": "velocity joint",
    "JointPositionController": "position joint",
}

_LEFT: Final = (
    *("leftJoint", "left_joint", "leftFrontJoint", "leftRearJoint", "left_front", "left_rear"),
    *("left_wheel_names", "left_wheel"),
)
_RIGHT: Final = tuple(name.replace("left", "right") for name in _LEFT)
_CORNERS: Final = (
    ("front_left_joint", "front_left_wheel_command_joint_name"),
    ("front_right_joint", "front_right_wheel_command_joint_name"),
    ("back_left_joint", "rear_left_wheel_command_joint_name"),
    ("back_right_joint", "rear_right_wheel_command_joint_name"),
)
_STEERING: Final = ("left_steering_joint", "right_steering_joint", "steering_joints_names", "steering_joint_name")
_TRACTION: Final = (
    *("left_joint", "right_joint", "rear_left_joint", "rear_right_joint"),
    *("traction_joints_names", "traction_joint_name"),
)
# Controllers of older releases name axles; `front_steering` is true by default.
_AXLES: Final = ("front_wheels_names", "rear_wheels_names")

_SWAPPED: Final = (
    "sides swapped, as gazebo_ros_diff_drive does without <legacyMode>false</legacyMode>: rightJoint is the left wheel"
)
# Wheels that reach their speed in one step slip.
_NO_LIMIT: Final = "the plugin has no limit for wheel acceleration, so 1 m/s^2 is used"
_NO_LIMIT_AHEAD: Final = "the plugin has no limit for acceleration, so 1 m/s^2 is used"
_UNLIKE_WHEELS: Final = "the controller corrects the radii of the two sides differently, which is not simulated"
_ACCELERATIONS: Final = {
    "max_acceleration": ("acceleration", 1.0),
    "max_linear_acceleration": ("acceleration", 1.0),
    "linear.x.max_acceleration": ("acceleration", 1.0),
}
# Tag -> key of the drive, and the factor from the value of the tag.
_FIGURES: Final = {
    **_ACCELERATIONS,
    "wheelDiameter": ("radius", 0.5),
    "wheel_diameter": ("radius", 0.5),
    "wheel_radius": ("radius", 1.0),
    "wheelSeparation": ("separation", 1.0),
    "wheel_separation": ("separation", 1.0),
    "wheelAcceleration": ("acceleration", 1.0),
    "max_wheel_acceleration": ("acceleration", 1.0),
}
# Plugin -> the tag for the torque of a wheel; the other drives of Gazebo have none.
_TORQUES: Final[Mapping[str, tuple[str, ...]]] = {
    _LEGACY_DIFF: ("wheelTorque", "max_wheel_torque"),
    "DiffDrivePlugin": ("torque",),
    "gazebo_ros_skid_steer_drive": ("torque",),
    "SkidSteerDrivePlugin": ("MaxForce",),
}
_NAMES_OF_TORQUES: Final = frozenset(name for names in _TORQUES.values() for name in names)
_STEERING_FIGURES: Final = {
    **_ACCELERATIONS,
    "wheel_radius": ("radius", 1.0),
    "traction_wheels_radius": ("radius", 1.0),
    "traction_wheel_radius": ("radius", 1.0),
    "wheel_base": ("wheelbase", 1.0),
    "wheelbase": ("wheelbase", 1.0),
    "steering_limit": ("steering_limit", 1.0),
    "max_steer": ("steering_limit", 1.0),
}
_MECANUM_FIGURES: Final = {
    **_ACCELERATIONS,
    "wheel_radius": ("radius", 1.0),
    "kinematics.wheels_radius": ("radius", 1.0),
}


class NoDrive(Exception):
    """The wheels of a model do not look like a kind of drive; the message is the reason."""


@dataclass(frozen=True, slots=True)
class Stated:
    """The statements of a plugin."""

    joints: Mapping[str, tuple[str, ...]]  # by key of the drive
    figures: dict[str, float]  # parameters, by key of the drive
    remarks: tuple[str, ...] = ()  # on their interpretation
    source: str = ""  # the name and the place of the plugin

    @property
    def keys(self) -> dict[str, Any]:
        """The keys of the drive."""
        return {**self.joints, **self.figures}


def kind_of(plugin: Plugin) -> Kind | None:
    """Return the kind of a plugin or controller; None if it does not drive."""
    if plugin.name in _BY_NAME:
        return _BY_NAME[plugin.name]
    if plugin.name.endswith(_PUSHED):
        return "mover"
    system = _SYSTEM.fullmatch(plugin.name)
    named = _CLASS.fullmatch(plugin.title)
    if system and system[1] in _BY_SYSTEM:
        return _BY_SYSTEM[system[1]]
    return _BY_CLASS.get(named[1]) if named else None


def plugins_of_kind(model: RobotModel, *kinds: Kind) -> tuple[Plugin, ...]:
    """Return the plugins and controllers of these kinds, in the order of the model."""
    return tuple(plugin for plugin in model.plugins if kind_of(plugin) in kinds)


def source_of(plugin: Plugin) -> str:
    """Return the name and the place of a plugin or controller."""
    is_controller = "/" in plugin.name
    name = f"controller '{plugin.title}'" if is_controller else f"plugin {plugin.name or plugin.title}"
    return f"{name} at {plugin.location}" if plugin.location else name


def sides_by_plugin(model: RobotModel, kinds: Sequence[Kind]) -> Stated | None:
    """Return the statements of the first plugin of these kinds whose joints exist in the model, else None."""
    for plugin in plugins_of_kind(model, *kinds):
        left, right = _joints(model, plugin, _LEFT), _joints(model, plugin, _RIGHT)
        if left and right and _drivable(model, (*left, *right)):
            return _meant(plugin, left, right)
    return None


def steering_by_plugin(model: RobotModel) -> Stated | None:
    """Return the statements of the first Ackermann plugin whose joints exist in the model, else None."""
    for plugin in plugins_of_kind(model, "ackermann"):
        steering, wheels = _steering_and_wheels(model, plugin)
        if steering and wheels and _drivable(model, (*steering, *wheels)):
            figures = _figures(plugin, {**_STEERING_FIGURES, **_axle_figures(plugin)})
            joints = {"steering": steering, "wheels": wheels}
            return Stated(joints, figures, _unlimited(figures, _NO_LIMIT_AHEAD), source_of(plugin))
    return None


def corners_by_plugin(model: RobotModel) -> Stated | None:
    """Return the statements of the first mecanum plugin whose joints exist in the model, else None."""
    for plugin in plugins_of_kind(model, "mecanum"):
        corners = [name for tags in _CORNERS for name in _joints(model, plugin, tags)]
        if len(corners) == len(_CORNERS) and _drivable(model, corners):
            figures = _figures(plugin, _MECANUM_FIGURES)
            joints = {"left": (corners[0], corners[2]), "right": (corners[1], corners[3])}
            return Stated(joints, figures, _unlimited(figures, _NO_LIMIT_AHEAD), source_of(plugin))
    return None


def unusable_plugins(model: RobotModel) -> Iterator[str]:
    """Yield the reason why each plugin of a drive does not state the joints of one."""
    for plugin in plugins_of_kind(model, "diff", "skid", "ackermann", "mecanum"):
        corners = tuple(tag for tags in _CORNERS for tag in tags)
        tags = {"mecanum": corners, "ackermann": (*_STEERING, *_TRACTION, *_AXLES)}.get(kind_of(plugin) or "")
        names = _joints(model, plugin, tags or (*_LEFT, *_RIGHT))
        troubles = [trouble for name in names if (trouble := model.why_not_driven(name)) is not None]
        reason = troubles[0] if troubles else f"it names {', '.join(names) or 'no joints'}, which is too few"
        yield f"{source_of(plugin)} does not fit: {reason}"


def unread_parameters(model: RobotModel) -> Iterator[str]:
    """Yield the reason why each parameter file of a plugin is not read."""
    for plugin in model.plugins:
        for reason in plugin.unread:
            yield f"the controllers of {source_of(plugin)} are not known: {reason}"


def joints_by_plugin(model: RobotModel) -> dict[str, tuple[str, str]]:
    """Return joint -> (interface, source) for the joints that controllers of single joints in gz-sim drive."""
    joints = {}
    for plugin in plugins_of_kind(model, "velocity joint", "position joint"):
        interface = "velocity" if kind_of(plugin) == "velocity joint" else "position"
        for name in plugin.texts("joint_name"):
            joints[_in_model(model, name)] = (interface, source_of(plugin))
    return joints


def _steering_and_wheels(model: RobotModel, plugin: Plugin) -> tuple[tuple[str, ...], tuple[str, ...]]:
    front, rear = (_joints(model, plugin, (tag,)) for tag in _AXLES)
    if front and rear:
        return (front, rear) if _steers_in_front(plugin) else (rear, front)
    return _joints(model, plugin, _STEERING), _joints(model, plugin, _TRACTION)


def _steers_in_front(plugin: Plugin) -> bool:
    return plugin.texts("front_steering")[:1] not in (("False",), ("false",))


def _axle_figures(plugin: Plugin) -> dict[str, tuple[str, float]]:
    driven = "rear" if _steers_in_front(plugin) else "front"
    return {f"{driven}_wheels_radius": ("radius", 1.0), f"{driven}_wheel_radius": ("radius", 1.0)}


def _meant(plugin: Plugin, left: tuple[str, ...], right: tuple[str, ...]) -> Stated:
    torques = _TORQUES.get(plugin.name, ())
    figures, remarks = _corrected(plugin, _figures(plugin, {**_FIGURES, **dict.fromkeys(torques, ("torque", 1.0))}))
    remarks += tuple(_unread_torques(plugin, torques))
    remarks += _unlimited(figures, _NO_LIMIT)
    is_ros_1 = plugin.name == _LEGACY_DIFF and plugin.texts("leftJoint")
    modes = [text.strip().lower() for text in plugin.texts("legacyMode")]
    if bool(is_ros_1) and modes[:1] not in (["false"], ["0"]):
        left, right, remarks = right, left, (_SWAPPED, *remarks)
    return Stated({"left": left, "right": right}, figures, remarks, source_of(plugin))


def _unread_torques(plugin: Plugin, read: Sequence[str]) -> Iterator[str]:
    """Yield a remark on each tag for a torque that another plugin has."""
    for tag in dict.fromkeys(tag for tag, _ in plugin.parameters if tag in _NAMES_OF_TORQUES.difference(read)):
        meant = f"the tag is <{read[0]}>" if read else "it has no such tag"
        yield f"<{tag}> has no effect, as in Gazebo: {plugin.name} does not read it; {meant}"


def _corrected(plugin: Plugin, figures: dict[str, float]) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the parameters with the multipliers of a diff_drive_controller, and a remark on unequal ones."""
    factors = {
        name: value
        for name in ("wheel_separation", "wheel_radius", "left_wheel_radius", "right_wheel_radius")
        for text in plugin.texts(f"{name}_multiplier")
        if (value := number_above_zero(text)) is not None
    }
    left, right = (factors.get(f"{side}_wheel_radius", 1.0) for side in ("left", "right"))
    by_key = {"separation": factors.get("wheel_separation", 1.0), "radius": factors.get("wheel_radius", 1.0)}
    if left == right:
        by_key["radius"] *= left
    corrected = {key: value * by_key.get(key, 1.0) for key, value in figures.items()}
    return corrected, () if left == right else (_UNLIKE_WHEELS,)


def _unlimited(figures: Mapping[str, float], remark: str) -> tuple[str, ...]:
    return () if "acceleration" in figures else (remark,)


def _drivable(model: RobotModel, names: Sequence[str]) -> bool:
    return all(model.why_not_driven(name) is None for name in names)


def _joints(model: RobotModel, plugin: Plugin, tags: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(_in_model(model, name) for tag in tags for name in plugin.texts(tag)))


def _in_model(model: RobotModel, name: str) -> str:
    """Return the name of a joint in the whole model; a plugin of a nested model of SDF may leave its scope out."""
    if name in model.joints_by_name:
        return name
    nested = [joint.name for joint in model.joints if joint.name.endswith(f"::{name}")]
    return nested[0] if len(nested) == 1 else name


def _figures(plugin: Plugin, tags: Mapping[str, tuple[str, float]]) -> dict[str, float]:
    """Return the parameters that are numbers above zero; zero means no limit."""
    figures = {}
    for tag, text in plugin.parameters:
        name, factor = tags.get(tag, ("", 0.0))
        if name and (value := number_above_zero(text)) is not None:
            figures[name] = factor * value
    return figures


def number_above_zero(text: str) -> float | None:
    """Return the finite number above zero that a text states, else None."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if value > 0 and math.isfinite(value) else None

"""The Gazebo plugins that a robot's description asks for, and the table of supported plugins.

They are read from URDF, `<gazebo><plugin>` and `<gazebo reference="LINK"><sensor><plugin>`, and from SDF, where both
stand in models and links (classic.gazebosim.org, "Gazebo plugins in ROS").

The table "gazebo_ros" of `part_table` says which tags are read, harmless or lost. Names and defaults come from
gazebo_ros_pkgs for ROS Noetic and Gazebo's reader of URDF. A tag missing in the table is lost, too: it may be a typo.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final
from xml.etree.ElementTree import Element

from sim_action.core.geometry import Pose
from sim_action.core.records import dataclass
from sim_action.core.registry import Table
from sim_action.core.wording import did_you_mean
from sim_action.robot.documents.part_table import part_table
from sim_action.robot.documents.sdf_elements import pose_of
from sim_action.robot.documents.urdf_elements import plugin_name

_DRIVE: Final = "sim_action.ros.ros1.node.devices:open_drive"
_LASER: Final = "sim_action.ros.ros1.node.devices:open_laser"
_CAMERA: Final = "sim_action.ros.ros1.node.devices:open_camera"
_IMU: Final = "sim_action.ros.ros1.node.devices:open_imu"

PLUGINS: Final[Table[Callable[[Plugin, Any], Iterable[Any]]]] = Table(
    "plugin",
    {
        "gazebo_ros_diff_drive": _DRIVE,
        "gazebo_ros_skid_steer_drive": _DRIVE,
        "gazebo_ros_laser": _LASER,
        "gazebo_ros_gpu_laser": _LASER,
        "gazebo_ros_camera": _CAMERA,
        "gazebo_ros_openni_kinect": _CAMERA,
        "gazebo_ros_imu": _IMU,
        "gazebo_ros_imu_sensor": _IMU,
        "gazebo_ros_control": "sim_action.ros.ros1.node.control.manager:open_control",
        "gazebo_ros_planar_move": "sim_action.ros.ros1.node.devices:open_planar_move",
        "gazebo_ros_joint_state_publisher": "sim_action.ros.ros1.node.devices:open_joint_states",
        "gazebo_ros_p3d": "sim_action.ros.ros1.node.devices:open_ground_truth",
    },
)
"""Name of a plugin's file, without "lib" and ".so" -> function that opens its replacement."""

DRIVE_PLUGINS: Final = frozenset(
    {"gazebo_ros_control", "gazebo_ros_diff_drive", "gazebo_ros_planar_move", "gazebo_ros_skid_steer_drive"}
)
"""The plugins that move a robot. A model of a world with one of them is a robot, not a body."""

MAX_RATE_HZ: Final = 100.0  # messages per second that a topic can have: one for each tick of the clock
_RATES: Final = frozenset({"updateRate", "updateRateHZ", "odometryRate", "update_rate"})


@dataclass(frozen=True, slots=True)
class Tags:
    """The tags below an element, by name; `texts` reads several tags of one name."""

    element: Element | None

    def text(self, *names: str, default: str = "") -> str:
        """Return the text of the first of these tags that has one; a path such as `scan/horizontal` is allowed."""
        for name in names:
            tag = self.element.find(name) if self.element is not None else None
            if tag is not None and (tag.text or "").strip():
                return (tag.text or "").strip()
        return default

    def texts(self, name: str) -> tuple[str, ...]:
        """Return the texts of all tags of a name. A list with commas or spaces in one tag is several texts."""
        tags = self.element.findall(name) if self.element is not None else []
        return tuple(word for tag in tags for word in (tag.text or "").replace(",", " ").split())

    def number(self, *names: str, default: float) -> float:
        """Return the text of the first of these tags as a number."""
        try:
            return float(self.text(*names))
        except ValueError:
            return default

    def flag(self, *names: str, default: bool) -> bool:
        """Return the text of the first of these tags as true or false."""
        text = self.text(*names).lower()
        return text in {"true", "1"} if text else default


@dataclass(frozen=True, slots=True)
class Plugin:
    """A plugin of a model or of a sensor on a link; `own`: its tags; `given_space`: namespace of the spawn request."""

    name: str
    own: Tags
    sensor: Tags
    link: str
    given_space: str = ""

    @property
    def space(self) -> str:
        """Its namespace: "", or a name that begins with a slash."""
        names = self.own.text("robotNamespace", "ros/namespace", default=self.given_space).strip("/")
        return f"/{names}" if names else ""

    def topic(self, *names: str, default: str) -> str:
        """Return a topic, in the namespace of the plugin."""
        name = self.own.text(*names, default=default)
        return name if name.startswith("/") else f"{self.space}/{name}"


def plugins_of(root: Element, space: str = "") -> Iterator[Plugin]:
    """Yield all plugins in a robot's description; `space`: the namespace of the spawn request."""
    for parent in root.iter():
        link = parent.get("reference", parent.get("name", "")) if parent.tag in {"gazebo", "link"} else ""
        for plugin in parent.findall("plugin") if parent.tag in {"gazebo", "model"} else []:
            yield Plugin(plugin_name(plugin), Tags(plugin), Tags(None), "", space)
        for sensor in parent.findall("sensor"):
            for plugin in sensor.findall("plugin"):
                yield Plugin(plugin_name(plugin), Tags(plugin), Tags(sensor), link, space)


def base_in_model(root: Element, link: str) -> Pose:
    """Return the pose of a link in the frame of its SDF model. In URDF, the base link has the frame of the model."""
    for element in root.iter("link") if root.tag != "robot" else ():
        if element.get("name") == link and (pose := element.find("pose")) is not None and not pose.get("relative_to"):
            return pose_of(pose)
    return Pose()


LOST_FINDINGS: Final[Mapping[str, str]] = {
    "restitution": "nothing bounces",
    "passed-over": "a property in SDF is ignored",
    "two-frictions": "one coefficient of friction is used for all directions",
}
"""Rule of the audit of models -> the reason why its findings are losses of a launch."""

_APART: Final = frozenset({"plugin", "ros"})


def lost_robot_tags(root: Element) -> Iterator[str]:
    """Yield a message for each lost tag of `<gazebo>` in a URDF."""
    for gazebo in root.findall("gazebo"):
        owner = f'<gazebo reference="{gazebo.get("reference")}">' if gazebo.get("reference") else "<gazebo>"
        yield from _lost(gazebo, "gazebo", owner)


def lost_plugin_tags(plugin: Plugin) -> Iterator[str]:
    """Yield a message for each lost tag of a supported plugin, and of its sensor."""
    if plugin.own.element is not None:
        yield from _lost(plugin.own.element, plugin.name, f"the plugin {plugin.name}")
    place = f"{plugin.name}/sensor"
    if place in part_table("gazebo_ros").places and plugin.sensor.element is not None:
        owner = f"the sensor '{plugin.sensor.element.get('name', '')}' of {plugin.name}"
        yield from _lost(plugin.sensor.element, place, owner)


def _lost(holder: Element, place: str, owner: str) -> Iterator[str]:
    table = part_table("gazebo_ros")
    for part in table.unread(holder, place, _APART):
        # Programs do not read attributes.
        if part.name.startswith("@"):
            continue
        if part.row is None and part.place not in PLUGINS:
            hint = did_you_mean(part.name, table.places.get(part.place, ()))
            yield f"<{part.name}> of {owner} is not supported and has no effect{hint}"
        elif part.row is not None and part.row.is_lost(part.name, part.value):
            yield f"<{part.name}>{part.value}</{part.name}> of {owner} is not simulated: {part.row.text}"


def plugin_remarks(plugin: Plugin) -> Iterator[str]:
    """Yield a message for each tag that Gazebo's plugin does not read either, and for rates above the clock's rate."""
    table = part_table("gazebo_ros")
    for part in table.unread(plugin.own.element, plugin.name, _APART) if plugin.own.element is not None else ():
        if part.row is None and part.place == plugin.name and not part.name.startswith("@"):
            hint = did_you_mean(part.name, table.places[plugin.name])
            yield f"<{part.name}> of the plugin {plugin.name} has no effect, as in Gazebo{hint}"
    for holder, place in ((plugin.own.element, plugin.name), (plugin.sensor.element, f"{plugin.name}/sensor")):
        for tag in holder if holder is not None else ():
            row = table.row(place, tag.tag)
            text = (tag.text or "").strip()
            if tag.tag in _RATES and row is not None and row.effect == "read" and _is_above(text, MAX_RATE_HZ):
                yield f"<{tag.tag}>{text}</{tag.tag}> of {place}: messages come {MAX_RATE_HZ:g} times per second"


def _is_above(text: str, limit: float) -> bool:
    try:
        return float(text) > limit
    except ValueError:
        return False

"""The Gazebo plugins that a robot's description asks for, and the table of those that are supported.

They are read from URDF, `<gazebo><plugin>` and `<gazebo reference="LINK"><sensor><plugin>`, and from SDF, where both
stand in models and links (classic.gazebosim.org, "Gazebo plugins in ROS").
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final
from xml.etree.ElementTree import Element

from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.core.records import dataclass
from sim_action.core.registry import Table
from sim_action.world.world_files import plugin_name

if TYPE_CHECKING:
    from sim_action.ros.ros1.node.plugins import Opener

_DRIVE: Final = "sim_action.ros.ros1.node.drive_plugins:open_drive"
_LASER: Final = "sim_action.ros.ros1.node.sensor_plugins:open_laser"
_IMU: Final = "sim_action.ros.ros1.node.sensor_plugins:open_imu"

PLUGINS: Final[Table[Opener]] = Table(
    "plugin",
    {
        "gazebo_ros_diff_drive": _DRIVE,
        "gazebo_ros_skid_steer_drive": _DRIVE,
        "gazebo_ros_laser": _LASER,
        "gazebo_ros_gpu_laser": _LASER,
        "gazebo_ros_imu": _IMU,
        "gazebo_ros_imu_sensor": _IMU,
        "gazebo_ros_control": "sim_action.ros.ros1.node.control.manager:open_control",
        "gazebo_ros_planar_move": "sim_action.ros.ros1.node.drive_plugins:open_planar_move",
        "gazebo_ros_joint_state_publisher": "sim_action.ros.ros1.node.sensor_plugins:open_joint_states",
        "gazebo_ros_p3d": "sim_action.ros.ros1.node.sensor_plugins:open_ground_truth",
    },
)
"""Name of a plugin's file, without "lib" and ".so" -> function that opens its replacement."""

DRIVE_PLUGINS: Final = frozenset(
    {"gazebo_ros_control", "gazebo_ros_diff_drive", "gazebo_ros_planar_move", "gazebo_ros_skid_steer_drive"}
)
"""The plugins that move a robot. A model of a world with one of them is a robot, not a body."""


@dataclass(frozen=True, slots=True)
class Tags:
    """The tags below an element, by name; `texts` reads several tags of one name."""

    element: Element | None

    def text(self, *names: str, default: str = "") -> str:
        """Return the text of the first of these tags that has one; a path such as `scan/horizontal` is allowed."""
        for name in names:
            found = self.element.find(name) if self.element is not None else None
            if found is not None and (found.text or "").strip():
                return (found.text or "").strip()
        return default

    def texts(self, name: str) -> tuple[str, ...]:
        """Return the texts of all tags of a name. A list with commas or spaces in one tag is several texts."""
        found = self.element.findall(name) if self.element is not None else []
        return tuple(word for tag in found for word in (tag.text or "").replace(",", " ").split())

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
    """A plugin of a model or of a sensor.

    Attributes:
        name: its file, without "lib" and ".so".
        own: its own tags.
        sensor: the tags of its sensor; empty for a plugin of the model.
        link: the link that carries the sensor.
        given_space: the namespace from the spawn request; used if the plugin states none.
    """

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
            yield _plugin(plugin, None, "", space)
        for sensor in parent.findall("sensor"):
            for plugin in sensor.findall("plugin"):
                yield _plugin(plugin, sensor, link, space)


def base_in_model(root: Element, link: str) -> Pose:
    """Return the pose of a link in the frame of its SDF model. In URDF, the base link has the frame of the model."""
    for element in root.iter("link") if root.tag != "robot" else ():
        if element.get("name") == link and (pose := element.find("pose")) is not None and not pose.get("relative_to"):
            x, y, z, roll, pitch, yaw = map(float, (pose.text or "0 0 0 0 0 0").split())
            return Pose((x, y, z), quaternion_from_rpy(roll, pitch, yaw))
    return Pose()


def _plugin(element: Element, sensor: Element | None, link: str, space: str) -> Plugin:
    return Plugin(plugin_name(element), Tags(element), Tags(sensor), link, space)

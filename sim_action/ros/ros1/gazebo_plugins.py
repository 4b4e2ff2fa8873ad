"""The Gazebo plugins that a robot's description asks for, and the table of those that are supported.

They are read from URDF, `<gazebo><plugin>` and `<gazebo reference="LINK"><sensor><plugin>`, and from SDF, where both
stand in models and links (classic.gazebosim.org, "Gazebo plugins in ROS").

The tables of tags say what is read, has no effect, or is lost. Names and defaults are those of gazebo_ros_pkgs for ROS
Noetic and of Gazebo's reader of URDF. A tag that is not in the table is lost as well: it may be misspelt.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, Final
from xml.etree.ElementTree import Element

from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.core.records import dataclass
from sim_action.core.registry import Table
from sim_action.core.wording import did_you_mean
from sim_action.world.world_files import plugin_name
from sim_action.world.world_files.tags import READ, Row

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


MAX_RATE_HZ: Final = 100.0
"""Messages per second that a topic can have: one for each tick of the clock."""

_RATES: Final = frozenset({"updateRate", "updateRateHZ", "odometryRate", "update_rate"})

_ALWAYS: Final = Row("none", "plugins and sensors are always on")
_LOG: Final = Row("none", "it is a level of the log")
_SOLVER: Final = Row("none", "it is a parameter of Gazebo's engine")
_DRAWN: Final = Row("none", "it is only drawn")
_ZEROS: Final = ("0 0 0", "0 0 0 0 0 0")


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


def _read(*names: str) -> dict[str, Row]:
    return dict.fromkeys(names, READ)


_COMMON: Final[Mapping[str, Row]] = {
    **_read("robotNamespace", "ros"),
    "alwaysOn": _ALWAYS,
    "always_on": _ALWAYS,
    "rosDebugLevel": _LOG,
}
_ODOMETRY: Final = _read("commandTopic", "odometryTopic", "odometryFrame", "robotBaseFrame")
_WHEELS: Final = _read("wheelSeparation", "wheelDiameter", "updateRate")
_UNREAD: Final = Row("none", "Gazebo's plugin does not read it either; the drive has a remark on it")
_OFFSET: Final = {
    name: Row("lost", "the sensor is at the origin of its link", _ZEROS)
    for name in ("xyzOffset", "xyzOffsets", "rpyOffset", "rpyOffsets")
}
_LASER_TAGS: Final = {
    **_read("topicName", "frameName", "gaussianNoise"),
    "updateRate": Row("none", "the rate is that of the sensor"),
    "hokuyoMinIntensity": Row("none", "Gazebo does not use it either"),
}
_CAMERA_TAGS: Final = {
    **_read("cameraName", "imageTopicName", "cameraInfoTopicName", "frameName", "updateRate"),
    "hackBaseline": Row("lost", "there is one camera", ("0",)),
    **{
        name: Row("lost", "pictures have no distortion", ("0",))
        for name in ("distortionK1", "distortionK2", "distortionK3", "distortionT1", "distortionT2")
    },
    **{
        name: Row("lost", "the matrix follows from the field of view", ("0",))
        for name in ("CxPrime", "Cx", "Cy", "focalLength")
    },
    **{
        name: Row("none", "it acts only with a distortion, which is reported")
        for name in ("autoDistortion", "borderCrop")
    },
    "triggerTopicName": Row("lost", "pictures are taken at the rate of the camera"),
}
_IMU_TAGS: Final = {
    **_read("topicName", "frameName", "bodyName", "updateRate", "updateRateHZ", "gaussianNoise"),
    **_OFFSET,
    "serviceName": Row("none", "its service only resets an offset, which is always 0"),
    "initialOrientationAsReference": Row("lost", "the orientation is that in the world", ("false",)),
}

PLUGIN_TAGS: Final[Mapping[str, Mapping[str, Row]]] = MappingProxyType(
    {
        "gazebo_ros_diff_drive": {
            **_ODOMETRY,
            **_WHEELS,
            **_read("leftJoint", "rightJoint", "legacyMode", "publishTf", "publishOdomTF", "publishWheelJointState"),
            **_read("wheelAcceleration", "wheelTorque"),
            "torque": _UNREAD,
            "odometrySource": Row("lost", "odometry is the true motion, as with 'world'", ("world", "1")),
            "publishWheelTF": Row("lost", "use robot_state_publisher for the frames of wheels", ("false",)),
        },
        "gazebo_ros_skid_steer_drive": {
            **_ODOMETRY,
            **_WHEELS,
            **_read("leftFrontJoint", "rightFrontJoint", "leftRearJoint", "rightRearJoint", "broadcastTF"),
            **_read("torque"),
            **dict.fromkeys(("wheelAcceleration", "wheelTorque"), _UNREAD),
            **_read("covariance_x", "covariance_y", "covariance_yaw"),
        },
        "gazebo_ros_planar_move": {**_ODOMETRY, **_read("odometryRate", "cmdTimeout")},
        "gazebo_ros_laser": _LASER_TAGS,
        "gazebo_ros_gpu_laser": _LASER_TAGS,
        "gazebo_ros_camera": _CAMERA_TAGS,
        "gazebo_ros_imu": _IMU_TAGS,
        "gazebo_ros_imu_sensor": _IMU_TAGS,
        "gazebo_ros_control": {
            **_read("robotParam"),
            "controlPeriod": Row("none", "servos of the engine act at every step"),
            "legacyModeNS": Row("none", "topics are in the namespace of the robot"),
            "robotSimType": Row("lost", "only the default is supported", ("gazebo_ros_control/DefaultRobotHWSim",)),
            "eStopTopic": Row("lost", "there is no emergency stop"),
        },
        "gazebo_ros_joint_state_publisher": _read("jointName", "topicName", "updateRate"),
        "gazebo_ros_p3d": {
            **_read("bodyName", "topicName", "updateRate"),
            **_OFFSET,
            "frameName": Row("lost", "the pose is that in the world", ("world", "map", "/map", "/world")),
            "gaussianNoise": Row("lost", "the pose has no noise", ("0",)),
        },
    }
)
"""Plugin -> its own tags, in addition to the common ones."""

_SENSOR: Final[Mapping[str, Row]] = {
    **_read("plugin", "update_rate"),
    "always_on": _ALWAYS,
    "visualize": _DRAWN,
    "topic": Row("none", "the topic is that of the plugin"),
}
_LASER_SENSOR: Final[Mapping[str, Mapping[str, Row]]] = {
    "": {**_SENSOR, **_read("pose", "ray")},
    "ray": _read("scan", "range", "noise"),
    "scan": _read("horizontal", "vertical"),
    "horizontal": {
        **_read("samples", "min_angle", "max_angle"),
        "resolution": Row("lost", "each sample is one ray", ("1",)),
    },
    "vertical": {
        "samples": Row("lost", "a lidar scans one plane", ("1",)),
        "resolution": Row("none", "a plane has one row"),
        "min_angle": Row("lost", "a lidar scans its own xy plane", ("0",)),
        "max_angle": Row("lost", "a lidar scans its own xy plane", ("0",)),
    },
    "range": {**_read("min", "max"), "resolution": Row("none", "Gazebo does not round ranges either")},
    "noise": {
        **_read("stddev"),
        "type": Row("lost", "noise is Gaussian", ("gaussian", "none")),
        "mean": Row("lost", "noise has no mean", ("0",)),
        "bias_mean": Row("lost", "a lidar has no bias", ("0",)),
        "bias_stddev": Row("lost", "a lidar has no bias", ("0",)),
    },
}
_CAMERA_SENSOR: Final[Mapping[str, Mapping[str, Row]]] = {
    "": {**_SENSOR, **_read("pose", "camera")},
    "camera": {
        **_read("horizontal_fov", "image", "clip", "noise"),
        "lens": Row("lost", "the camera is a pinhole"),
        "distortion": Row("lost", "pictures have no distortion"),
    },
    "image": {
        **_read("width", "height"),
        "format": Row("lost", "pictures are rgb8", ("R8G8B8", "RGB_INT8")),
        "anti_aliasing": _DRAWN,
    },
    "clip": _read("near", "far"),
    "noise": {
        "type": Row("none", "without a deviation there is no noise"),
        **dict.fromkeys(("mean", "stddev"), Row("lost", "pictures have no noise", ("0",))),
    },
}
_IMU_NOISE: Final = Row("lost", "set <gaussianNoise> of the plugin instead", ("0",))
_AXES: Final = _read("x", "y", "z")
_IMU_SENSOR: Final[Mapping[str, Mapping[str, Row]]] = {
    "": {**_SENSOR, **_read("imu"), "pose": Row("lost", "the sensor is at the origin of its link", _ZEROS)},
    "imu": {
        **_read("angular_velocity", "linear_acceleration"),
        "topic": Row("none", "the topic is that of the plugin"),
        "enable_orientation": Row("none", "a message always has an orientation"),
        "noise": _IMU_NOISE,
        "orientation_reference_frame": Row("lost", "the orientation is that in the world"),
    },
    "angular_velocity": _AXES,
    "linear_acceleration": _AXES,
    "x": _read("noise"),
    "y": _read("noise"),
    "z": _read("noise"),
    "noise": {
        "type": Row("none", "without a deviation there is no noise"),
        "dynamic_bias_stddev": _IMU_NOISE,
        "dynamic_bias_correlation_time": Row("none", "it acts only with a bias, which is reported"),
        **dict.fromkeys(("mean", "stddev", "bias_mean", "bias_stddev"), _IMU_NOISE),
    },
}
_SENSOR_TAGS: Final = {
    "gazebo_ros_laser": _LASER_SENSOR,
    "gazebo_ros_gpu_laser": _LASER_SENSOR,
    "gazebo_ros_camera": _CAMERA_SENSOR,
    "gazebo_ros_imu_sensor": _IMU_SENSOR,
}

GAZEBO_TAGS: Final[Mapping[str, Row]] = MappingProxyType(
    {
        **_read("mu1", "mu2", "plugin"),
        "sensor": Row("none", "without a plugin it publishes nothing for nodes, and plugins are reported"),
        "material": _DRAWN,
        "visual": _DRAWN,
        **dict.fromkeys(("kp", "kd", "minDepth", "maxVel", "maxContacts", "implicitSpringDamper"), _SOLVER),
        **dict.fromkeys(("stopCfm", "stopErp", "fudgeFactor", "cfmDamping"), _SOLVER),
        "fdir1": Row("none", "it matters only if <mu1> and <mu2> differ, which is reported"),
        "provideFeedback": Row("none", "only plugins use it, and they are reported"),
        "preserveFixedJoint": Row("none", "every link keeps its own frame"),
        "disableFixedJointLumping": Row("none", "every link keeps its own frame"),
        "springReference": Row("none", "it acts only with a stiffness, which is reported"),
        "springStiffness": Row("lost", "joints have no springs", ("0",)),
        "dampingFactor": Row("lost", "the motion is not damped", ("0",)),
        "turnGravityOff": Row("lost", "every link has weight", ("false",)),
        "gravity": Row("lost", "every link has weight", ("true",)),
        "static": Row("lost", "the robot can move", ("false",)),
        "selfCollide": Row("lost", "links of one robot do not collide", ("false",)),
        "self_collide": Row("lost", "links of one robot do not collide", ("false",)),
        "laserRetro": Row("lost", "lidars measure no intensity", ("0",)),
    }
)
"""Tags of `<gazebo>` in URDF."""

LOST_FINDINGS: Final[Mapping[str, str]] = {
    "restitution": "nothing bounces",
    "passed-over": "a property in SDF is ignored",
    "two-frictions": "one coefficient of friction is used for all directions",
}
"""Rule of the audit of models -> the reason why its findings are losses of a launch."""


def lost_robot_tags(root: Element) -> Iterator[str]:
    """Yield a message for each lost tag of `<gazebo>` in a URDF."""
    for gazebo in root.findall("gazebo"):
        owner = f'<gazebo reference="{gazebo.get("reference")}">' if gazebo.get("reference") else "<gazebo>"
        yield from _lost(gazebo, GAZEBO_TAGS, owner)


def lost_plugin_tags(plugin: Plugin) -> Iterator[str]:
    """Yield a message for each lost tag of a supported plugin, and of its sensor."""
    if plugin.own.element is not None:
        yield from _lost(plugin.own.element, {**_COMMON, **PLUGIN_TAGS[plugin.name]}, f"the plugin {plugin.name}")
    tables = _SENSOR_TAGS.get(plugin.name)
    if tables is not None and plugin.sensor.element is not None:
        owner = f"the sensor '{plugin.sensor.element.get('name', '')}' of {plugin.name}"
        yield from _lost_below(plugin.sensor.element, tables[""], tables, owner)


def _lost_below(
    holder: Element, rows: Mapping[str, Row], tables: Mapping[str, Mapping[str, Row]], owner: str
) -> Iterator[str]:
    yield from _lost(holder, rows, owner)
    for tag in holder:
        if tag.tag in tables and rows.get(tag.tag) is READ:
            yield from _lost_below(tag, tables[tag.tag], tables, owner)


def _lost(tags: Iterable[Element], rows: Mapping[str, Row], owner: str) -> Iterator[str]:
    for tag in tags:
        row, text = rows.get(tag.tag), (tag.text or tag.get("value") or "").strip()
        if row is None:
            yield f"<{tag.tag}> of {owner} is not supported and has no effect{did_you_mean(tag.tag, rows)}"
        elif row.is_lost(text, moves=True):
            yield f"<{tag.tag}>{text}</{tag.tag}> of {owner} is not simulated: {row.reason}"
        elif tag.tag in _RATES and row.effect == "read" and _is_above(text, MAX_RATE_HZ):
            most = f"{MAX_RATE_HZ:g} times per second at most"
            yield f"<{tag.tag}>{text}</{tag.tag}> of {owner} is not reached: messages are published {most}"


def _is_above(text: str, limit: float) -> bool:
    try:
        return float(text) > limit
    except ValueError:
        return False

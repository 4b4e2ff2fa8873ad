"""ROS 2 messages without ROS: definitions, CDR encoding (little-endian, numbers aligned to their size), topics, frames.

Messages that differ only in numbers are encoded together as columns, because a run has thousands of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, field
from sim_action.core.wording import free_name
from sim_action.recording.export.recorded_run import RecordedRun

# The header of the plain little-endian encoding (OMG DDSI-RTPS 10.2); alignment is relative to its end.
_HEADER: Final = b"\x00\x01\x00\x00"


class CdrForm:
    """A template for messages, built field by field, with gaps for the numbers that vary."""

    def __init__(self) -> None:
        self._text = bytearray()
        self._gaps: list[tuple[int, np.dtype[np.generic], int]] = []

    def string(self, text: str) -> Self:
        """Append a text that is the same in every message."""
        encoded = text.encode(errors="replace").replace(b"\0", b"") + b"\0"
        self.fixed("<u4", len(encoded))
        self._text += encoded
        return self

    def strings(self, *texts: str) -> Self:
        """Append a sequence of texts that is the same in every message."""
        self.fixed("<u4", len(texts))
        for text in texts:
            self.string(text)
        return self

    def fixed(self, kind: str, *numbers: float) -> Self:
        """Append numbers that are the same in every message; `kind` is a numpy type such as "<f8"."""
        self._align(np.dtype(kind).itemsize)
        self._text += np.array(numbers, dtype=kind).tobytes()
        return self

    def gap(self, kind: str, count: int = 1) -> Self:
        """Append a gap for numbers that vary from message to message."""
        dtype: np.dtype[np.generic] = np.dtype(kind)
        if count:
            self._align(dtype.itemsize)
            self._gaps.append((len(self._text), dtype, count))
            self._text += bytes(dtype.itemsize * count)
        return self

    def filled(self, messages: int, *columns: ArrayLike) -> list[bytes]:
        """Return N messages; `columns` has (N, n) numbers for each gap of n numbers, or (N,) for a single number."""
        table = np.tile(np.frombuffer(_HEADER + bytes(self._text), dtype=np.uint8), (messages, 1))
        for (offset, dtype, count), column in zip(self._gaps, columns, strict=True):
            numbers = np.ascontiguousarray(np.asarray(column).reshape(messages, count).astype(dtype))
            first = len(_HEADER) + offset
            table[:, first : first + dtype.itemsize * count] = numbers.view(np.uint8).reshape(messages, -1)
        whole, size = table.tobytes(), table.shape[1]
        return [whole[start : start + size] for start in range(0, len(whole), size)]

    def _align(self, size: int) -> None:
        self._text += bytes(-len(self._text) % size)


_FIELDS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
        "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
        "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
        "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
        "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
        "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
        "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
        "geometry_msgs/TransformStamped": (
            "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform"
        ),
        "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
        "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance",
        "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
        "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque",
        "geometry_msgs/WrenchStamped": "std_msgs/Header header\ngeometry_msgs/Wrench wrench",
        "nav_msgs/Odometry": (
            "std_msgs/Header header\nstring child_frame_id\n"
            "geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist"
        ),
        "rosgraph_msgs/Clock": "builtin_interfaces/Time clock",
        "sensor_msgs/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data",
        "sensor_msgs/Imu": (
            "std_msgs/Header header\n"
            "geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
            "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
            "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance"
        ),
        "sensor_msgs/JointState": (
            "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort"
        ),
        "sensor_msgs/LaserScan": (
            "std_msgs/Header header\nfloat32 angle_min\nfloat32 angle_max\nfloat32 angle_increment\n"
            "float32 time_increment\nfloat32 scan_time\nfloat32 range_min\nfloat32 range_max\n"
            "float32[] ranges\nfloat32[] intensities"
        ),
        "std_msgs/ColorRGBA": "float32 r\nfloat32 g\nfloat32 b\nfloat32 a",
        "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
        "std_msgs/String": "string data",
        "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
        "visualization_msgs/Marker": (
            "int32 ARROW=0\nint32 CUBE=1\nint32 SPHERE=2\nint32 CYLINDER=3\nint32 LINE_STRIP=4\nint32 LINE_LIST=5\n"
            "int32 CUBE_LIST=6\nint32 SPHERE_LIST=7\nint32 POINTS=8\nint32 TEXT_VIEW_FACING=9\n"
            "int32 MESH_RESOURCE=10\nint32 TRIANGLE_LIST=11\nint32 ARROW_STRIP=12\n"
            "int32 ADD=0\nint32 MODIFY=0\nint32 DELETE=2\nint32 DELETEALL=3\n"
            "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n"
            "geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\n"
            "bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\n"
            "string texture_resource\nsensor_msgs/CompressedImage texture\n"
            "visualization_msgs/UVCoordinate[] uv_coordinates\nstring text\n"
            "string mesh_resource\nvisualization_msgs/MeshFile mesh_file\nbool mesh_use_embedded_materials"
        ),
        "visualization_msgs/MarkerArray": "visualization_msgs/Marker[] markers",
        "visualization_msgs/MeshFile": "string filename\nuint8[] data",
        "visualization_msgs/UVCoordinate": "float32 u\nfloat32 v",
    }
)
_NAMED: Final = re.compile(r"^([a-z0-9_]+/[A-Za-z0-9]+)", re.MULTILINE)
_BETWEEN: Final = "=" * 80


def definition(name: str) -> str:
    """Return the definition of a type such as "std_msgs/String", with all nested types, in the form of logs."""
    first, *others = _closure(name)
    parts = [_FIELDS[first], *(f"MSG: {other}\n{_FIELDS[other]}" for other in others)]
    return f"\n{_BETWEEN}\n".join(parts) + "\n"


def full_name(name: str) -> str:
    """Return the ROS 2 name of a type: "std_msgs/msg/String"."""
    package, _, plain = name.partition("/")
    return f"{package}/msg/{plain}"


def _closure(name: str) -> Iterator[str]:
    """Yield a type and its nested types, each once."""
    waiting, seen = [name], {name}
    while waiting:
        message_type = waiting.pop(0)
        yield message_type
        used = [other for other in _NAMED.findall(_FIELDS[message_type]) if other not in seen]
        waiting += dict.fromkeys(used)
        seen.update(used)


_NANOSECONDS = 1_000_000_000


def _offered(depth: int, durability: int) -> str:
    """Return a reliable profile of the last `depth` messages, in numbers, which all versions of rosbag2 read."""
    forever = "{sec: 9223372036, nsec: 854775807}"
    numbers = f"history: 1, depth: {depth}, reliability: 1, durability: {durability}, liveliness: 1"
    times = ", ".join(f"{name}: {forever}" for name in ("deadline", "lifespan", "liveliness_lease_duration"))
    return f"[{{{numbers}, {times}, avoid_ros_namespace_conventions: false}}]"


_LATCHED: Final = _offered(1, 1)
_VOLATILE: Final = _offered(10, 2)


@dataclass(frozen=True)
class Topic:
    """All messages of one topic."""

    name: str
    type: str  # the message type, such as "std_msgs/String"
    time: NDArray[np.int64]  # the sim time of each message in ns
    messages: list[bytes]  # the encoded messages
    about: dict[str, str] = field(default_factory=dict)  # metadata of the channel, for people
    is_latched: bool = False  # True if a subscriber that comes later gets the last message: durability transient_local

    @property
    def metadata(self) -> dict[str, str]:
        """The metadata of its channel, as `ros2 bag record` writes it: the offered quality of service."""
        return {**self.about, "offered_qos_profiles": _LATCHED if self.is_latched else _VOLATILE}


def nanoseconds(time: ArrayLike) -> NDArray[np.int64]:
    """Return times (N,) in ns for times (N,) in s."""
    return np.rint(np.asarray(time, dtype=np.float64) * _NANOSECONDS).astype(np.int64)


def stamps(time: FloatArray) -> NDArray[np.int64]:
    """Return (N, 2) builtin_interfaces/Time, seconds and nanoseconds, for times (N,) in s."""
    return np.column_stack(np.divmod(nanoseconds(time), _NANOSECONDS))


@dataclass(frozen=True, slots=True)
class Frames:
    """The names of the coordinate frames of a log, all distinct: a name that is also a link gets a suffix."""

    map: str  # the world frame
    odom: str  # the origin of the wheel odometry
    base: str  # the base link of the robot
    bodies: Mapping[str, str]  # name of a body of the world -> its frame
    sensors: Mapping[str, str]  # name of a sensor -> its frame

    @classmethod
    def of(cls, run: RecordedRun) -> Frames:
        """Return the frames of a run."""
        model = run.scene.model
        taken = {link.name for link in model.links}
        return cls(
            free_name("map", taken),
            free_name("odom", taken),
            model.root,
            {
                name: free_name(name, taken)
                for name in (*(body.name for body in run.scene.world.objects), *run.scene.frames)
            },
            {mounted.name: free_name(mounted.name, taken) for mounted in run.sensors},
        )

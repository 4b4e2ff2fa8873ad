"""The topics of a robot in ROS 2, as users of ros_gz_bridge know them, and its frames for /tf and /tf_static.

`odom` is the parent of the base link, as a differential drive publishes it. Links have the frames of a
robot_state_publisher. A sensor has a frame of its own if its pose on the link is stated. A camera always has one,
because its messages are in an optical frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, cast

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.core.records import dataclass
from sim_action.core.wording import FirstFew, free_name
from sim_action.core.yaml_document import SpecProblems
from sim_action.drives import Drive, recognise
from sim_action.recording.export.ros2_markers import urdf_of
from sim_action.robot.model.joint_selection import setting_problems
from sim_action.robot.model.robot_model import Joint
from sim_action.ros import robot_topics
from sim_action.ros.messages import (
    OPTICAL,
    Message,
    Messages,
    camera_info_message,
    each_reading,
    image_message,
    imu_message,
    joint_states_message,
    odometry_message,
    scan_message,
    transforms_message,
    when_due,
)
from sim_action.ros.robot_topics import (
    COMMANDS,
    JOINTS,
    ODOMETRY,
    LinkFrames,
    PlacedFrame,
    Schedule,
    in_frame_of,
    plain_name,
)
from sim_action.ros.ros2.graph import LATCHED, TRANSFORMS, USUAL, Qos
from sim_action.ros.ros2.received_commands import (
    Subscription,
    any_joints_subscription,
    controller_subscription,
    twist_subscription,
)
from sim_action.scenario.model import DrivenRobot
from sim_action.state.observation import Observation
from sim_action.world.scene import Fitting, Scene

if TYPE_CHECKING:
    from sim_action.ros.ros2.spec import JointController

_ODOM: Final = "odom"

# Kinds of sensors whose messages have no frame of their own: odometry uses the frame of the base.
_WITHOUT_FRAME: Final = frozenset({"odometry", "contact"})

STATES_RATE_HZ: Final = 50.0
"""The rate of odometry, transforms and joint states; Gazebo's differential drive has it by default."""

TRAJECTORIES: Final = "joint_trajectory"
DESCRIPTION: Final = "/robot_description"
TRANSFORM_TOPICS: Final = frozenset({"/tf", "/tf_static"})  # the topics that all robots share

# They have one type each, and no key.
_OF_ALL_ROBOTS: Final = frozenset({"/clock", "/parameter_events", "/robot_description", "/rosout", "/tf", "/tf_static"})

_Controllers = Mapping[str, "JointController"]
_NO_CONTROLLERS: Final[_Controllers] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class RobotFrames:
    """The frames of a robot; `sensors`: name -> frame of its messages; `mounted`: frames of sensors on their links."""

    odom: str
    base: str
    sensors: Mapping[str, str]
    mounted: tuple[PlacedFrame, ...]
    links: LinkFrames

    @classmethod
    def of(cls, scene: Scene, space: str = "") -> RobotFrames:
        """Return the frames of a robot in a namespace `space`, with distinct names: one that is taken gets a suffix."""
        model, prefix = scene.model, f"{space[1:]}/" if space else ""
        taken = {link.name for link in model.links}
        odom = free_name(_ODOM, taken)
        frames = {sensor.name: _frame_of(sensor, taken) for sensor in scene.sensors}
        mounted = _mounted(scene.sensors, frames)
        return cls(
            prefix + odom,
            prefix + model.root,
            {name: prefix + frame for name, frame in frames.items()},
            tuple((prefix + link, prefix + frame, pose) for link, frame, pose in mounted),
            LinkFrames.of(model, prefix),
        )


def _frame_of(sensor: Fitting, taken: set[str]) -> str:
    if sensor.kind == "camera":
        return free_name(f"{plain_name(sensor.name)}_optical_frame", taken)
    if sensor.pose == Pose() or sensor.kind in _WITHOUT_FRAME:
        return sensor.link
    return free_name(f"{plain_name(sensor.name)}_frame", taken)


def _mounted(sensors: tuple[Fitting, ...], frames: Mapping[str, str]) -> Iterator[PlacedFrame]:
    for sensor in sensors:
        if sensor.kind == "camera":
            yield sensor.link, frames[sensor.name], geometry.compose(sensor.pose, OPTICAL)
        elif frames[sensor.name] != sensor.link:
            yield sensor.link, frames[sensor.name], sensor.pose


@dataclass(frozen=True, slots=True)
class Publisher:
    """A topic that the robot publishes; `type`: such as "nav_msgs/msg/Odometry"."""

    topic: str
    type: str
    message: Messages
    qos: Qos = USUAL


CLOCK_TYPE: Final = "rosgraph_msgs/msg/Clock"
CLOCK_QOS: Final = USUAL


@dataclass(frozen=True, slots=True)
class Channels:
    """All topics of a robot except its clock."""

    publishers: tuple[Publisher, ...] = ()
    subscriptions: tuple[Subscription, ...] = ()

    @property
    def published(self) -> frozenset[str]:
        """The topics that the robot publishes."""
        return frozenset(publisher.topic for publisher in self.publishers)

    @property
    def commands(self) -> frozenset[str]:
        """The topics on which the robot takes commands."""
        return frozenset(subscription.topic for subscription in self.subscriptions)


def topics_of(
    scene: Scene, stated: Mapping[str, str], controllers: _Controllers = _NO_CONTROLLERS, space: str = ""
) -> dict[str, str]:
    """Return the topics of a robot by their keys, with the stated ones; names without a "/" in front are in `space`.

    The keys are `cmd_vel` (with a drive), `odom` (unless the base is fixed, or a sensor measures odometry),
    `joint_states` (with joints), the names of controllers, or else `joint_trajectory` (with joints that the drive
    does not use), and the names of sensors.
    """
    usual = dict(robot_topics.ROBOT_TOPICS)
    usual |= {name: controller.topic(name) for name, controller in controllers.items()}
    if not controllers and _free_joints(scene):
        usual[TRAJECTORIES] = "/joint_trajectory"
    if _drive_of(scene) is None:
        del usual[COMMANDS]
    if scene.bolted:
        del usual[ODOMETRY]
    if not scene.model.moving_joints:
        del usual[JOINTS]
    topics = robot_topics.topics_of(scene.sensors, stated, usual)
    return {key: topic if stated.get(key, "").startswith("/") else f"{space}{topic}" for key, topic in topics.items()}


def topic_problems(
    scene: Scene, stated: Mapping[str, str], controllers: _Controllers = _NO_CONTROLLERS, space: str = ""
) -> SpecProblems:
    """Yield problems of stated topics, by their keys: unknown names, and topics that are used twice."""
    topics = topics_of(scene, stated, controllers, space)
    yield from robot_topics.topic_problems(stated, topics)
    for name in (name for name in stated if name in topics):
        if topics[name] in _OF_ALL_ROBOTS:
            yield (name,), f"'{topics[name]}' is a topic that every robot has; choose another one"
    cameras = {sensor.name: _beside_images(topics[sensor.name]) for sensor in scene.sensors if sensor.kind == "camera"}
    for name in (name for name in stated if name in topics):
        mine = {topics[name], *cameras.get(name, ())}
        for other, beside in cameras.items():
            if other != name and (shared := sorted(mine.intersection(beside))):
                yield (name,), f"'{shared[0]}' is already a topic of the camera '{other}'"


def controller_problems(scene: Scene, controllers: _Controllers) -> SpecProblems:
    """Yield problems of controllers, by their names and keys: names of other topics, and joints that do not fit."""
    taken = topics_of(scene, {}).keys() - {TRAJECTORIES}
    for name in sorted(taken & controllers.keys()):
        yield (name,), f"'{name}' is already the name of another topic of the robot; choose another name"
    hinted = FirstFew()
    first = dict[str, str]()
    for name, controller in controllers.items():
        key = (name, controller.kind)
        problems = list(setting_problems(scene.model, dict.fromkeys(controller.names, 0.0), hinted))
        yield from ((key, message) for _, message in problems)
        for joint in controller.joints(scene.model):
            if (why := scene.model.why_not_driven(joint)) is not None:
                yield key, why
            elif (other := first.setdefault(joint, name)) != name:
                yield key, f"joint '{joint}' already obeys the controller '{other}'"


def channels(
    scene: Scene,
    stated: Mapping[str, str],
    rate: float,
    controllers: _Controllers = _NO_CONTROLLERS,
    *,
    described: bool = False,
    space: str = "",
) -> Channels:
    """Return the topics of a robot, of which the scenario states some by their keys; `rate`: ticks per second.

    `space`: the namespace of topics and frames, such as "/robot2"; or empty.
    `described`: True if another node publishes /robot_description. Then it is a robot_state_publisher, which publishes
    the frames of links, too.
    """
    topics = topics_of(scene, stated, controllers, space)
    frames = RobotFrames.of(scene, space)
    description = None if described else f"{space}{DESCRIPTION}"
    publishers = [*_states(scene, topics, frames, rate, description=description), *_sensors(scene, topics, frames)]
    return Channels(tuple(publishers), tuple(_subscriptions(scene, topics, controllers)))


def _subscriptions(scene: Scene, topics: Mapping[str, str], controllers: _Controllers) -> Iterator[Subscription]:
    if COMMANDS in topics:
        yield twist_subscription(COMMANDS, topics[COMMANDS])
    for name, controller in controllers.items():
        yield controller_subscription(name, topics[name], controller, scene.model)
    if TRAJECTORIES in topics and TRAJECTORIES not in controllers:
        yield any_joints_subscription(TRAJECTORIES, topics[TRAJECTORIES], _free_joints(scene))


def _drive_of(scene: Scene) -> Drive | None:
    stated = scene.robot.drive if isinstance(scene.robot, DrivenRobot) else None
    return stated or recognise(scene.model)


def _free_joints(scene: Scene) -> tuple[Joint, ...]:
    """Return the joints that can be driven, except the joints of the drive."""
    drive, model = _drive_of(scene), scene.model
    is_valid = drive is not None and not any(drive.problems(model))
    driven = drive.open(model, scene.physics.rate).joints if drive is not None and is_valid else frozenset()
    return tuple(joint for joint in model.motor_joints if joint.mimic is None and joint.name not in driven)


def states_schedule(rate: float) -> Schedule:
    """Return the ticks of odometry, transforms and joint states: evenly spaced, at most STATES_RATE_HZ."""
    return Schedule.of(rate / math.ceil(rate / STATES_RATE_HZ - 1e-9), rate)


def _states(
    scene: Scene, topics: Mapping[str, str], frames: RobotFrames, rate: float, *, description: str | None
) -> Iterator[Publisher]:
    """Yield the states of a robot; `description`: the topic of its URDF, None if another node publishes it."""
    schedule, described = states_schedule(rate), description is None
    if JOINTS in topics:
        names = [joint.name for joint in scene.model.moving_joints]

        def joint_states(seen: Observation) -> Message:
            return joint_states_message(seen.time, {name: seen.joints[name] for name in names})

        yield Publisher(topics[JOINTS], "sensor_msgs/msg/JointState", when_due(schedule, joint_states))
    if ODOMETRY in topics:

        def truth(seen: Observation) -> Message:
            twist = in_frame_of(seen.pose, seen.twist)
            return odometry_message(seen.time, (frames.odom, frames.base), seen.pose, twist)

        yield Publisher(topics[ODOMETRY], "nav_msgs/msg/Odometry", when_due(schedule, truth))
    links = () if described else frames.links.fixed
    fixed = [*links, *frames.mounted]
    yield Publisher(
        "/tf", "tf2_msgs/msg/TFMessage", _transforms(scene, frames, schedule, links=not described), TRANSFORMS
    )
    if fixed:
        static = transforms_message(0.0, fixed)
        yield Publisher("/tf_static", "tf2_msgs/msg/TFMessage", _once(static), LATCHED)
    if description is not None:
        text = scene.model.urdf or urdf_of(scene.model)
        yield Publisher(description, "std_msgs/msg/String", _once({"data": text}), LATCHED)


def _once(message: Message) -> Messages:
    return lambda tick, _: message if tick == 0 else None


def _transforms(scene: Scene, frames: RobotFrames, schedule: Schedule, *, links: bool) -> Messages:
    """Return the messages of /tf: odom to base at each state or reading of odometry, and links at each state."""
    odometry = next((sensor.name for sensor in scene.sensors if sensor.kind == "odometry"), None)
    measured = None
    if odometry is not None:
        frame = frames.odom, frames.base
        measured = each_reading(odometry, lambda reading: transforms_message(reading.time, [(*frame, reading.pose)]))

    def message(tick: int, seen: Observation) -> Message | None:
        transforms: list[Message] = []
        is_due = schedule.is_due(tick)
        if measured is not None:
            transforms += (measured(tick, seen) or {"transforms": []})["transforms"]
        elif is_due and not scene.bolted:
            transforms += _placed(seen.time, [(frames.odom, frames.base, seen.pose)])
        if is_due and links:
            transforms += _placed(
                seen.time, frames.links.at({name: joint.position for name, joint in seen.joints.items()})
            )
        return {"transforms": transforms} if transforms else None

    return message


def _placed(time: float, frames: Iterable[PlacedFrame]) -> list[Message]:
    transforms: list[Message] = transforms_message(time, frames)["transforms"]
    return transforms


def _beside_images(topic: str) -> tuple[str, str, str]:
    space = topic.rpartition("/")[0]
    return f"{space}/camera_info", f"{space}/depth/image_raw", f"{space}/depth/camera_info"


def _sensors(scene: Scene, topics: Mapping[str, str], frames: RobotFrames) -> Iterator[Publisher]:
    for sensor in (sensor for sensor in scene.sensors if sensor.name in topics):
        all_topics = (topics[sensor.name], *_beside_images(topics[sensor.name]))
        for topic, (kind, made) in zip(all_topics, _messages_of(sensor, frames), strict=False):
            yield Publisher(topic, kind, each_reading(sensor.name, made))


def _messages_of(sensor: Fitting, frames: RobotFrames) -> Sequence[tuple[str, Callable[[Any], Message]]]:
    """Return type and message of each topic of a sensor; a camera has several."""
    frame, keys, odometry = frames.sensors[sensor.name], cast(Any, sensor.keys), (frames.odom, frames.base)
    image, info = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
    rows: Mapping[str, Sequence[tuple[str, Callable[[Any], Message]]]] = {
        "lidar": [
            ("sensor_msgs/msg/LaserScan", lambda reading: scan_message(reading.time, frame, reading, 1 / sensor.rate))
        ],
        "imu": [
            (
                "sensor_msgs/msg/Imu",
                lambda reading: imu_message(reading.time, frame, reading, (keys.gyro_noise, keys.accelerometer_noise)),
            )
        ],
        "odometry": [
            (
                "nav_msgs/msg/Odometry",
                lambda reading: odometry_message(reading.time, odometry, reading.pose, reading.twist),
            )
        ],
        "contact": [("std_msgs/msg/Bool", lambda reading: {"data": reading.touching})],
        "camera": [
            (image, lambda reading: image_message(reading.time, frame, reading.rgb)),
            (info, lambda reading: camera_info_message(reading.time, frame, keys)),
            (
                image,
                lambda reading: image_message(reading.time, frame, reading.depth.astype("<f4", copy=False), "32FC1"),
            ),
            (info, lambda reading: camera_info_message(reading.time, frame, keys)),
        ],
    }
    return rows[sensor.kind]

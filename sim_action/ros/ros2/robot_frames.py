"""The coordinate frames of a robot for /tf and /tf_static: odom, base, links, sensors.

`odom` is the parent of the base link, as a differential drive publishes it. The frames of links are those of a
robot_state_publisher. A sensor has a frame of its own if its pose on the link is stated. A camera always has one,
because its messages are in an optical frame.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.core.records import dataclass
from sim_action.robot.model.kinematics import joint_motion
from sim_action.robot.model.robot_model import Joint, RobotModel
from sim_action.ros.ros2.messages import OPTICAL, PlacedFrame
from sim_action.ros.topic_names import plain_name
from sim_action.state.observation import JointState
from sim_action.world.scene import Fitting, Scene

_ODOM: Final = "odom"

# Kinds of sensors whose messages have no frame of their own: odometry is that of the base.
_WITHOUT_FRAME: Final = frozenset({"odometry", "contact"})


@dataclass(frozen=True, slots=True)
class RobotFrames:
    """The frames of a robot.

    Attributes:
        odom: the frame in which odometry is.
        base: the base link.
        sensors: name of a sensor -> the frame of its messages.
        mounted: frames of sensors on their links.
        fixed: links that do not move on their parents.
        moving: parent link, child link, and the joints in series between them.
    """

    odom: str
    base: str
    sensors: Mapping[str, str]
    mounted: tuple[PlacedFrame, ...]
    fixed: tuple[PlacedFrame, ...]
    moving: tuple[tuple[str, str, tuple[Joint, ...]], ...]

    @classmethod
    def of(cls, scene: Scene) -> RobotFrames:
        """Return the frames of a robot and its sensors, with distinct names: a name that is taken gets a suffix."""
        model = scene.model
        taken = {link.name for link in model.links}
        odom = _free(_ODOM, taken)
        frames = {sensor.name: _frame_of(sensor, taken) for sensor in scene.sensors}
        return cls(
            odom,
            model.root,
            frames,
            tuple(_mounted(scene.sensors, frames)),
            tuple(
                (joints[0].parent, child, joints[0].origin)
                for child, joints in model.joints_to.items()
                if not any(joint.moves for joint in joints)
            ),
            tuple(_moving(model)),
        )

    def of_joints(self, joints: Mapping[str, JointState]) -> Iterator[PlacedFrame]:
        """Yield the links that joints move, at their present positions."""
        for parent, child, series in self.moving:
            pose = series[0].origin
            for joint in series:
                if joint.moves:
                    pose = geometry.compose(pose, joint_motion(joint, joints[joint.name].position))
            yield parent, child, pose


def _moving(model: RobotModel) -> Iterator[tuple[str, str, tuple[Joint, ...]]]:
    for child, joints in model.joints_to.items():
        if any(joint.moves for joint in joints):
            yield joints[0].parent, child, joints


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _frame_of(sensor: Fitting, taken: set[str]) -> str:
    if sensor.kind == "camera":
        return _free(f"{plain_name(sensor.name)}_optical_frame", taken)
    if sensor.pose == Pose() or sensor.kind in _WITHOUT_FRAME:
        return sensor.link
    return _free(f"{plain_name(sensor.name)}_frame", taken)


def _mounted(sensors: tuple[Fitting, ...], frames: Mapping[str, str]) -> Iterator[PlacedFrame]:
    for sensor in sensors:
        if sensor.kind == "camera":
            yield sensor.link, frames[sensor.name], geometry.compose(sensor.pose, OPTICAL)
        elif frames[sensor.name] != sensor.link:
            yield sensor.link, frames[sensor.name], sensor.pose

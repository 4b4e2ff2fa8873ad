"""Nodes of ROS 1: `ros1: {launch: [package, file.launch]}` or `ros1: {nodes: [package/type]}`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, ClassVar, Final

from pydantic import Field

from sim_action.commands import CommandSource, Controller
from sim_action.core.field_types import FrozenModel, NamesFile, PositiveHertz, PositiveSeconds
from sim_action.core.messages import did_you_mean
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.ros.ros1.driving.node_spec import GraphName, NodeSpec
from sim_action.world.scene import Fitting, Scene

COMMANDS: Final = "cmd_vel"
JOINTS: Final = "joint_states"
ODOMETRY: Final = "odom"

_OF_SENSORS: Final = {
    "lidar": "scan",
    "imu": "imu",
    "odometry": ODOMETRY,
    "camera": "image_raw",
    "contact": "contact",
}


def topics_of(sensors: Sequence[Fitting], stated: Mapping[str, str]) -> dict[str, str]:
    """Each topic by what it is of: `cmd_vel`, `joint_states`, `odom` where no sensor tells odometry, and sensors."""
    found = {COMMANDS: "/cmd_vel", JOINTS: "/joint_states"}
    if not any(sensor.kind == "odometry" for sensor in sensors):
        found[ODOMETRY] = "/odom"
    found |= {sensor.name: _topic(sensor, sensors) for sensor in sensors if sensor.kind in _OF_SENSORS}
    return {name: f"/{stated.get(name, topic).lstrip('/')}" for name, topic in found.items()}


def topic_problems(stated: Mapping[str, str], sensors: Sequence[Fitting]) -> SpecProblems:
    """Names of what the robot has not, and topics that several have; by their keys."""
    topics = topics_of(sensors, stated)
    for name in stated:
        if name not in topics:
            yield (name,), f"the robot has no '{name}'{did_you_mean(name, topics)}"
    yield from (((name,), message) for name, message in _twice(stated, topics))


def _twice(stated: Mapping[str, str], topics: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    for name in stated:
        others = [other for other, topic in topics.items() if other != name and topic == topics.get(name)]
        if others:
            yield name, f"'{topics[name]}' is already the topic of '{others[0]}'"


def _topic(sensor: Fitting, sensors: Sequence[Fitting]) -> str:
    kind = _OF_SENSORS[sensor.kind]
    is_alone = sum(other.kind == sensor.kind for other in sensors) == 1
    if sensor.kind == "camera" or not is_alone:
        plain = re.sub(r"\W", "_", sensor.name, flags=re.ASCII)
        return f"/{plain if plain[:1].isalpha() else f'sensor_{plain}'}/{kind}"
    return f"/{kind}"


# In s: as long as anybody can mean.
_A_DAY = 86_400


class RosNodes(FrozenModel):
    """Which nodes there are, and how the robot's topics are called."""

    launch: Annotated[
        tuple[str, ...] | None,
        Field(
            min_length=1,
            description="launch file: its package, its name, and NAME:=VALUE for each argument",
        ),
    ] = None
    nodes: Annotated[
        tuple[NodeSpec, ...] | None,
        Field(min_length=1, description="list of nodes, instead of a launch file; each is a map or package/type"),
    ] = None
    workspace: Annotated[
        str | None,
        NamesFile(),
        Field(
            min_length=1,
            description="folder of the catkin workspace; left out: the nearest one around the scenario, else its "
            "repository",
        ),
    ] = None
    topics: Annotated[
        dict[str, GraphName],
        Field(
            description="cmd_vel, odom, joint_states, or the name of a sensor -> topic name"
        ),
    ] = Field(default_factory=dict)
    start_within: Annotated[
        PositiveSeconds, Field(le=_A_DAY, description="wall time that nodes may take to start; sim time waits for them")
    ] = 10.0


class RosCommands(CommandSource):
    """Drives the base by nodes of ROS 1, as they are: real roscore, roslaunch and rospy, and no Gazebo.

    The nodes are those of a launch file, or are listed. They run unmodified, on the ROS of the distribution (see
    [ROS 1 without Gazebo](/docs/ros1/index.md)), and none of their packages needs a catkin build. What
    they say to the robot on `/cmd_vel` (`geometry_msgs/Twist`) drives it, and holds until they say something else.
    They hear:

    - `/clock` at `rate`, and the parameter `/use_sim_time` is set;
    - `/odom` and `/tf` (where the base really is) and `/joint_states`, 30 times in a second; `/gazebo/model_states` and
      `/gazebo/link_states` at `rate`;
    - the sensors of the scenario, at their own rates: a lidar on `/scan`, an IMU on `/imu`, odometry on `/odom` and
      `/tf` in place of the truth, a camera on `/NAME/image_raw`, a contact sensor on `/contact` (`std_msgs/Bool`). Of
      several of a kind, each has its name before it: `/NAME/scan`. `topics` calls them otherwise, by their names.

    `/robot_description` is the robot's URDF, unless a launch file sets it. A launch file that starts Gazebo may stay as
    it is: nodes of `gazebo_ros` and of `controller_manager` are left out, since the scenario says which robot and which
    world there is. Services of Gazebo are not offered.

    Sim time is 0 when all nodes are up, and hear whom they listen to; a process that has not become a node
    `start_within` that time is no longer waited for, and noted. From then on it goes on only when every node has dealt
    with all that it was told: the same run every time, as fast as nodes can follow, and sim time alone decides, as
    ever. Nodes that are still busy after 10 s of wall time cost lock-step: the run goes on without, and is noted to be
    not deterministic.

    A node that ends with another exit code than 0, or by a signal, and a required one however it ends, is an error:
    with the exception that it died of, and the line of the package that raised it. A node that is done may leave. If
    none has driven the robot, that is noted, with topics on which some might have meant to.

    A node of a list is `package/type`, or a map of `package`, `type`, `name`, `args`, `params` (its private ones),
    `remap`, `namespace` and `required`. Nodes are code, as scripts are: they run with the rights of the job and what
    scripts see of its environment, each within `memory_limit`, and are refused where scripts are.
    """

    runs_user_code: ClassVar[bool] = True
    needs_drive: ClassVar[bool] = True

    ros1: Annotated[RosNodes, Field(description="launch file or list of nodes")]
    rate: Annotated[
        PositiveHertz, Field(description="rate of /clock, and of reading commands")
    ] = 120.0

    @property
    def code(self) -> str:
        """See CommandSource.code."""
        return "ros1"

    def problems(self, workspace: Workspace) -> SpecProblems:
        """See CommandSource.problems. Nothing is launched, and nothing needs ROS to be here."""
        from sim_action.ros.ros1.driving.file_problems import file_problems

        return ((("ros1", *path), message) for path, message in file_problems(self.ros1, workspace))

    @property
    def unchecked(self) -> tuple[str, ...]:
        """See CommandSource.unchecked."""
        from sim_action.ros.ros1.driving.file_problems import unchecked

        return unchecked(self.ros1)

    def model_problems(self, scene: Scene) -> SpecProblems:
        """See CommandSource.model_problems: topics of what the robot has not."""
        return (
            (("ros1", "topics", *path), message) for path, message in topic_problems(self.ros1.topics, scene.sensors)
        )

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Raises SourceProblem if ROS is not here, ScriptError."""
        from sim_action.ros.ros1.driving.launched_nodes import open_nodes

        return open_nodes(self, scene)

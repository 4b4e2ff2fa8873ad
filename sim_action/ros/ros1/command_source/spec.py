"""Nodes of ROS 1 as commands: `ros1: {launch: [package, file.launch]}` or `ros1: {nodes: [package/type]}`."""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from typing import Annotated, ClassVar, Final

from pydantic import BeforeValidator, Field, JsonValue
from typing_extensions import override

from sim_action.commands import CommandSource, Controller
from sim_action.core.field_types import PositiveHertz
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import SpecProblems, plain_data
from sim_action.ros.launches import ListedNode, Nodes, StartTime, name_rule, unchecked_notes
from sim_action.ros.robot_topics import topic_problems, topics_of
from sim_action.world.scene import Scene

_BASE: Final = "[A-Za-z][A-Za-z0-9_]*"
BaseName = Annotated[str, name_rule(_BASE, "the name of a node has letters, digits and '_' and starts with a letter")]
GraphName = Annotated[
    str,
    name_rule(
        rf"[~/]?{_BASE}(?:/[A-Za-z0-9_]+)*", "a name in ROS has letters, digits, '_' and '/', such as /arm/cmd_vel"
    ),
]


class NodeSpec(ListedNode):
    """A node: a program of a package, and its start options."""

    short_form: ClassVar[str] = r"^[^/]+/[\s\S]"

    package: Annotated[str, Field(min_length=1, description="package of the program")]
    type: Annotated[
        str, Field(min_length=1, description="file of the program, such as mover.py, or its name if it is compiled")
    ]
    name: Annotated[
        BaseName | None, Field(description="name of the node; default: the file name without its suffix")
    ] = None
    args: Annotated[str, Field(description="arguments of the program, as in a launch file")] = ""
    params: Annotated[
        dict[str, JsonValue], BeforeValidator(plain_data), Field(description="private parameters of the node")
    ] = Field(default_factory=dict)
    remap: Annotated[
        dict[GraphName, GraphName], Field(description="name that the node uses -> name that replaces it")
    ] = Field(default_factory=dict)
    namespace: Annotated[GraphName | None, Field(description="namespace of the node")] = None
    required: Annotated[bool, Field(description="if true, the run fails when this node ends")] = False

    @classmethod
    @override
    def expanded(cls, text: str) -> dict[str, str]:
        package, slash, kind = text.partition("/")
        if not (package and slash and kind):
            raise ValueError(f"the short form of a node is package/type, such as my_robot/mover.py, found '{text}'")
        return {"package": package, "type": kind}

    @property
    def called(self) -> str:
        """The name of the node."""
        plain = re.sub(r"\W", "_", PurePosixPath(self.type).stem)
        return self.name or (plain if plain[:1].isalpha() else f"node_{plain}")


class RosNodes(Nodes[NodeSpec]):
    """The nodes to launch, and the names of the robot's topics."""

    topics: Annotated[
        dict[str, GraphName], Field(description="cmd_vel, odom, joint_states, or the name of a sensor -> topic name")
    ] = Field(default_factory=dict)
    start_within: StartTime = 10.0


class RosCommands(CommandSource):
    """Drives the base by unmodified nodes of ROS 1: real roscore, roslaunch and rospy, without Gazebo.

    The nodes come from a launch file or a list; an entry is `package/type` or a map. They run on the installed ROS
    (see [ROS 1 without Gazebo](/docs/ros1/index.md)) and need no catkin build. A `geometry_msgs/Twist` on `/cmd_vel`
    drives the robot, and holds until the next one. The nodes can subscribe to:

    - `/clock` at `rate`; the parameter `/use_sim_time` is set;
    - `/odom` and `/tf` (the true pose of the base) and `/joint_states`, 30 times per second; `/gazebo/model_states` and
      `/gazebo/link_states` at `rate`;
    - the sensors of the scenario, at their own rates: `/scan`, `/imu`, `/odom` and `/tf` in place of the true pose,
      `/NAME/image_raw`, `/contact` (`std_msgs/Bool`). With several of a kind, the topic starts with the name of the
      sensor: `/NAME/scan`. `topics` sets other topics.

    `/robot_description` is the URDF of the robot, unless a launch file sets it. Nodes of `gazebo_ros` and
    `controller_manager` in a launch file are not started, because the scenario defines the robot and the world. Other
    parts that need Gazebo are an error, unless `allow_losses` is true.

    Sim time starts at 0 when all nodes are up and connected. From then on, it advances only when every node has handled
    all its messages, so every run is the same. A node that is still busy after 10 s of wall time, or that acts by the
    wall clock, is named in the warning `not-reproducible`.

    A node that ends with an exit code other than 0 or by a signal is an error with its exception, and so is any end of
    a required node. If no node drove the robot, a note names topics that may have been meant. Nodes are code, as
    scripts are: same environment, `memory_limit` each, refused where scripts are refused.
    """

    key: ClassVar[str] = "ros1"
    is_for_actors: ClassVar[bool] = False
    runs_user_code: ClassVar[bool] = True
    needs_drive: ClassVar[bool] = True

    ros1: Annotated[RosNodes, Field(description="launch file or list of nodes")]
    rate: Annotated[PositiveHertz, Field(description="rate of /clock, and of reading commands")] = 120.0

    def problems(self, workspace: Workspace) -> SpecProblems:
        """See CommandSource.problems. This launches nothing and works without ROS."""
        # the rest of the module runs without it
        from sim_action.ros.ros1.command_source.file_problems import file_problems

        return ((("ros1", *path), message) for path, message in file_problems(self.ros1, workspace))

    @property
    @override
    def unchecked(self) -> tuple[str, ...]:
        # the rest of the module runs without it
        from sim_action.ros.ros1.command_source.file_problems import local_ros

        return unchecked_notes("ros1", self.ros1.launch, local_ros()[1])

    def model_problems(self, scene: Scene) -> SpecProblems:
        """See CommandSource.model_problems: problems of the topics."""
        topics = topics_of(scene.sensors, self.ros1.topics)
        return ((("ros1", "topics", *path), message) for path, message in topic_problems(self.ros1.topics, topics))

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Raises SourceProblem if ROS is not installed, ScriptError."""
        # the rest of the module runs without it
        from sim_action.ros.ros1.command_source.launched_nodes import open_nodes

        return open_nodes(self.ros1, self.rate, scene)

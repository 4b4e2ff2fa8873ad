"""Nodes of ROS 1 as commands: `ros1: {launch: [package, file.launch]}` or `ros1: {nodes: [package/type]}`."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field
from typing_extensions import override

from sim_action.commands import CommandSource, Controller
from sim_action.core.field_types import PositiveHertz
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.ros.launches import unchecked_notes
from sim_action.ros.robot_topics import topic_problems, topics_of
from sim_action.ros.ros1.command_source.node_spec import RosNodes
from sim_action.world.scene import Scene


class RosCommands(CommandSource):
    """Drives the base by unmodified nodes of ROS 1: real roscore, roslaunch and rospy, without Gazebo.

    The nodes are those of a launch file, or a list; an entry is `package/type` or a map. They run on the installed ROS
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
        from sim_action.ros.ros1.command_source.file_problems import why_no_ros

        return unchecked_notes("ros1", self.ros1.launch, why_no_ros())

    def model_problems(self, scene: Scene) -> SpecProblems:
        """See CommandSource.model_problems: problems of the topics."""
        topics = topics_of(scene.sensors, self.ros1.topics)
        return ((("ros1", "topics", *path), message) for path, message in topic_problems(self.ros1.topics, topics))

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Raises SourceProblem if ROS is not installed, ScriptError."""
        from sim_action.ros.ros1.command_source.driven_nodes import open_nodes  # the rest of the module runs without it

        return open_nodes(self.ros1, self.rate, scene)

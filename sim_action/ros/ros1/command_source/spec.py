"""Nodes of ROS 1 as commands: `ros1: {launch: [package, file.launch]}` or `ros1: {nodes: [package/type]}`."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field
from typing_extensions import override

from sim_action.commands import CommandSource, Controller
from sim_action.core.field_types import PositiveHertz
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.ros.robot_topics import topic_problems, topics_of
from sim_action.ros.ros1.command_source.node_spec import RosNodes
from sim_action.world.scene import Scene


class RosCommands(CommandSource):
    """Drives the base by unmodified nodes of ROS 1: real roscore, roslaunch and rospy, without Gazebo.

    The nodes are those of a launch file, or a list. They run on the ROS of the distribution (see [ROS 1 without
    Gazebo](/docs/ros1/index.md)). None of their packages needs a catkin build. A `geometry_msgs/Twist` on `/cmd_vel`
    drives the robot, and holds until the next one. The nodes can subscribe to:

    - `/clock`, published at `rate`; the parameter `/use_sim_time` is set;
    - `/odom` and `/tf` (the true pose of the base) and `/joint_states`, 30 times per second; `/gazebo/model_states` and
      `/gazebo/link_states` at `rate`;
    - the sensors of the scenario, at their own rates: a lidar on `/scan`, an IMU on `/imu`, odometry on `/odom` and
      `/tf` in place of the true pose, a camera on `/NAME/image_raw`, a contact sensor on `/contact` (`std_msgs/Bool`).
      With several sensors of a kind, the topic starts with the name of the sensor: `/NAME/scan`. `topics` sets other
      topics, by the names of sensors.

    `/robot_description` is the URDF of the robot, unless a launch file sets it. A launch file that starts Gazebo can
    stay as it is: nodes of `gazebo_ros` and `controller_manager` are not launched, because the scenario defines the
    robot and the world. The services of Gazebo are not available. Parts that the scenario does not replace are an
    error, unless `allow_losses` is true: a world that is not empty, models besides the robot, and controllers other
    than those of a differential drive and of joint states.

    Sim time starts at 0 when all nodes are up and connected to each other. A process that does not become a node within
    `start_within` is no longer waited for, and a note says so. After the start, sim time goes on only when every node
    has handled all messages that it received. So every run is the same, as fast as the nodes can follow, and only sim
    time counts. Nodes that are still busy after 10 s of wall time break the lock-step, and the run goes on without
    it. The warning `not-reproducible` names them, and nodes that act by the wall clock.

    A node that ends with an exit code other than 0 or by a signal is an error, and so is any end of a required node.
    The error has the exception of the node and the line of the package that raised it. A node that has finished its
    work may end. If no node drove the robot, a note says so, and names the topics with a `Twist` that may have been
    meant.

    A node in a list is `package/type`, or a map of `package`, `type`, `name`, `args`, `params` (private parameters),
    `remap`, `namespace` and `required`. Nodes are user code, as scripts are: they run with the rights of the job and
    the same environment variables as scripts, each within `memory_limit`, and are refused where scripts are refused.
    """

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
        from sim_action.ros.ros1.command_source.file_problems import unchecked  # the rest of the module runs without it

        return unchecked(self.ros1)

    def model_problems(self, scene: Scene) -> SpecProblems:
        """See CommandSource.model_problems: problems of the topics."""
        topics = topics_of(scene.sensors, self.ros1.topics)
        return ((("ros1", "topics", *path), message) for path, message in topic_problems(self.ros1.topics, topics))

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Raises SourceProblem if ROS is not installed, ScriptError."""
        from sim_action.ros.ros1.command_source.driven_nodes import open_nodes  # the rest of the module runs without it

        return open_nodes(self.ros1, self.rate, scene)

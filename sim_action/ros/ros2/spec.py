"""Nodes of ROS 2 as commands: `ros2: {nodes: [package/executable]}` or `ros2: {launch: [package, file]}`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar

from pydantic import Field
from typing_extensions import override

from sim_action.commands import CommandSource, Controller
from sim_action.core.field_types import PositiveHertz
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.ros.launches import unchecked_notes
from sim_action.ros.ros2.node_spec import Ros2Nodes
from sim_action.world.scene import Scene


class Ros2Commands(CommandSource):
    """Drives the robot by unmodified nodes of ROS 2: real rclpy and Fast DDS, without Gazebo.

    A node is `package/executable`, a file such as `./mover.py`, or a map. Packages are found in `workspace`. A
    `geometry_msgs/Twist` or `TwistStamped` on `/cmd_vel` drives the robot, and holds until the next one. The nodes can
    subscribe to `/clock`, published at `rate`, `/odom`, `/tf`, `/joint_states`, `/robot_description` and the sensors of
    the scenario. `topics` sets other topics: `topics: {cmd_vel: /diff_cont/cmd_vel}`. `launch` is experimental: see
    [launch files](../../docs/ros2/launch.md), and `namespace` for [several robots](../../docs/ros2/reference.md).

    Sim time starts at 0 when all nodes are up and connected; `use_sim_time` is set. It advances only when every node
    has handled all its messages, so every run is the same: `random` and `numpy.random` start from `seed`, and timeouts
    such as that of `spin_once` are sim time. A node that does not follow sim time, or is still busy after 10 s of wall
    time, is named in a warning. With `pace: realtime`, nodes run by the wall clock.

    A node that ends with an exit code other than 0 or by a signal is an error, and so is any end of a required node.
    Nodes are code, as scripts are: same environment, `memory_limit` each, refused where scripts are refused.
    """

    key: ClassVar[str] = "ros2"
    runs_user_code: ClassVar[bool] = True

    ros2: Annotated[Ros2Nodes, Field(description="launch file or list of nodes")]
    rate: Annotated[
        PositiveHertz,
        Field(
            description="rate of /clock, and of reading commands; if 100 Hz does not divide `physics.rate`, the "
            "default is the next higher rate that does, such as 120 Hz at 240 Hz"
        ),
    ] = 100.0

    @property
    @override
    def needed_rate(self) -> float | None:
        return self.rate if "rate" in self.model_fields_set else None

    def problems(self, workspace: Workspace) -> SpecProblems:
        """See CommandSource.problems. This starts nothing and works without ROS 2."""
        from sim_action.ros.ros2.file_problems import file_problems  # the rest of the module runs without it

        if self.ros2.launch and self.ros2.space:
            yield ("ros2", "namespace"), "a launch file states the namespaces of its nodes; remove it, or list 'nodes'"
        yield from ((("ros2", *path), message) for path, message in file_problems(self.ros2, workspace))

    @override
    def actor_problems(self, others: Sequence[CommandSource]) -> SpecProblems:
        nodes = self.ros2
        if nodes.launch:
            yield ("ros2", "launch"), "a launch file drives only the robot under test; list the 'nodes' of this one"
        for other in others:
            if not isinstance(other, Ros2Commands):
                continue
            if other.ros2.space == nodes.space:
                both = f"the namespace '{nodes.space}'" if nodes.space else "no namespace"
                same = f"two robots with {both} have the same topics and frames"
                yield ("ros2",), f"{same}; state another one, such as 'namespace: robot2'"
                return
            for key in ("workspace", "pace"):
                if (own := getattr(nodes, key)) != (first := getattr(other.ros2, key)):
                    wanted = f"'{key}' must be {first!r}, as for the first one, not {own!r}"
                    yield ("ros2",), f"the nodes of all robots share one lock-step: {wanted}"
            if other.rate != self.rate:
                wanted = f"'rate' must be {other.rate:g} Hz, as for the first one, not {self.rate:g} Hz"
                yield (), f"the nodes of all robots share one clock: {wanted}"

    @property
    @override
    def unchecked(self) -> tuple[str, ...]:
        from sim_action.ros.ros2.file_problems import why_no_ros  # the rest of the module runs without it

        return unchecked_notes("ros2", self.ros2.launch, why_no_ros())

    def model_problems(self, scene: Scene) -> SpecProblems:
        """See CommandSource.model_problems: problems of controllers and topics."""
        # the rest of the module runs without it
        from sim_action.ros.ros2.topics import controller_problems, topic_problems

        ros2 = self.ros2
        for path, message in controller_problems(scene, ros2.controllers):
            yield ("ros2", "controllers", *path), message
        for path, message in topic_problems(scene, ros2.topics, ros2.controllers, ros2.space):
            yield ("ros2", "topics", *path), message

    def joints(self, scene: Scene) -> frozenset[str]:
        """See CommandSource.joints: those of controllers."""
        each = (controller.joints(scene.model) for controller in self.ros2.controllers.values())
        return frozenset(joint for joints in each for joint in joints)

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Raises SourceProblem if ROS 2 is not installed, ScriptError."""
        from sim_action.ros.ros2.driven_nodes import open_nodes  # the rest of the module runs without it

        return open_nodes(self.ros2, self.rate, scene)

"""Nodes of ROS 2 as commands: `ros2: {nodes: [package/executable]}` or `ros2: {launch: [package, file]}`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import Annotated, ClassVar, Final, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, JsonValue, model_validator
from typing_extensions import override

from sim_action.commands import CommandSource, Controller
from sim_action.core.field_types import FrozenModel, NamesFile, PositiveHertz
from sim_action.core.wording import shown
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import SpecProblems, plain_data
from sim_action.robot.model.joint_selection import joints_set_by
from sim_action.robot.model.robot_model import RobotModel
from sim_action.ros.launches import ListedNode, Nodes, name_rule, unchecked_notes
from sim_action.world.scene import Scene

# design.ros2.org/articles/topic_and_service_names.html
_TOKEN: Final = r"[A-Za-z_][A-Za-z0-9_]*"  # noqa: S105 - a part of a name
_NAME: Final = rf"{_TOKEN}(?:/{_TOKEN})*"
_RULE: Final = "a name in ROS 2 has letters, digits and '_' between its '/', such as /arm/cmd_vel"
_SPACE_RULE: Final = "a namespace has letters, digits and '_' between its '/', such as /robot1"
_FILE_STARTS: Final = ("./", "../", "/")
_MAX_NAME_CHARS: Final = 247  # rmw/validate_full_topic_name.h, which also counts what a namespace adds
# rcl_interfaces/ParameterValue; a larger integer would become a float.
_MIN_INTEGER: Final = -(2**63)
_MAX_INTEGER: Final = 2**63 - 1
Names = Annotated[tuple[str, ...], Field(min_length=1)]


def _other_than_clock(name: str) -> str:
    if name.strip("/") == "clock":
        raise ValueError("each node has a clock of its own, so /clock cannot be remapped")
    return name


def _short(name: str) -> str:
    if len(name) > _MAX_NAME_CHARS:
        raise ValueError(f"a name in ROS 2 has at most {_MAX_NAME_CHARS} characters, this one has {len(name)}")
    return name


def _arguments(text: str) -> str:
    """Return arguments that can be split as a shell does. Raise ValueError."""
    try:
        shlex.split(text)
    except ValueError as error:
        raise ValueError(f"cannot be split into arguments: {str(error).lower()}") from None
    return text


def _parameters(values: dict[str, JsonValue], space: str = "") -> dict[str, JsonValue]:
    """Return values that ROS 2 has types for; `space`: the start of their names. Raise ValueError."""
    for name, value in values.items():
        if not name:
            raise ValueError("a parameter needs a name, found ''")
        if isinstance(value, dict):
            _parameters(value, f"{space}{name}.")
        else:
            _check_value(space + name, value)
    return values


def _check_value(name: str, value: JsonValue) -> None:
    if value is None:
        raise ValueError(f"'{name}' has no value; remove it, or give it one")
    values = value if isinstance(value, list) else [value]
    kinds = {type(entry) for entry in values}
    if len(kinds) > 1 or not kinds <= {bool, int, float, str}:
        rule = "a list of a parameter has values of one type: bool, integer, float or text"
        raise ValueError(f"{rule}; '{name}' has {', '.join(map(shown, values[:5]))}")
    for entry in values:
        if isinstance(entry, int) and not _MIN_INTEGER <= entry <= _MAX_INTEGER:
            raise ValueError(f"an integer has 64 bits in ROS 2; '{name}' has {shown(entry)}")


_SHORT: Final = AfterValidator(_short)
NodeName = Annotated[
    str, name_rule(_TOKEN, "the name of a node has letters, digits and '_' and starts with no digit"), _SHORT
]
GraphName = Annotated[str, name_rule(f"(?:/|~/)?{_NAME}", _RULE), _SHORT]
OldName = Annotated[str, AfterValidator(_other_than_clock), name_rule(f"(?:/|~/)?{_NAME}", _RULE), _SHORT]
RobotTopicName = Annotated[str, name_rule(f"/?{_NAME}", _RULE), _SHORT]
Namespace = Annotated[str, name_rule(f"/|/?{_NAME}", _SPACE_RULE), _SHORT]
Parameters = Annotated[dict[str, JsonValue], BeforeValidator(plain_data), AfterValidator(_parameters)]


class Ros2NodeSpec(ListedNode):
    """A node: an executable of a package, or a file, and its start options."""

    short_form: ClassVar[str] = r"^[^/]+/[^/]+$|^\.{0,2}/"

    package: Annotated[str | None, Field(min_length=1, description="package of the executable")] = None
    executable: Annotated[
        str | None, Field(min_length=1, description="name of the executable, as `ros2 run` takes it")
    ] = None
    file: Annotated[
        str | None, NamesFile(), Field(min_length=1, description="program, instead of a package and an executable")
    ] = None
    name: Annotated[NodeName | None, Field(description="name of the node; default: the one in its code")] = None
    namespace: Annotated[Namespace | None, Field(description="namespace of the node")] = None
    args: Annotated[
        str, AfterValidator(_arguments), Field(description="arguments of the program, as on a command line")
    ] = ""
    parameters: Annotated[Parameters, Field(description="parameters of the node")] = Field(default_factory=dict)
    remap: Annotated[
        dict[OldName, GraphName], Field(description="name that the node uses -> name that replaces it")
    ] = Field(default_factory=dict)
    stdin: Annotated[str, Field(description="text that the program can read, as from a keyboard")] = ""
    required: Annotated[bool, Field(description="if true, the run fails when this node ends")] = False

    @classmethod
    @override
    def expanded(cls, text: str) -> dict[str, str]:
        if text.startswith(_FILE_STARTS):
            return {"file": text}
        package, slash, executable = text.partition("/")
        if not (package and slash and executable) or "/" in executable:
            rule = "the short form of a node is package/executable, or a file such as ./mover.py"
            hint = f"; did you mean './{text}'?" if text.endswith(".py") else ""
            raise ValueError(f"{rule}, found '{text}'{hint}")
        return {"package": package, "executable": executable}

    @model_validator(mode="after")
    def _has_one_program(self) -> Ros2NodeSpec:
        """Raise ValueError unless there is either a file, or a package and an executable."""
        if self.file is not None and (self.package is not None or self.executable is not None):
            raise ValueError("a node has either a 'file', or a 'package' and an 'executable'; remove one of them")
        if self.file is None and (self.package is None or self.executable is None):
            missing = "'package'" if self.package is None else "'executable'"
            rule = "a node needs a 'package' and an 'executable', or a 'file'"
            raise ValueError(f"{rule}; add {missing}" if self.package or self.executable else rule)
        return self

    @property
    def program(self) -> str:
        """The program in the short form, for messages."""
        return self.file or f"{self.package}/{self.executable}"

    @property
    def called(self) -> str:
        """The stated name of the node, else the name of its program, which is mostly the same."""
        return self.name or PurePosixPath(self.file or self.executable or "").stem

    @property
    def arguments(self) -> tuple[str, ...]:
        """The arguments of the program."""
        return tuple(shlex.split(self.args))


class JointController(FrozenModel):
    """A controller: the joints that it moves, by name, by pattern such as `'*_hip'`, or by group of the SRDF."""

    trajectory: Annotated[
        Names | None,
        Field(description="joints that follow a `trajectory_msgs/JointTrajectory` on `/NAME/joint_trajectory`"),
    ] = None
    position: Annotated[
        Names | None, Field(description="joints whose positions are a `std_msgs/Float64MultiArray` on `/NAME/commands`")
    ] = None
    velocity: Annotated[Names | None, Field(description="joints whose velocities are, likewise")] = None
    effort: Annotated[Names | None, Field(description="joints whose efforts are, likewise")] = None

    @model_validator(mode="after")
    def _has_one_kind(self) -> Self:
        if len(self.model_fields_set) != 1 or not self.names:
            raise ValueError("a controller needs exactly one of 'trajectory', 'position', 'velocity' and 'effort'")
        return self

    @property
    def kind(self) -> str:
        """The key that is stated."""
        (kind,) = self.model_fields_set
        return kind

    @property
    def names(self) -> tuple[str, ...]:
        """The names, patterns and groups of its joints."""
        names: tuple[str, ...] | None = getattr(self, self.kind)
        return names or ()

    def topic(self, name: str) -> str:
        """Return its usual topic; `name`: the name of the controller."""
        return f"/{name.strip('/')}/{'joint_trajectory' if self.kind == 'trajectory' else 'commands'}"

    def joints(self, model: RobotModel) -> tuple[str, ...]:
        """Return its joints, in the order of the names; for patterns and groups, in the order of the model."""
        matches = joints_set_by(model, dict.fromkeys(self.names))
        return tuple(dict.fromkeys(joint for name in self.names for joint in matches[name]))


class Ros2Nodes(Nodes[Ros2NodeSpec]):
    """The nodes to start, and the names of the robot's topics."""

    namespace: Annotated[Namespace | None, Field(description="of its nodes and topics, and prefix of its frames")] = (
        None
    )
    topics: Annotated[
        dict[str, RobotTopicName],
        Field(
            description="cmd_vel, odom, joint_states, joint_trajectory, or the name of a sensor or a controller -> "
            "topic name"
        ),
    ] = Field(default_factory=dict)
    controllers: Annotated[
        dict[RobotTopicName, JointController],
        Field(
            description="name of a controller of ros2_control -> the joints that nodes command by its topic; default: "
            "`/joint_trajectory` for all joints that are not those of the drive"
        ),
    ] = Field(default_factory=dict)
    pace: Annotated[
        Literal["lockstep", "realtime"],
        Field(
            description="lockstep: sim time waits for the nodes, and every run is the same; realtime: sim time follows "
            "the wall clock, for nodes that must"
        ),
    ] = "lockstep"

    @property
    def space(self) -> str:
        """The beginning of the names of topics and nodes: "/robot2"; empty without a namespace."""
        return f"/{name}" if (name := (self.namespace or "").strip("/")) else ""


class Ros2Commands(CommandSource):
    """Drives the robot by unmodified nodes of ROS 2: real rclpy and Fast DDS, without Gazebo.

    A node is `package/executable`, a file such as `./mover.py`, or a map. Packages are found in `workspace`. A
    `geometry_msgs/Twist` or `TwistStamped` on `/cmd_vel` drives the robot, and holds until the next one. The nodes can
    subscribe to `/clock`, published at `rate`, `/odom`, `/tf`, `/joint_states`, `/robot_description` and the sensors of
    the scenario. `topics` sets other topics: `topics: {cmd_vel: /diff_cont/cmd_vel}`. `launch` is experimental: see
    [launch files](../../docs/ros2/launch.md), and `namespace` for [several robots](../../docs/ros2/reference.md).

    Sim time starts at 0 when all nodes are up and connected; `use_sim_time` is set. It advances only when every node
    has handled all its messages, so every run is the same: `random` and `numpy.random` start from `seed`, and timeouts,
    such as in `spin_once`, are sim time. A node that does not follow sim time, or is still busy after 10 s of wall
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
                    rule = f"'{key}' must be {first!r}, as for the first one, not {own!r}"
                    yield ("ros2",), f"the nodes of all robots share one lock-step: {rule}"
            if other.rate != self.rate:
                rule = f"'rate' must be {other.rate:g} Hz, as for the first one, not {self.rate:g} Hz"
                yield (), f"the nodes of all robots share one clock: {rule}"

    @property
    @override
    def unchecked(self) -> tuple[str, ...]:
        from sim_action.ros.ros2.file_problems import local_ros  # the rest of the module runs without it

        return unchecked_notes("ros2", self.ros2.launch, local_ros()[1])

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
        """Return the joints of the controllers."""
        groups = (controller.joints(scene.model) for controller in self.ros2.controllers.values())
        return frozenset(joint for joints in groups for joint in joints)

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Raises SourceProblem if ROS 2 is not installed, ScriptError."""
        from sim_action.ros.ros2.driven_nodes import open_nodes  # the rest of the module runs without it

        return open_nodes(self.ros2, self.rate, scene)

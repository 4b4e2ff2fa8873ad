"""A recorded log: `replay: logs/monday.csv`, or `replay: monday.bag` with its `topic:`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated

from pydantic import Field

from sim_action.commands import CommandSource, Controller, OpenLoop
from sim_action.commands.logs import Moment, csv_log, ros_log
from sim_action.commands.logs.csv_header import Header
from sim_action.commands.logs.ros_types import TWISTS, MessageType
from sim_action.commands.playback import Playback
from sim_action.commands.replay_problems import is_csv, kind_problems, log_problems
from sim_action.commands.saturation import Saturation
from sim_action.core.errors import RecordingError
from sim_action.core.field_types import NamesFile, NonNegativeSeconds, PositiveSeconds
from sim_action.core.messages import did_you_mean
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.robot_model import RobotModel
from sim_action.state.command import Command, JointTargets
from sim_action.world.scene import Scene


class ReplayCommands(CommandSource):
    """Gives again the commands of a recorded log, at the times at which they were given.

    The log is a CSV file, or one of ROS: rosbag1 (`.bag`), rosbag2 (its folder, or one `.db3` or `.mcap` file). Its
    first command is given at t = 0. Those that fall between two ticks are given at the later one: choose a `rate` that
    is not lower than the log's. A command holds until the next one, and the last one until the end: let a log end with
    a stop, or give a `timeout`, as real bases have one.

    A CSV file has a header with `time` (s) and either `linear`, `lateral`, `angular` (m/s, rad/s) or
    `position.<joint>`, `velocity.<joint>`, `effort.<joint>` (SI units). Of ROS, `Twist`, `TwistStamped` and
    `JointState` messages are replayed, by the time at which the log received them. Of a joint's position, velocity and
    effort, the first that is given is followed; beyond the limits that the model states, they are taken as those of
    scripts are, and noted.

    ROS logs need `pip install '.[rosbags]'` in a checkout of sim-action, and in a workflow the input `extras: rosbags`.
    """

    replay: Annotated[
        str, NamesFile(), Field(min_length=1, description="path of the log: .csv, .bag, .db3, .mcap, or a folder")
    ]
    topic: Annotated[
        str | None, Field(min_length=1, description="of a log of ROS, and required there: which one is replayed")
    ] = None
    type: Annotated[MessageType | None, Field(description="of the topic's messages; left out: as the log says")] = None
    only_joints: Annotated[
        tuple[str, ...] | None,
        Field(min_length=1, description="which joints are moved; left out: all that the log names"),
    ] = None
    start: Annotated[NonNegativeSeconds, Field(description="of the log's own time: what is at t = 0")] = 0.0
    timeout: Annotated[
        PositiveSeconds | None, Field(description="a twist that is older stops the base; left out: it holds")
    ] = None

    def problems(self, workspace: Workspace) -> SpecProblems:
        """See CommandSource.problems. CSV is read; a log of ROS is not."""
        try:
            path = workspace.file_or_folder(self.replay)
        except PathError as error:
            yield ("replay",), str(error)
        else:
            yield from log_problems(self, path)

    @property
    def unchecked(self) -> tuple[str, ...]:
        """See CommandSource.unchecked."""
        if is_csv(self):
            return ()
        return (f"{self.replay} is read when it runs: until then, what is said of its topics is not checked",)

    def model_problems(self, scene: Scene) -> SpecProblems:
        """See CommandSource.model_problems: joints that no motor can move."""
        troubles = (self._why_not_moved(name, scene.model) for name in sorted(self.joints(scene)))
        if trouble := next(filter(None, troubles), None):
            yield ("only_joints" if self.only_joints else "replay",), trouble

    def gives_twists(self, scene: Scene) -> bool:
        """See CommandSource.gives_twists."""
        header = self._csv_header(scene.workspace)
        return self.type in TWISTS if header is None else header.holds_twists

    def joints(self, scene: Scene) -> frozenset[str]:
        """See CommandSource.joints."""
        if self.gives_twists(scene):
            return frozenset()
        header = self._csv_header(scene.workspace)
        return frozenset(self.only_joints or (() if header is None else header.joint_names))

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Raises RecordingError, and RunError for a log that does not fit into memory."""
        moments = list(self._moments(scene.workspace))
        for key, message in self._mismatches(moments, scene.model):
            raise RecordingError(f"{self.replay}: {message}", key)
        chosen = [(time, self._chosen(command)) for time, command in moments]
        playback, motors = Playback(chosen, self.start, self.timeout), Saturation(scene.model, self.replay)
        holding = _holding(chosen[0][1], scene)
        return OpenLoop(lambda time: motors.of_answer(playback.command(time)), holding, motors.notes)

    def _csv_header(self, workspace: Workspace) -> Header | None:
        """None if it is no CSV file; or none that can be read, which is told elsewhere."""
        try:
            path = workspace.file_or_folder(self.replay)
            return csv_log.read_header(path, self.replay) if is_csv(self) else None
        except (PathError, RecordingError):
            return None

    def _moments(self, workspace: Workspace) -> Iterable[Moment]:
        """All of the log. Raises RecordingError."""
        try:
            path = workspace.file_or_folder(self.replay)
            if is_csv(self):
                return csv_log.read_moments(path, self.replay)
            for file in ros_log.files_of(path, self.replay) if path.is_dir() else ():
                workspace.file(str(path / file))
        except PathError as error:
            raise RecordingError(f"{self.replay}: {error}") from None
        return ros_log.read_moments(path, self.replay, self.topic or "", self.type)

    def _chosen(self, command: Command) -> Command:
        if self.only_joints is None or not isinstance(command, JointTargets):
            return command
        return JointTargets(
            position={name: command.position[name] for name in self.only_joints if name in command.position},
            velocity={name: command.velocity[name] for name in self.only_joints if name in command.velocity},
            effort={name: command.effort[name] for name in self.only_joints if name in command.effort},
        )

    def _mismatches(self, moments: Sequence[Moment], model: RobotModel) -> Iterator[tuple[str, str]]:
        """Keys that do not go with the log, or the log with the robot."""
        named = {name for _, command in moments if isinstance(command, JointTargets) for name in command.names()}
        for (key, *_), message in kind_problems(self, holds_twists=not named):
            yield str(key), message
        if self.start > (end := moments[-1][0]):
            yield "start", f"it ends before that, {end:g} s after its first message"
        for name in self.only_joints or ():
            if name not in named:
                yield "only_joints", f"it has no joint '{name}'{did_you_mean(name, named)}"
        for name in self.only_joints or sorted(named):
            if (trouble := self._why_not_moved(name, model)) is not None:
                yield "only_joints" if self.only_joints else "replay", trouble

    def _why_not_moved(self, name: str, model: RobotModel) -> str | None:
        trouble = model.why_not_driven(name)
        return (
            trouble
            if trouble is None or self.only_joints
            else f"{trouble}; 'only_joints' names those of the log that move"
        )


def _holding(first: Command, scene: Scene) -> JointTargets:
    """What the first command moves: where it begins, or still."""
    if not isinstance(first, JointTargets):
        return JointTargets()
    beginnings = scene.joint_positions
    return JointTargets(
        position={name: beginnings[name] for name in first.position},
        velocity=dict.fromkeys(first.velocity, 0.0),
    )

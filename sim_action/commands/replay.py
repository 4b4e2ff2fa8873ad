"""A recorded log: `replay: logs/monday.csv`, or `replay: monday.bag` with its `topic:`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path, PurePath
from typing import Annotated, Final, Protocol

from pydantic import Field

from sim_action.commands import CommandSource, Controller, OpenLoop
from sim_action.commands.logs import Moment, csv_log, rosbag
from sim_action.commands.logs.csv_log import Header
from sim_action.commands.logs.rosbag import TWISTS, MessageType
from sim_action.commands.saturation import Saturation
from sim_action.core.errors import RecordingError
from sim_action.core.field_types import NamesFile, NonNegativeSeconds, PositiveSeconds
from sim_action.core.geometry import Twist
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
            for file in rosbag.files_of(path, self.replay) if path.is_dir() else ():
                workspace.file(str(path / file))
        except PathError as error:
            raise RecordingError(f"{self.replay}: {error}") from None
        return rosbag.read_moments(path, self.replay, self.topic or "", self.type)

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


_CSV: Final = ".csv"


class Replay(Protocol):
    """What is asked of a replay, by its keys."""

    @property
    def replay(self) -> str:
        """The path, as it was written."""

    @property
    def topic(self) -> str | None:
        """Of a log of ROS."""

    @property
    def type(self) -> str | None:
        """Of its messages."""

    @property
    def only_joints(self) -> tuple[str, ...] | None:
        """The joints."""

    @property
    def start(self) -> float:
        """In s."""

    @property
    def timeout(self) -> float | None:
        """In s."""


def is_csv(spec: Replay) -> bool:
    """Whether it is to be read as CSV: its name in the scenario says so, whatever a link of that name leads to."""
    return PurePath(spec.replay).suffix == _CSV


def log_problems(spec: Replay, path: Path) -> SpecProblems:
    """Problems with a log that is there."""
    yield from _csv_problems(spec, path) if is_csv(spec) else _ros_problems(spec, path)


def kind_problems(spec: Replay, *, holds_twists: bool) -> SpecProblems:
    """Keys that do not go with what a log holds."""
    if holds_twists and spec.only_joints is not None:
        yield ("only_joints",), "the log drives the base and names no joints; leave it out"
    if not holds_twists and spec.timeout is not None:
        yield ("timeout",), "is for twists; this log is of joints, which hold what they were told"


def _csv_problems(spec: Replay, path: Path) -> SpecProblems:
    for key, value in (("topic", spec.topic), ("type", spec.type)):
        if value is not None:
            yield (key,), "a CSV file has no topics; leave it out"
    try:
        header = csv_log.read_header(path, spec.replay)
        last = max(time for time, _ in csv_log.read_moments(path, spec.replay))
    except RecordingError as error:
        yield ("replay",), str(error)
        return
    if spec.start > last:
        yield ("start",), f"the log ends before that, {last:g} s after its first row"
    yield from kind_problems(spec, holds_twists=header.holds_twists)
    for name in spec.only_joints or ():
        if not header.holds_twists and name not in header.joint_names:
            yield ("only_joints",), f"the log has no joint '{name}'{did_you_mean(name, header.joint_names)}"


def _ros_problems(spec: Replay, path: Path) -> SpecProblems:
    if problem := rosbag.path_problem(path):
        yield ("replay",), f"'{spec.replay}' {problem}"
        return
    if spec.topic is None:
        yield ("replay",), "a log of ROS has many topics: name the one to replay, such as topic: /cmd_vel"
    if spec.type is not None:
        yield from kind_problems(spec, holds_twists=spec.type in TWISTS)
    if find_spec(rosbag.PACKAGE) is None:
        yield ("replay",), rosbag.INSTALLING


_ROUNDING: Final = 1e-9
"""In s: a command at a tick counts there, whatever the rounding of either."""


class Playback:
    """One replay; it is asked at times that rise.

    Args:
        moments: the log; a command holds until the next one.
        start: of the log's own time in s; what it says then is said at t = 0.
        timeout: after how many s a twist holds no longer; None: it does.
    """

    def __init__(self, moments: Sequence[Moment], start: float, timeout: float | None) -> None:
        self._moments = moments
        self._start = start
        self._timeout = float("inf") if timeout is None else timeout
        self._next = 0

    def command(self, time: float) -> Command | None:
        """What is new at a tick, at a sim time in s; None: nothing."""
        now = self._start + time
        new: Command | None = None
        while self._next < len(self._moments) and self._moments[self._next][0] <= now + _ROUNDING:
            new = _after(new, self._moments[self._next][1])
            self._next += 1
        last, command = self._moments[max(0, self._next - 1)]
        if isinstance(command, Twist) and now - last > self._timeout + _ROUNDING:
            return Twist()
        return new


def _after(earlier: Command | None, later: Command) -> Command:
    """Both, one after the other: joints that the later one does not name keep what the earlier one told them."""
    if isinstance(earlier, JointTargets) and isinstance(later, JointTargets):
        return earlier.updated_by(later)
    return later

"""Replay the commands of a recorded log: `replay: logs/monday.csv`, or `replay: monday.bag` with its `topic:`.

CSV is read when the scenario is validated, logs of ROS only in the scenario's own process. The input is not trusted.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path, PurePath
from posixpath import normpath
from typing import Annotated, ClassVar, Final, Literal, Self

from pydantic import Field, PrivateAttr
from typing_extensions import override

from sim_action.commands import CommandSource, Controller, OpenLoop
from sim_action.commands.controller_answers import Saturation
from sim_action.commands.logs import KINDS, Content, JointColumn, Kind, Recorded, Steering, Trajectory, rosbag
from sim_action.commands.logs.csv_table import Header, Table
from sim_action.commands.logs.ros_messages import TWISTS, MessageSelection, MessageType, Stamps
from sim_action.core.errors import RecordingError
from sim_action.core.field_types import NamesFile, NonNegativeSeconds, PositiveHertz, PositiveSeconds, Seconds
from sim_action.core.geometry import Twist
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import replace
from sim_action.core.wording import did_you_mean, escaped_line
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.kinematics import beyond_limits
from sim_action.robot.model.robot_model import STOP_SLACK, RobotModel
from sim_action.state.command import Answer, Command, JointTargets
from sim_action.state.joint_motion import Curve, JointMotion, held, regular, straight
from sim_action.state.timeline import TimeMark
from sim_action.world.claims import ClaimFinding, Findings, Setting
from sim_action.world.scene import Scene

_CSV: Final = ".csv"
_ROUNDING: Final = 1e-6  # in ticks: two times that differ by less are the same

# Speeds of a log are ignored if they differ by more from the slopes of its positions, as a share and in rad/s or m/s.
_DIFFERENT: Final = 0.5
_SLOW_RADPS: Final = 0.05
_SUDDEN: Final = 4.0  # between two rows, a joint that is this many times faster than before and after them jumps
_TURN: Final = 1e-3  # in rad: rounding of positions that a log keeps within one turn
MAX_GAP_S: Final = 1.0  # between two rows that are farther apart, a joint holds its position, and then steps


class ReplayCommands(CommandSource):
    """Repeats the commands of a recorded log at their original times.

    The log is a CSV file or of ROS: rosbag1 (`.bag`), rosbag2 (a folder, `.db3` or `.mcap`), also compressed
    (`.zstd`). Its time 0 is its first command that the scenario replays; with `clock: shared`, several logs keep their
    distance in time. `start` and `end` cut the log, `offset` shifts it.

    A row acts at its own time: at the nearest physics step, or with a `rate` at its next tick. A command holds until
    the next one, and the last one until the end: let the log end with a stop, or set a `timeout`. Joint positions are
    interpolated, except over gaps of more than 1 s. Angles of continuous joints that wrap go on; regular rows lose
    jitter up to 5 ms where that makes the motion smoother. Notes name what was changed and count unused rows.

    A CSV header has `time` (s) and either `linear`, `lateral`, `angular` (m/s, rad/s) or
    `position.<joint>`, `velocity.<joint>`, `effort.<joint>` (SI units). A unit may follow a name: `time [ms]`. Files of
    PlotJuggler, `rostopic echo -p`, pandas and our own recordings are recognised. For other files, `columns` names the
    column of each meaning, with its unit: `{time: 'stamp [ns]', linear: speed}`.

    From ROS logs, `Twist`, `TwistStamped`, `AckermannDrive`, `AckermannDriveStamped`, `JointState`, `JointTrajectory`
    and `Float64MultiArray` (with `joints`) are replayed. A joint that has several of position, velocity and effort
    follows the first of them; NaN is none. Targets beyond the limits of the model are clipped, with a note. A damaged
    log is read up to the damage, and after it where its index is good; lost messages are counted. A log whose clock was
    set back is refused. A topic or a CSV file has at most 250,000 rows.

    ROS logs need `pip install 'sim-action[rosbags]'`, and in a workflow the input `extras: rosbags`.
    """

    key: ClassVar[str] = "replay"

    replay: Annotated[
        str,
        NamesFile(),
        Field(
            min_length=1,
            description="path of the log: .csv, .bag, .db3, .mcap (also .zstd), or the folder of a rosbag2",
        ),
    ]
    rate: Annotated[
        PositiveHertz,
        Field(
            description="rate of the ticks at which rows act; if it is not stated, each row acts at its own time, and "
            "the trace has 10 rows per second"
        ),
    ] = 10.0
    topic: Annotated[
        str | None,
        Field(min_length=1, description="topic to replay; required for logs of ROS, and for CSV with several topics"),
    ] = None
    type: Annotated[
        MessageType | None, Field(description="message type of the topic; default: the type in the log")
    ] = None
    stamps: Annotated[
        Stamps, Field(description="times of a log of ROS: of receipt, of `header.stamp`, or of `/clock` in the log")
    ] = "receipt"
    columns: Annotated[
        dict[str, str] | None,
        Field(
            min_length=1,
            description="columns of a CSV file: `time`, `linear`, `lateral`, `angular`, `position.<joint>`, "
            "`velocity.<joint>`, `effort.<joint>` -> the name in the file, with its unit; default: recognised",
        ),
    ] = None
    array_joints: Annotated[
        tuple[str, ...],
        Field(alias="joints", description="joints of the numbers of a `Float64MultiArray`, in their order"),
    ] = ()
    interface: Annotated[Kind, Field(description="quantity of the numbers of a `Float64MultiArray`")] = "position"
    only_joints: Annotated[
        tuple[str, ...] | None, Field(min_length=1, description="joints to move; default: all joints in the log")
    ] = None
    clock: Annotated[
        Literal["own", "shared"],
        Field(description="`shared`: the log has the same time 0 as all other logs that share it"),
    ] = "own"
    start: Annotated[NonNegativeSeconds, Field(description="time in the log that corresponds to t = 0")] = 0.0
    end: Annotated[
        NonNegativeSeconds | None, Field(description="time in the log after which its rows are left out")
    ] = None
    offset: Annotated[Seconds, Field(description="sim time that is added to the times of this source")] = 0.0
    timeout: Annotated[
        PositiveSeconds | None, Field(description="time after which a twist expires and the base stops; default: never")
    ] = None

    _same_clock: tuple[ReplayCommands, ...] = PrivateAttr(default=())

    @override
    def tick_rate(self, physics_rate: float) -> float:
        return self.rate if self.has_rate else physics_rate

    @property
    def has_rate(self) -> bool:
        """True if its ticks have a rate of their own."""
        return "rate" in self.model_fields_set

    @property
    @override
    def needed_rate(self) -> float | None:
        return self.rate if self.has_rate else None

    @override
    def among(self, sources: Sequence[CommandSource]) -> Self:
        logs = [source for source in sources if isinstance(source, ReplayCommands)]
        shared = {normpath(log.replay) for log in logs if log.clock == "shared"}
        mine = shared if normpath(self.replay) in shared else {normpath(self.replay)}
        source = self.model_copy()
        same = tuple(log for log in logs if log is not self and normpath(log.replay) in mine)
        source._same_clock = same  # noqa: SLF001 - a copy of itself
        return source

    def problems(self, workspace: Workspace) -> SpecProblems:
        """See CommandSource.problems. A CSV file is read; a log of ROS is not."""
        try:
            path = workspace.file_or_folder(self.replay)
        except PathError as error:
            yield ("replay",), str(error)
        else:
            yield from _csv_problems(self, path) if self._is_csv else _ros_problems(self, path)
        if self.end is not None and self.end <= self.start:
            yield ("end",), f"must be later than 'start' ({self.start:g} s)"

    @property
    def _is_csv(self) -> bool:
        return PurePath(self.replay).suffix == _CSV

    def table(self, path: Path) -> Table:
        """Return the CSV file as this source reads it."""
        return Table(path, self.replay, self.columns, self.topic)

    @property
    @override
    def unchecked(self) -> tuple[str, ...]:
        return () if self._is_csv else (f"topics of {self.replay}: the log is read when the scenario runs",)

    def model_problems(self, scene: Scene) -> SpecProblems:
        """See CommandSource.model_problems: joints that no motor can move."""
        troubles = (self._why_not_moved(name, scene.model) for name in sorted(self.joints(scene)))
        if trouble := next(filter(None, troubles), None):
            yield (("only_joints",), trouble) if self.only_joints else (("replay",), f"{self.replay}: {trouble}")

    @override
    def robot_claims(self, scene: Scene, setting: Setting) -> Findings:
        """Yield a second row after the end of the run: its times may be in another unit."""
        if not self._is_csv or self._same_clock:
            return
        try:
            times = self._times(self.recorded(scene.workspace), scene.workspace)
        except RecordingError:
            return  # another check reports it
        second = next((time for time in times if time > max(times[0], 0.0)), 0.0)
        if second > setting.end:
            message = f"the second row of {self.replay} is at {second:g} s, but the run ends at {setting.end:g} s"
            hint = "if its times are in ms, state it: columns: {time: 'time [ms]', ...}"
            yield ClaimFinding("segment-beyond-run", ("replay",), f"{message} ({setting.end_key}); {hint}")

    @override
    def gives_twists(self, scene: Scene) -> bool:
        header = self._csv_header(scene.workspace)
        return self.type in TWISTS if header is None else header.holds_twists

    @override
    def joints(self, scene: Scene) -> frozenset[str]:
        if self.gives_twists(scene):
            return frozenset()
        header = self._csv_header(scene.workspace)
        return frozenset(self.only_joints or (self.array_joints if header is None else header.joint_names))

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Raises RecordingError, and RunError for a log that does not fit into memory."""
        recorded = self.recorded(scene.workspace)
        for key, message in self._mismatches(recorded, scene):
            raise RecordingError(f"{self.replay}: {message}", key)
        playback = Playback(self, recorded, self._times(recorded, scene.workspace), scene)
        due = None if self.has_rate or not self.is_perfect else playback.due
        return OpenLoop(playback.command, playback.holding, playback.notes, due, playback.marks)

    def _csv_header(self, workspace: Workspace) -> Header | None:
        """Return the header of a CSV log; None for other logs, and if it cannot be read, which `problems` reports."""
        try:
            path = workspace.file_or_folder(self.replay)
            return self.table(path).header() if self._is_csv else None
        except (PathError, RecordingError):
            return None

    def recorded(self, workspace: Workspace) -> Recorded:
        """Return the rows of the log. Raises RecordingError."""
        try:
            path = workspace.file_or_folder(self.replay)
            if self._is_csv:
                return self.table(path).read()
            for file in rosbag.files_of(path, self.replay) if path.is_dir() else ():
                workspace.file(str(path / file))
        except PathError as error:
            raise RecordingError(f"{self.replay}: {error}") from None
        selection = MessageSelection(self.topic or "", self.type, self.stamps, self.array_joints, self.interface)
        return rosbag.read_log(path, self.replay, selection)

    def _times(self, recorded: Recorded, workspace: Workspace) -> list[float]:
        """Return the times of the rows in s, on the clock that this source shares with others."""
        firsts = [other.recorded(workspace).rows[0][0] for other in self._same_clock]
        origin = min([recorded.rows[0][0], *firsts])
        return [(time_ns - origin) / 1e9 for time_ns, _ in recorded.rows]

    def _mismatches(self, recorded: Recorded, scene: Scene) -> Iterator[tuple[str, str]]:
        """Yield keys that do not fit the log, and joints of the log that do not fit the robot."""
        contents = [content for _, content in recorded.rows]
        named = {name for content in contents for name in _joints_in(content)}
        for (key, *_), message in _kind_problems(self, holds_twists=not named):
            yield str(key), message
        if isinstance(contents[0], Steering) and not scene.mobility.wheelbase:
            yield "topic", "its messages steer a car, but the robot has no drive with steered wheels"
        for name in self.only_joints or ():
            if name not in named:
                yield "only_joints", f"the log has no joint '{name}'{did_you_mean(name, named)}"
        for name in self.only_joints or sorted(named):
            if (trouble := self._why_not_moved(name, scene.model)) is not None:
                yield "only_joints" if self.only_joints else "replay", trouble
        times = self._times(recorded, scene.workspace)
        if self.start > times[-1]:
            yield "start", f"the log ends before that time, {times[-1]:g} s after its first command"
        if self.end is not None and self.end < times[0]:
            yield "end", f"the first command is later, at {times[0]:g} s"

    def _why_not_moved(self, name: str, model: RobotModel) -> str | None:
        trouble = model.why_not_driven(name)
        if trouble is None or self.only_joints:
            return trouble
        return f"{trouble}; list the joints to move in 'only_joints'"


def _joints_in(content: Content) -> Iterable[str]:
    if isinstance(content, Mapping):
        return (column.joint for column in content)
    return content.joints if isinstance(content, Trajectory) else ()


def _kind_problems(spec: ReplayCommands, *, holds_twists: bool) -> SpecProblems:
    """Yield keys that do not fit the content of a log."""
    if holds_twists and spec.only_joints is not None:
        yield ("only_joints",), "the log contains twists, not joints; remove this key"
    if not holds_twists and spec.timeout is not None:
        yield (
            ("timeout",),
            "this applies to twists only, but the log contains joints, which keep their last target; remove this key",
        )


def _csv_problems(spec: ReplayCommands, path: Path) -> SpecProblems:
    for key in ("type", "stamps", "joints", "interface"):
        if ("array_joints" if key == "joints" else key) in spec.model_fields_set:
            yield (key,), "this is for logs of ROS, not for a CSV file; remove this key"
    table = spec.table(path)
    try:
        header, rows = table.header(), table.read().rows
    except RecordingError as error:
        yield ("replay",), str(error)
        return
    last = (rows[-1][0] - rows[0][0]) / 1e9
    if spec.start > last and spec.clock == "own" and spec.topic is None:
        yield ("start",), f"the log ends before that time, {last:g} s after its first row"
    yield from _kind_problems(spec, holds_twists=header.holds_twists)
    for name in spec.only_joints or ():
        if not header.holds_twists and name not in header.joint_names:
            yield ("only_joints",), f"the log has no joint '{name}'{did_you_mean(name, header.joint_names)}"


def _ros_problems(spec: ReplayCommands, path: Path) -> SpecProblems:
    if problem := rosbag.path_problem(path):
        yield ("replay",), f"'{spec.replay}' {problem}"
        return
    if spec.topic is None:
        yield ("replay",), "a log of ROS needs a topic to replay, such as topic: /cmd_vel"
    if spec.columns is not None:
        yield ("columns",), "only a CSV file has columns; remove this key"
    if spec.type is not None:
        yield from _kind_problems(spec, holds_twists=spec.type in TWISTS)
    if find_spec(rosbag.PACKAGE) is None:
        yield ("replay",), rosbag.INSTALL_HINT


class Playback:
    """The commands of a log at the ticks of a source.

    Attributes:
        due: the physics steps at which it has a command; for a source without a rate.
        marks: its first and its last row.
        holding: the targets before t = 0 of the joints that it moves: initial positions, velocities of 0.
    """

    def __init__(self, spec: ReplayCommands, recorded: Recorded, times: Sequence[float], scene: Scene) -> None:
        """Args: `times`: of the rows, in s, on the clock of the log."""
        self._spec, self._scene, self._recorded = spec, scene, recorded
        self._rate = spec.tick_rate(scene.physics.rate)
        self._step_s = 1 / scene.physics.rate
        # Half of the last digit, also of the time of the first row.
        rounding = recorded.resolution_s * (0.5 if recorded.rows[0][0] == 0 else 1.0)
        self._tolerance = min(0.5 / self._rate, max(self._step_s / 2, rounding))
        self._answers: dict[int, Command] = {}
        # Time of each row that is not used, and the reason.
        self._unused: list[tuple[float, str]] = []
        self._motors = Saturation(scene.model, spec.replay)
        self._misfits: list[str] = []
        end = math.inf if spec.end is None else spec.end
        kept = [
            (time - spec.start + spec.offset, content)
            for time, (_, content) in zip(times, recorded.rows, strict=True)
            if time <= end
        ]
        self._cut = len(times) - len(kept)
        self._moments = [time for time, _ in kept]
        ends = ((self._moments[0], "began"), (self._moments[-1], "ended"))
        self.marks = [TimeMark(time, time, f"replay of {spec.replay} {what}", is_planned=True) for time, what in ends]
        self.holding = JointTargets()
        if isinstance(kept[0][1], Twist | Steering):
            self._add_twists(kept)
        elif isinstance(kept[0][1], Trajectory):
            self._add_trajectories(kept)
        else:
            self._add_rows(kept)
        self.due = tuple(sorted(self._answers))

    def command(self, time: float) -> Answer:
        """Return the new command at a tick, at a sim time in s; None if there is none."""
        return self._motors.clip_answer(self._answers.get(round(time * self._rate)))

    def notes(self, end: float) -> Iterator[str]:
        """Yield the notes on a run that ended at a sim time in s."""
        yield from self._recorded.notes
        yield from self._motors.notes
        if self._misfits:
            names = ", ".join(self._misfits)
            yield escaped_line(f"{self._spec.replay}: velocities that do not fit the positions were not used: {names}")
        last = end * self._rate - _ROUNDING
        unused = Counter({**self._recorded.unused, "are after 'end'": self._cut})
        unused.update(reason for time, reason in self._unused if self._tick(time) < last)
        unused[f"after the end of the run, at {end:g} s"] = sum(self._tick(time) >= last for time in self._moments)
        reasons = [f"{count} {reason}" for reason, count in unused.items() if count]
        if reasons:
            of = f" of {self._spec.topic}" if self._spec.topic else ""
            total = f"{unused.total()} of {self._recorded.read} rows"
            yield escaped_line(f"{self._spec.replay}{of}: {total} were not used: {', '.join(reasons)}")

    def _tick(self, time: float) -> int:
        """Return the tick of a row at a sim time in s; the first tick for a row before t = 0."""
        return max(0, math.ceil((time - self._tolerance) * self._rate - _ROUNDING))

    def _add_twists(self, rows: Sequence[tuple[float, Content]]) -> None:
        timeout = self._spec.timeout
        for index, (time, content) in enumerate(rows):
            tick = self._tick(time)
            following = rows[index + 1][0] if index + 1 < len(rows) else math.inf
            if following < math.inf and self._tick(following) == tick:
                self._replaced(time, following)
                continue
            self._answers[tick] = self._twist(content)
            if timeout is not None:
                stop = max(tick, math.floor((time + timeout) * self._rate + _ROUNDING) + 1)
                if following == math.inf or stop < self._tick(following):
                    self._answers[stop] = Twist()

    def _twist(self, content: Content) -> Twist:
        if isinstance(content, Steering):
            curvature = math.tan(content.angle) / self._scene.mobility.wheelbase
            return Twist.planar(content.speed, content.speed * curvature)
        assert isinstance(content, Twist)
        return content

    def _replaced(self, time: float, by: float) -> None:
        """Keep that a later row acts at the tick of a row; both are sim times in s."""
        ticks = f"at a tick of {self._rate:g} Hz" if self._spec.has_rate else "in one physics step"
        self._unused.append((time, "before t = 0" if by < self._tolerance else f"replaced by a later one {ticks}"))

    def _add_rows(self, rows: Sequence[tuple[float, Content]]) -> None:
        """Schedule rows of joints: positions as motions, velocities and efforts as steps."""
        columns: dict[JointColumn, dict[float, float]] = {}
        for time, content in rows:
            assert isinstance(content, Mapping)
            for column, value in content.items():
                columns.setdefault(column, {})[time] = value
        usable = [column for column in columns if self._moves(column.joint)]
        kinds = {column.joint: column.kind for column in sorted(usable, key=lambda c: -KINDS.index(c.kind))}
        steps: dict[int, dict[JointColumn, float]] = {}
        for joint, kind in kinds.items():
            values = columns[JointColumn(kind, joint)]
            if kind != "position":
                for time, value in values.items():
                    steps.setdefault(self._tick(time), {})[JointColumn(kind, joint)] = value
        curves = {
            joint: self._curve(
                joint, columns[JointColumn(kind, joint)], columns.get(JointColumn("velocity", joint), {})
            )
            for joint, kind in kinds.items()
            if kind == "position"
        }
        for tick, targets in steps.items():
            groups = {kind: {c.joint: value for c, value in targets.items() if c.kind == kind} for kind in KINDS}
            self._answers[tick] = JointTargets(velocity=groups["velocity"], effort=groups["effort"])
        spaced = set(self._spaced([time for time, _ in rows]))
        for (time, content), (following, _) in pairwise([*rows, (math.inf, {})]):
            assert isinstance(content, Mapping)
            if not any(kinds.get(column.joint) == column.kind for column in content):
                self._unused.append((time, "have no target that is used"))
            elif following < math.inf and (self._tick(time) == self._tick(following) if steps else time not in spaced):
                self._replaced(time, following)
        self._add_motion(curves, velocity=[joint for joint, kind in kinds.items() if kind == "velocity"])

    def _moves(self, joint: str) -> bool:
        return self._spec.only_joints is None or joint in self._spec.only_joints

    def _curve(self, joint: str, positions: Mapping[float, float], speeds: Mapping[float, float] | None) -> Curve:
        """Return the curve through positions in rad (or m) at times in s, with the speeds that are known."""
        speeds = speeds or {}
        # Of rows in one physics step, the last counts.
        written = self._spaced(positions)
        values = self._unwrapped(joint, written, np.array([positions[time] for time in written]))
        times = regular(np.array(written), values)
        rates = np.array([speeds.get(time, math.nan) for time in written])
        stated = np.isfinite(rates)
        if len(times) > 1 and stated.any():
            slopes = np.gradient(values, times)[stated]
            # Many publishers fill the speeds of a motion with 0.
            if np.median(np.abs(slopes - rates[stated])) > _DIFFERENT * np.median(np.abs(slopes)) + _SLOW_RADPS:
                self._misfits.append(joint)
                rates[:] = math.nan
        gaps = np.flatnonzero(np.diff(times) > MAX_GAP_S) + 1
        parts = (np.split(row, gaps) for row in (times, values, rates))
        curve = joined(Curve.through(*part) for part in zip(*parts, strict=True))
        mean = np.abs(np.diff(values) / np.diff(times))
        beside = np.maximum(np.append(0.0, mean[:-1]), np.append(mean[1:], 0.0))
        jumps = np.flatnonzero((mean > _SUDDEN * beside + _SLOW_RADPS) & (np.diff(times) <= MAX_GAP_S)).tolist()
        return replace(curve, sudden=tuple((float(times[k]), float(times[k + 1])) for k in jumps))

    def _spaced(self, times: Iterable[float]) -> list[float]:
        """Return rising times in s without times that are closer than half a physics step before a kept time."""
        kept: list[float] = []
        for time in reversed(list(times)):
            if not kept or kept[-1] - time >= self._step_s / 2:
                kept.append(time)
        return kept[::-1]

    def _unwrapped(self, joint: str, times: Sequence[float], values: FloatArray) -> FloatArray:
        """Return the positions (K,) of a joint that turns on and on; a log may give them within one turn only."""
        wraps = np.flatnonzero(np.abs(np.diff(values)) > math.pi)
        within = -math.pi - _TURN <= values.min() and values.max() - values.min() <= math.tau + _TURN
        if self._scene.model.joints_by_name[joint].type != "continuous" or not within or not len(wraps):
            return values
        at = times[wraps[0] + 1] + self._spec.start - self._spec.offset
        self._motors.notes.append(
            f"{self._spec.replay}: positions of joint '{joint}' wrap at {at:g} s of the log and go on"
        )
        return np.unwrap(values)

    def _add_trajectories(self, rows: Sequence[tuple[float, Content]]) -> None:
        """Schedule trajectories; each replaces the one before, from the state of the joints at its time on."""
        curves: dict[str, Curve] = {}
        for time, content in rows:
            assert isinstance(content, Trajectory)
            for index, joint in enumerate(content.joints):
                if self._moves(joint):
                    before = curves.get(joint) or held([time], [self._scene.joint_positions[joint]])
                    kept = before.times < time
                    cut = Curve(before.times[kept], before.coefficients[kept])
                    curves[joint] = joined([cut, _following(content, index, time, before.at(time))])
        self._add_motion(curves)

    def _add_motion(self, curves: Mapping[str, Curve], velocity: Sequence[str] = ()) -> None:
        """Schedule the motions of joints, each from its first row on, and set the targets before t = 0."""
        beginnings = self._scene.joint_positions
        by_tick: dict[int, dict[str, Curve]] = {}
        for joint, curve in curves.items():
            by_tick.setdefault(self._tick(float(curve.times[0])), {})[joint] = curve
            self._note_limits(joint, curve)
        for tick, group in by_tick.items():
            targets = JointTargets(motions=(JointMotion.of(group),))
            before = self._answers.get(tick)
            self._answers[tick] = before.updated_by(targets) if isinstance(before, JointTargets) else targets
        self.holding = JointTargets(
            position={joint: beginnings[joint] for joint in curves}, velocity=dict.fromkeys(velocity, 0.0)
        )

    def _note_limits(self, joint: str, curve: Curve) -> None:
        """Note positions and speeds that the joint cannot reach, with the place of the first position."""
        limits = self._scene.model.joints_by_name[joint]
        times = curve.samples()
        positions, speeds, _ = curve.states(times)
        lower, upper = limits.range
        beyond = np.flatnonzero((positions < lower) | (positions > upper))
        rows = sum(beyond_limits(limits, row, STOP_SLACK) is not None for row in curve.coefficients[:, 0].tolist())
        # Every eighth sample is a row.
        for index in (beyond[beyond % 8 == 0] if rows else beyond).tolist():
            if problem := beyond_limits(limits, float(positions[index]), STOP_SLACK):
                what = (
                    f"to {rows} positions that it cannot reach, first"
                    if rows
                    else "beyond its limits between two rows,"
                )
                at = times[index] + self._spec.start - self._spec.offset
                self._motors.note_beyond(joint, f"{what} at {at:g} s of the log: {problem}")
                break
        self._motors.clip(JointTargets(velocity={joint: float(np.abs(speeds).max())}))


def joined(curves: Iterable[Curve]) -> Curve:
    """Return the curve that follows each curve from its first knot on."""
    parts = list(curves)
    return Curve(np.concatenate([p.times for p in parts]), np.concatenate([p.coefficients for p in parts]))


def _following(trajectory: Trajectory, index: int, start_s: float, state: tuple[float, float, float]) -> Curve:
    """Return the curve of a joint in a trajectory, from a state (position, velocity, acceleration) on."""
    points = trajectory.points
    if not points:
        return held([start_s], [state[0]])
    is_start = points[0].time > 0
    times = [*([start_s] if is_start else []), *(start_s + point.time for point in points)]
    first = [[value] if is_start else [] for value in state]
    positions = [*first[0], *(point.positions[index] for point in points)]
    if not all(point.velocities for point in points):
        return straight(times, positions, state[1] if is_start else 0.0) if len(times) > 1 else held(times, positions)
    velocities = [*first[1], *(point.velocities[index] for point in points)]
    if not all(point.accelerations for point in points):
        return Curve.through(times, positions, velocities)
    return Curve.through(times, positions, velocities, [*first[2], *(point.accelerations[index] for point in points)])

"""What can be said of a log before it is replayed: CSV is read, logs of ROS are left to the scenario's own process."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path, PurePath
from typing import Final, Protocol

from sim_action.commands.logs import csv_log, ros_log
from sim_action.commands.logs.ros_types import TWISTS
from sim_action.core.errors import RecordingError
from sim_action.core.messages import did_you_mean
from sim_action.core.yaml_errors import SpecProblems

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
    if problem := ros_log.path_problem(path):
        yield ("replay",), f"'{spec.replay}' {problem}"
        return
    if spec.topic is None:
        yield ("replay",), "a log of ROS has many topics: name the one to replay, such as topic: /cmd_vel"
    if spec.type is not None:
        yield from kind_problems(spec, holds_twists=spec.type in TWISTS)
    if find_spec(ros_log.PACKAGE) is None:
        yield ("replay",), ros_log.INSTALLING

"""Recorded logs as commands with times: CSV (`commands/replay.py`) and ROS (`rosbag.py`).

Times never decrease. A log that cannot be read raises RecordingError.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final, Literal, NamedTuple

from sim_action.state.command import Command, JointTargets

TimedCommand = tuple[float, Command]
"""The time in s since the first message of the log, and the command at that time."""


Kind = Literal["position", "velocity", "effort"]
KINDS: Final[tuple[Kind, ...]] = ("position", "velocity", "effort")
"""Kinds of targets, in the order of their priority: a position overrides a velocity, which overrides an effort."""


class JointColumn(NamedTuple):
    """The meaning of a number in a row: a quantity of a joint."""

    kind: Kind
    joint: str


def used_columns(columns: Iterable[JointColumn]) -> Iterator[int]:
    """Return the indices of the columns that are used: for each joint, those of the kind with the highest priority."""
    listed = list(columns)
    best: dict[str, JointColumn] = {}
    for column in sorted(listed, key=lambda column: KINDS.index(column.kind)):
        best.setdefault(column.joint, column)
    return (index for index, column in enumerate(listed) if best[column.joint] == column)


def row_targets(row: Iterable[tuple[JointColumn, float]]) -> JointTargets:
    """Return the command in a row of used columns; in rad, rad/s and N m, or m, m/s and N."""
    groups: dict[Kind, dict[str, float]] = {kind: {} for kind in KINDS}
    for column, value in row:
        groups[column.kind][column.joint] = value
    return JointTargets(position=groups["position"], velocity=groups["velocity"], effort=groups["effort"])

"""Recorded logs: the commands that a robot was once given, with their times.

A log is read as moments: pairs of a time in s since its first message and the command that was given then. Times do not
fall. What cannot be read raises RecordingError.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final, Literal, NamedTuple

from sim_action.state.command import Command, JointTargets

Moment = tuple[float, Command]
"""Time in s since the first message of the log, and the command that was given then."""


Kind = Literal["position", "velocity", "effort"]
KINDS: Final[tuple[Kind, ...]] = ("position", "velocity", "effort")
"""In the order in which they count: a robot that is told where to be is not told how fast as well."""


class JointColumn(NamedTuple):
    """One number of a row: of which joint, and what of it."""

    kind: Kind
    joint: str


def followed(columns: Iterable[JointColumn]) -> Iterator[int]:
    """The places of the columns that count: of each joint the first kind that there is."""
    listed = list(columns)
    best: dict[str, JointColumn] = {}
    for column in sorted(listed, key=lambda column: KINDS.index(column.kind)):
        best.setdefault(column.joint, column)
    return (index for index, column in enumerate(listed) if best[column.joint] == column)


def targets(row: Iterable[tuple[JointColumn, float]]) -> JointTargets:
    """The command of one row, of columns that count; rad, rad/s and N m, or m, m/s and N."""
    groups: dict[Kind, dict[str, float]] = {kind: {} for kind in KINDS}
    for column, value in row:
        groups[column.kind][column.joint] = value
    return JointTargets(position=groups["position"], velocity=groups["velocity"], effort=groups["effort"])

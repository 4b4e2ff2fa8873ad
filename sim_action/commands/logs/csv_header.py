"""The first line of a CSV log: which column is the time, and which tells what of the base or of which joint."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from sim_action.commands.logs.joint_columns import KINDS, JointColumn
from sim_action.core.messages import did_you_mean, shown

MOST_COLUMNS: Final = 1_000
TIME: Final = "time"
TWIST: Final = ("linear", "lateral", "angular")
_ALLOWED: Final = (TIME, *TWIST, *(f"{kind}.<joint>" for kind in KINDS))


class HeaderError(ValueError):
    """A header that tells nothing to replay."""


@dataclass(frozen=True, slots=True)
class Header:
    """What the columns of a file are.

    Attributes:
        columns: their names, in the order of the file.
        joints: what each tells of which joint, and None for others; empty if the file is of a base.
    """

    columns: tuple[str, ...]
    joints: tuple[JointColumn | None, ...] = ()

    @classmethod
    def of(cls, columns: Sequence[str]) -> Header:
        """What a line of names says. Raises HeaderError."""
        if problem := next(_problems(columns), None):
            raise HeaderError(problem)
        joints = tuple(map(_joint_column, columns))
        return cls(tuple(columns), joints if any(joints) else ())

    @property
    def holds_twists(self) -> bool:
        """Whether it is of a base."""
        return not self.joints

    @property
    def joint_names(self) -> frozenset[str]:
        """The joints that are told where to go."""
        return frozenset(column.joint for column in self.joints if column is not None)


def _problems(columns: Sequence[str]) -> Iterator[str]:
    if len(columns) > MOST_COLUMNS:
        yield f"{len(columns):,} columns; no more than {MOST_COLUMNS:,} are read"
    for column, count in Counter(columns).items():
        if count > 1:
            yield f"{count} columns are named {shown(column)}"
    twists = [column for column in columns if column in TWIST]
    of_joints = [column for column in columns if _joint_column(column)]
    for column in columns:
        if column != TIME and column not in twists and column not in of_joints:
            hint = "" if len(columns) > 1 else "; columns are separated by commas"
            yield f"unknown column {shown(column)}{did_you_mean(column, _ALLOWED)}{hint}"
    if TIME not in columns:
        yield f"no column '{TIME}': it says when, in s, each row was commanded"
    if not twists and not of_joints:
        yield f"nothing is commanded beside '{TIME}'{did_you_mean('', _ALLOWED[1:])}"
    if twists and of_joints:
        yield f"'{twists[0]}' is of a base, {shown(of_joints[0])} of a joint; make two files of them"


def _joint_column(column: str) -> JointColumn | None:
    kind = next((kind for kind in KINDS if column.startswith(f"{kind}.")), None)
    joint = column.partition(".")[2]
    return JointColumn(kind, joint) if kind and joint else None

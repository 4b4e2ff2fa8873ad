"""Reproducibility of runs: a digest of all states of a run, and the first difference between two runs."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sim_action.state.trace import COLUMNS, Trace


class Digest:
    """SHA-256 over the state at every step, however the steps are cut into traces."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def add(self, trace: Trace) -> None:
        """Takes in the steps that follow."""
        self._hash.update(trace.state.astype("<f8", order="C", copy=False).tobytes())

    def hexdigest(self) -> str:
        """64 hexadecimal digits."""
        return self._hash.hexdigest()


@dataclass(frozen=True, slots=True)
class Divergence:
    """The first difference between two traces.

    Attributes:
        time: in s of sim time; of the one that was over first, its end, if nothing differs until then.
        column: such as "x of base_position_xyz", or "joint_velocity of elbow"; empty if one was just over first.
        values: of the two, in SI; if one was over first, the times at which they were over.
    """

    time: float
    column: str
    values: tuple[float, float]


def first_divergence(first: Trace, second: Trace) -> Divergence | None:
    """Bit by bit, moment by moment; None: they are the same. Raises ValueError for traces of different robots."""
    if first.joint_names != second.joint_names:
        raise ValueError("the traces have different joints")
    common = min(len(first), len(second))
    # As a digest has it: zeros with different signs are different.
    ours, theirs = (np.ascontiguousarray(trace.state[:common]) for trace in (first, second))
    rows, columns = np.nonzero(ours.view(np.int64) != theirs.view(np.int64))
    if len(rows):
        row, column = int(rows[0]), int(columns[0])
        name = list(_column_names(first.joint_names))[column]
        return Divergence(float(first.time[row]), name, (float(ours[row, column]), float(theirs[row, column])))
    if len(first) == len(second):
        return None
    ends = float(first.time[-1]), float(second.time[-1])
    return Divergence(min(ends), "", ends)


def _column_names(joints: tuple[str, ...]) -> Iterator[str]:
    """Of all columns of a state, in their order."""
    for name in COLUMNS:
        if name.startswith("joint_"):
            yield from (f"{name} of {joint}" for joint in joints)
        elif name == "time":
            yield name
        else:
            yield from (f"{axis} of {name}" for axis in name.rpartition("_")[2])

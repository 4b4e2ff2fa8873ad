"""The moment at which the motions of two runs part, and the command that differed before.

Bases are compared, or the joints if neither base moves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final, Self

import numpy as np

from sim_action.core import units
from sim_action.core.records import dataclass
from sim_action.recording.replay.columns import Column, TextColumn, steady
from sim_action.recording.replay.replay_data import Replay
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import moment, quantity
from sim_action.results.outcome import Outcome
from sim_action.state.trace import FloatArray

POSITION_M: Final = 0.005
ANGLE_RAD: Final = math.radians(0.5)

_ONE_M: Final = 1.0
_MIN_MOVE_M: Final = 1e-3
# Runs of equal length may differ by a moment of the replay.
_SAME_END_S: Final = 0.1
# Commands that differ by less are the same: a share of the larger one, or steps of the stored values.
_SAME_COMMAND_SHARE: Final = 0.01
_SAME_COMMAND_STEPS: Final = 3


@dataclass(frozen=True, slots=True)
class Tolerance:
    """The differences in m and rad up to which two motions count as the same."""

    position: float = POSITION_M
    angle: float = ANGLE_RAD

    @classmethod
    def of(cls, outcome: Outcome) -> Self:
        """Return the tolerance, or the limits of the agreement of two engines where they are larger."""
        verdicts = [each.verdict for each in outcome.expectations if each.assertion == "agreement"]
        limits = [(verdict.unit, verdict.limit or 0.0) for verdict in verdicts]
        position = max((limit for unit, limit in limits if unit == "m"), default=0.0)
        angle = max((limit for unit, limit in limits if unit == "rad"), default=0.0)
        return cls(max(position, POSITION_M), max(angle, ANGLE_RAD))

    @property
    def words(self) -> str:
        """The tolerance in words, such as "5 mm or 0.5 deg"."""
        return f"{_limit_text(self.position, 'm')} or {_limit_text(self.angle, 'rad')}"


@dataclass(frozen=True, slots=True)
class Parting:
    """The first moment at which two motions differ, or at which one of them ends.

    Attributes:
        time: the sim time in s.
        words: how they differ, or which run ends.
        is_end: True if the motions are the same up to there.
    """

    time: float
    words: str
    is_end: bool = False

    @property
    def told(self) -> str:
        """A clause such as "the motions part at 3.40 s, by more than 5 mm"."""
        return f"the motions {'are the same up to' if self.is_end else 'part at'} {moment(self.time)}, {self.words}"


def parting(ours: Replay, theirs: Replay, tolerance: Tolerance | None = None) -> Parting | None:
    """Return the moment at which two runs part; None if the motions are the same, up to a tolerance."""
    tolerance = tolerance or Tolerance()
    mine, other = _times(ours), _times(theirs)
    end = min(mine[-1], other[-1])
    coarse = mine if len(mine) <= len(other) else other
    times = coarse[coarse <= end + 1e-9]
    found = [
        (float(times[np.argmax(beyond)]), limit, unit)
        for difference, limit, unit in _differences(ours, theirs, times, tolerance)
        if (beyond := difference > limit).any()
    ]
    if found:
        time, limit, unit = min(found)
        return Parting(time, f"by more than {_limit_text(limit, unit)}")
    if abs(mine[-1] - other[-1]) > _SAME_END_S:
        return Parting(float(end), f"where {'this' if mine[-1] < other[-1] else 'the other'} run ends", is_end=True)
    return None


def same_motion_text(ours: Replay, theirs: Replay, tolerance: Tolerance) -> str:
    """Return the sentence for two runs that do not part. The joints of a robot that moves are not compared."""
    compared = "motions" if _at_one_place(ours, theirs) or not ours.joint_names else "motions of the bases"
    return f"The {compared} are the same, up to {tolerance.words}"


@dataclass(frozen=True, slots=True, eq=False)
class _Command:
    """One recorded command: times (N,) in s, values (N,), the size of a stored step, and the SI unit."""

    times: FloatArray
    values: FloatArray
    step: float
    unit: str

    def at(self, times: FloatArray) -> FloatArray:
        """Return the values at some times, none of which is before the first one."""
        return self.values[np.searchsorted(self.times, times + 1e-9, side="right") - 1]


def commands_until(ours: Replay, theirs: Replay, until: float) -> str | None:
    """Return the first command that differs from the earlier run up to a sim time in s, such as "linear x 0.28 m/s".

    The text has both values and the moment. It is empty if the commands are the same, and None if they are not known.
    """
    mine, others = _commands(with_zeros(ours, theirs)), _commands(with_zeros(theirs, ours))
    found = []
    for key in mine.keys() & others.keys():
        command, other = mine[key], others[key]
        times = command.times[command.times >= other.times[0]]
        now, then = command.at(times), other.at(times)
        larger = np.maximum(np.abs(now), np.abs(then))
        same = np.maximum(_SAME_COMMAND_SHARE * larger, _SAME_COMMAND_STEPS * max(command.step, other.step))
        differs = np.abs(now - then) > same
        # A single moment may be the one at which a command changes, sampled before and after.
        lasting = np.flatnonzero(differs[1:] & differs[:-1] & (times[:-1] <= until + 1e-9))
        if len(lasting):
            first = int(lasting[0])
            texts = [quantity(float(values[first]), command.unit) for values in (now, then)]
            found.append((float(times[first]), f"{key[1]} {texts[0]}, before {texts[1]}"))
    if found:
        time, words = min(found)
        return f"{words}, at {moment(time)}"
    return "" if mine and mine.keys() == others.keys() else None


def _commands(replay: Replay) -> dict[tuple[str, str], _Command]:
    """Return (group, name) -> each recorded command."""
    found: dict[tuple[str, str], _Command] = {}
    times = _times(replay)
    for channel in replay.channels:
        if channel.commanded:
            own = times if channel.time is None else channel.time.decoded(channel.time.count)
            values = channel.values.decoded(len(own))
            key = one_line(channel.group), one_line(channel.name)
            found[key] = _Command(own, values, channel.values.scale, channel.unit)
    sliding = _sliding(replay)
    for number, (name, column) in enumerate(zip(replay.joint_names, replay.frames.commanded, strict=False)):
        if column is not None:
            unit, values = "m" if number in sliding else "rad", column.decoded(replay.frames.count)
            found["positions", f"{one_line(name)} position"] = _Command(times, values, column.scale, unit)
    return found


def with_zeros(replay: Replay, other: Replay) -> Replay:
    """Return a replay with those channels at zero that only another replay has.

    A quantity of the base or of a joint that is zero all the time has no channel. Without any channel of its kind,
    nothing is known.
    """
    known = {(channel.group, channel.name, channel.commanded) for channel in replay.channels}
    has_twist = any(group == "base" and commanded for group, _, commanded in known)
    groups = {True: {"base"} if has_twist else set(), False: {"base", "joints"} if known else set()}
    still = [
        channel.model_copy(update={"time": None, "values": TextColumn(scale=channel.values.scale, first=0)})
        for channel in other.channels
        if channel.group in groups[channel.commanded] and (channel.group, channel.name, channel.commanded) not in known
    ]
    return replay.model_copy(update={"channels": (*replay.channels, *still)})


def _limit_text(limit: float, unit: str) -> str:
    is_small = unit == "m" and limit < _ONE_M
    return units.display(1000 * limit, "mm") if is_small else units.display(limit, unit)


def _differences(
    ours: Replay, theirs: Replay, times: FloatArray, tolerance: Tolerance
) -> Iterator[tuple[FloatArray, float, str]]:
    """Yield each difference over time, its limit and its unit."""
    mine, other = _base(ours, times), _base(theirs, times)
    yield np.linalg.norm(mine[:, :3] - other[:, :3], axis=1), tolerance.position, "m"
    yield _angles(mine[:, 3:], other[:, 3:]), tolerance.angle, "rad"
    if _at_one_place(ours, theirs):
        sliding = _sliding(ours)
        others = dict(zip(theirs.joint_names, theirs.frames.joints, strict=True))
        for number, (name, column) in enumerate(zip(ours.joint_names, ours.frames.joints, strict=True)):
            if name in others:
                gap = np.abs(_at(ours, column, times) - _at(theirs, others[name], times))
                slides = number in sliding
                yield gap, tolerance.position if slides else tolerance.angle, "m" if slides else "rad"


def _sliding(replay: Replay) -> set[int]:
    return {link.joint.column for link in replay.scene.links if link.joint and link.joint.type == "prismatic"}


def _times(replay: Replay) -> FloatArray:
    return replay.frames.time.decoded(replay.frames.count)


def _at(replay: Replay, column: Column, times: FloatArray) -> FloatArray:
    return np.interp(times, _times(replay), column.decoded(replay.frames.count))


def _base(replay: Replay, times: FloatArray) -> FloatArray:
    """Return (N, 7): position in m and quaternion of the base at some times."""
    count, known = replay.frames.count, _times(replay)
    poses = np.column_stack([column.decoded(count) for column in replay.frames.base])
    poses[:, 3:] = steady(poses[:, 3:])
    return np.column_stack([np.interp(times, known, values) for values in poses.T])


def _angles(mine: FloatArray, other: FloatArray) -> FloatArray:
    mine, other = (each / np.maximum(np.linalg.norm(each, axis=1, keepdims=True), 1e-12) for each in (mine, other))
    apart = np.minimum(np.linalg.norm(mine - other, axis=1), np.linalg.norm(mine + other, axis=1))
    return np.asarray(4 * np.arcsin(np.minimum(apart / 2, 1.0)), dtype=np.float64)


def _at_one_place(ours: Replay, theirs: Replay) -> bool:
    return not _moves(ours) and not _moves(theirs)


def _moves(replay: Replay) -> bool:
    count = replay.frames.count
    return any(float(np.ptp(column.decoded(count))) > _MIN_MOVE_M for column in replay.frames.base)

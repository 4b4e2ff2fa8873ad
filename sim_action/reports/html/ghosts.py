"""Other runs of a scenario, drawn as ghosts in its player: which ones there are, and where their motions part.

They are the run of `--against`, golden trajectories, the run in another engine, and repetitions. A ghost has its
motion and its signals. Its contacts and marks are not drawn.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np

from sim_action.core import units
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import shortened
from sim_action.recording.replay.columns import Column, TextColumn, poses_at
from sim_action.recording.replay.replay_data import Frames, GoldenData, Replay, ReplayReader
from sim_action.recording.replay.scene_data import BodyData, LinkData, PoseNumbers, SceneData
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import moment, quantity
from sim_action.reports.html.document import (
    MAX_REPLAY_BYTES,
    Html,
    PackedReplay,
    ReplayBlocks,
    element,
    joined,
    replay_id,
    stored_replay,
    text,
)
from sim_action.results.outcome import Outcome, repetition_name
from sim_action.state.trace import rotation_angles

if TYPE_CHECKING:
    from sim_action.reports.html.base_run import Base, ScenarioChange


@dataclass(frozen=True, slots=True)
class Ghost:
    """A run that can be drawn in the player of another one."""

    label: str  # its name in the choice and in addresses
    block: str  # the element id of its packed replay
    # the moment at which the two part, or one of them ends; None if their motions are the same to the end
    parting: Parting | None
    alike: str  # the sentence for a pair that does not part
    is_shown: bool = False  # True if it is drawn from the start
    is_repetition: bool = False  # True if it shows the confidence: its path is a thin line, and plots have bands

    def entry(self, blocks: ReplayBlocks) -> dict[str, object]:
        """Return the data for the script of the page."""
        parts = self.parting
        return {
            "label": one_line(self.label),
            "replay": self.block if self.block in blocks.blocks else None,
            "parting": None
            if parts is None
            else {"time": parts.time, "words": f"{parts.clause[0].upper()}{parts.clause[1:]}"},
            "alike": self.alike,
            "shown": self.is_shown,
            "repetition": self.is_repetition,
        }


def ghost(
    label: str, block: str, ours: Replay, theirs: Replay, tolerance: Tolerance | None = None, *, is_shown: bool = False
) -> Ghost:
    """Return the ghost of `theirs` in the player of `ours`."""
    tolerance = tolerance or Tolerance()
    return Ghost(label, block, parting(ours, theirs, tolerance), same_motion_text(ours, theirs, tolerance), is_shown)


def motion_of(replay: Replay, ours: Replay) -> Replay:
    """Return what a ghost of `ours` needs of a replay."""
    return Replay.model_construct(
        version=replay.version,
        scene=replay.scene,
        joint_names=replay.joint_names,
        frames=replay.frames,
        signals=replay.signals,
        channels=with_zeros(replay, ours).channels,
    )


def engine_pairs(outcomes: Sequence[Outcome]) -> Iterator[tuple[Outcome, Outcome]]:
    """Yield the pairs of runs of one scenario in two engines; each run is named after its engine."""
    runs_by_scenario: dict[tuple[str, int | None, str], list[Outcome]] = {}
    for outcome in outcomes:
        if outcome.engine is not None and outcome.name.endswith("]"):
            name = outcome.name.rpartition(" [")[0]
            runs_by_scenario.setdefault((outcome.file, outcome.number, name), []).append(outcome)
    for several in runs_by_scenario.values():
        for place, one in enumerate(several):
            yield from ((one, other) for other in several[place + 1 :] if other.engine != one.engine)


BASE_RUN: Final = "base run"  # the label of the run of `--against`
GOLDEN: Final = "golden trajectory"
REPETITION: Final = "another repetition"  # the label of the first of several runs that differs


class GhostSources:
    """Finds the ghosts of each run of a page, and keeps them until there is room."""

    def __init__(self, outcomes: Sequence[Outcome], ids: Mapping[int, str], folder: Path, base: Base | None) -> None:
        """Start with the runs of a page.

        Args:
            outcomes: all outcomes.
            ids: `id()` of an outcome -> the element id of its article.
            folder: the folder from which outcomes name their replays.
            base: the earlier run; None: there is none.
        """
        self._ids, self._folder, self._base = ids, folder, base
        self._others: dict[int, Outcome] = {}
        for one, other in engine_pairs(outcomes):
            self._others |= {id(one): other, id(other): one}
        self._readers = {kind: ReplayReader() for kind in ("base", "engine", "repetition")}
        # element id -> packed ghost: they get the room that the replays of the page leave
        self._waiting: dict[str, PackedReplay] = {}
        self._waiting_bytes = 0
        self.changes = {} if base is None else dict(base.changes)
        """`id()` of an outcome -> what changed since the base run; complete after `since` of all outcomes."""
        self.by_article: dict[str, list[Ghost]] = {}
        """Element id of an article -> its ghosts."""

    def since(self, identity: str, outcome: Outcome, replay: Replay | None) -> Html:
        """Find the ghosts of a run; return what changed since the base run, and why its motion is not drawn."""
        missing = ""
        if replay is not None:
            missing = self._find_base(identity, outcome, replay)
            self._find_golden(identity, replay)
            self._find_engine(identity, outcome, replay)
            self._find_repetition(identity, outcome, replay)
        parts = self._change_texts(identity, self.changes.get(id(outcome)))
        words = Html("; ".join(map(text, parts)))
        return joined(Html(f"Since the {BASE_RUN}: {words}.") if words else "", missing)

    def _change_texts(self, identity: str, change: ScenarioChange | None) -> Iterator[str]:
        """Yield what changed since the base run, the causes first."""
        parts = [
            base_ghost.parting
            for base_ghost in self.by_article.get(identity, ())
            if base_ghost.label == BASE_RUN and base_ghost.parting
        ]
        same = ""
        if change is not None:
            if change.world:
                yield Html(f"in its world, {element('b', change.world)}")
            if change.command:
                yield Html(f"another command, {element('b', change.command)}")
            same = ", after the same commands" if change.command == "" else ""
        yield from (f"{part.clause}{same}" for part in parts)
        if change is not None:
            yield change.words

    def settle(self, blocks: ReplayBlocks) -> None:
        """Add the ghosts found so far to the page, as far as they fit."""
        for block, packed in self._waiting.items():
            blocks.put(block, packed)
        self._waiting.clear()
        self._waiting_bytes = 0

    def _find_base(self, identity: str, outcome: Outcome, replay: Replay) -> str:
        base = self._base
        old = None if base is None else base.before.get(id(outcome))
        if base is None or old is None:
            return ""
        folder = base.run.folders.get(id(old))
        theirs, missing = (None, "") if folder is None else stored_replay(old, folder, self._readers["base"])
        is_same = old.digest is not None and old.digest == outcome.digest and old.engine == outcome.engine
        if theirs is None:
            if is_same:
                return ""
            return f"The motion of the {BASE_RUN} is not drawn: {missing[0].lower()}{missing[1:]}" if missing else ""

        world = world_changes(replay.scene, theirs.scene)
        command = None
        if not is_same:
            block = f"ghost-{identity}"
            base_ghost = ghost(BASE_RUN, block, replay, theirs, is_shown=old.status != outcome.status)
            self._add(identity, base_ghost, theirs, replay)
            if (part := base_ghost.parting) is not None and not part.is_end:
                command = commands_until(replay, theirs, part.time)
        if id(outcome) in self.changes:
            self.changes[id(outcome)] = replace(self.changes[id(outcome)], world=world, command=command)
        return ""

    def _find_golden(self, identity: str, replay: Replay) -> None:
        for number, golden in enumerate(replay.golden, start=1):
            block, theirs = f"golden-{identity}-{number}", golden_replay(replay, golden)
            label = GOLDEN if number == 1 else f"{GOLDEN} {number}"
            tolerance = Tolerance(max(POSITION_M, golden.position or 0.0), max(ANGLE_RAD, golden.yaw or 0.0))
            self._add(identity, ghost(label, block, replay, theirs, tolerance), theirs, replay)

    def _find_engine(self, identity: str, outcome: Outcome, replay: Replay) -> None:
        other = self._others.get(id(outcome))
        if other is None or id(other) not in self._ids:
            return
        theirs, _ = stored_replay(other, self._folder, self._readers["engine"])
        if theirs is not None:
            limits = [Tolerance.of(run) for run in (outcome, other)]
            tolerance = Tolerance(max(limit.position for limit in limits), max(limit.angle for limit in limits))
            block = replay_id(self._ids[id(other)])
            self._keep(identity, ghost(other.engine or "", block, replay, theirs, tolerance))

    def _find_repetition(self, identity: str, outcome: Outcome, replay: Replay) -> None:
        repeats = outcome.repeats
        stored = [] if repeats is None else [(REPETITION, outcome.name, repeats.replay)]
        stored += [(one.cause, repetition_name(outcome.name, one.cause), one.replay) for one in outcome.repetitions]
        for number, (label, scenario, name) in enumerate(stored, start=1):
            other = outcome.model_copy(update={"name": scenario, "replay": name})
            theirs = stored_replay(other, self._folder, self._readers["repetition"])[0] if name else None
            if theirs is not None:
                block = f"repetition-{identity}" if number == 1 else f"repetition-{identity}-{number}"
                is_shown = label == REPETITION
                repeated = ghost(label, block, replay, theirs, is_shown=is_shown)
                self._add(identity, replace(repeated, is_repetition=not is_shown), theirs, replay)

    def _keep(self, identity: str, new_ghost: Ghost) -> None:
        self.by_article.setdefault(identity, []).append(new_ghost)

    def _add(self, identity: str, new_ghost: Ghost, theirs: Replay, ours: Replay) -> None:
        """Keep a ghost, and its replay for later, unless the ghosts before it already fill a page."""
        self._keep(identity, new_ghost)
        if self._waiting_bytes < MAX_REPLAY_BYTES:
            packed = self._waiting[new_ghost.block] = PackedReplay.of(motion_of(theirs, ours))
            self._waiting_bytes += len(packed.block)


_QUATERNION_SCALE = 1e-5


def golden_replay(replay: Replay, golden: GoldenData) -> Replay:
    """Return the motion of a golden trajectory for the robot of a run.

    The file has the position and heading of the base link and perhaps some joints. So the robot is drawn level, and its
    other joints are where they were at the start of the run.
    """
    count = golden.count
    x, y, z, yaw = golden.base
    half = yaw.decoded(count) / 2
    turned, upright = (Column.encoded(part(half), _QUATERNION_SCALE) for part in (np.sin, np.cos))
    level = Column(scale=1.0, first=0)
    unknown = Column(scale=1.0, first=0, gaps=((0, count),))
    golden_joints = dict(golden.joints)
    frames = Frames(
        time=golden.time,
        base=(x, y, z, level, level, turned, upright),
        joints=tuple(
            golden_joints.get(number, column.model_copy(update={"deltas": (), "gaps": ()}))
            for number, column in enumerate(replay.frames.joints)
        ),
        speed=unknown,
        tilt=unknown,
    )
    # Nothing is known of the bodies.
    scene = replay.scene.model_copy(update={"bodies": ()})
    return Replay.model_construct(version=replay.version, scene=scene, joint_names=replay.joint_names, frames=frames)


_MAX_NAMED: Final = 3
_MAX_NAME: Final = 40


def world_changes(ours: SceneData, theirs: SceneData) -> str:
    """Return what differs from an earlier scene in words, such as "pallet is new"; empty if nothing does."""
    return ", ".join(chain(_of_robot(ours, theirs), _of_bodies(ours.bodies, theirs.bodies)))


def _of_robot(ours: SceneData, theirs: SceneData) -> Iterator[str]:
    if ours.robot != theirs.robot:
        yield f"the robot is {_name(ours.robot)}, not {_name(theirs.robot)}"
    elif [_form(link) for link in ours.links] != [_form(link) for link in theirs.links]:
        yield "the model of the robot differs"


def _of_bodies(ours: Sequence[BodyData], theirs: Sequence[BodyData]) -> Iterator[str]:
    before, now = ({body.name: body for body in several} for several in (theirs, ours))
    both = [(before[name], body) for name, body in now.items() if name in before]
    yield from _named([name for name in now if name not in before], "is new", "are new")
    yield from _named([name for name in before if name not in now], "is gone", "are gone")
    moved = [(new, words) for old, new in both if (words := _moved(old.pose, new.pose))]
    yield from (f"{_name(body.name)} {words}" for body, words in moved[:_MAX_NAMED])
    yield from _named([body.name for body, _ in moved[_MAX_NAMED:]], "starts elsewhere", "start elsewhere")
    yield from _named(
        [new.name for old, new in both if _form(old)["shapes"] != _form(new)["shapes"]],
        "has another shape",
        "have other shapes",
    )


def _form(owner: LinkData | BodyData) -> dict[str, Any]:
    return owner.model_dump(exclude={"shapes": {"__all__": {"color", "opacity"}}})


def _named(names: Sequence[str], one: str, several: str) -> Iterator[str]:
    """Yield one part for bodies of which the same is said."""
    if not names:
        return
    shown = [_name(name) for name in names[:_MAX_NAMED]]
    left = len(names) - len(shown)
    *first, last = [*shown, *([f"{left} more"] if left else [])]
    subject = f"{', '.join(first)} and {last}" if first else last
    yield f"{subject} {one if len(names) == 1 else several}"


def _name(name: str) -> str:
    return shortened(one_line(name), _MAX_NAME)


def _moved(old: PoseNumbers, new: PoseNumbers) -> str:
    """Return how far a pose is from an earlier one; empty if it is the same up to the tolerance of a motion."""
    distance = math.dist(old[:3], new[:3])
    dot = abs(sum(one * other for one, other in zip(old[3:], new[3:], strict=True)))
    turned = 2 * math.acos(min(1.0, dot))
    if distance > POSITION_M:
        return f"starts {units.display(distance, 'm')} elsewhere"
    return f"starts turned by {units.display(turned, 'rad')}" if turned > ANGLE_RAD else ""


POSITION_M: Final = 0.005
ANGLE_RAD: Final = math.radians(0.5)
_ONE_M: Final = 1.0
_MIN_MOVE_M: Final = 1e-3
_SAME_END_S: Final = 0.1  # runs of equal length may differ by a moment of the replay
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
        verdicts = [expected.verdict for expected in outcome.expectations if expected.assertion == "agreement"]
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
    """The first moment at which two motions differ, or at which one of them ends."""

    time: float  # the sim time in s
    words: str  # how they differ, or which run ends
    is_end: bool = False  # True if the motions are the same up to there

    @property
    def clause(self) -> str:
        """A clause such as "the motions part at 3.40 s, by more than 5 mm"."""
        return f"the motions {'are the same up to' if self.is_end else 'part at'} {moment(self.time)}, {self.words}"


def parting(ours: Replay, theirs: Replay, tolerance: Tolerance | None = None) -> Parting | None:
    """Return the moment at which two runs part; None if the motions are the same, up to a tolerance."""
    tolerance = tolerance or Tolerance()
    mine, other = _times(ours), _times(theirs)
    end = min(mine[-1], other[-1])
    coarse = mine if len(mine) <= len(other) else other
    times = coarse[coarse <= end + 1e-9]
    partings = [
        (float(times[np.argmax(beyond)]), limit, unit)
        for difference, limit, unit in _differences(ours, theirs, times, tolerance)
        if (beyond := difference > limit).any()
    ]
    if partings:
        time, limit, unit = min(partings)
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
    """Return the first command that differs from the earlier run, as "linear x 0.28 m/s"; None: not known."""
    mine, others = _commands(with_zeros(ours, theirs)), _commands(with_zeros(theirs, ours))
    changes = []
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
            changes.append((float(times[first]), f"{key[1]} {texts[0]}, before {texts[1]}"))
    if changes:
        time, words = min(changes)
        return f"{words}, at {moment(time)}"
    return "" if mine and mine.keys() == others.keys() else None


def _commands(replay: Replay) -> dict[tuple[str, str], _Command]:
    """Return (group, name) -> each recorded command."""
    commands: dict[tuple[str, str], _Command] = {}
    times = _times(replay)
    for channel in replay.channels:
        if channel.commanded:
            own = times if channel.time is None else channel.time.decoded(channel.time.count)
            values = channel.values.decoded(len(own))
            key = one_line(channel.group), one_line(channel.name)
            commands[key] = _Command(own, values, channel.values.scale, channel.unit)
    sliding = _sliding(replay)
    for number, (name, column) in enumerate(zip(replay.joint_names, replay.frames.commanded, strict=False)):
        if column is not None:
            unit, values = "m" if number in sliding else "rad", column.decoded(replay.frames.count)
            commands["positions", f"{one_line(name)} position"] = _Command(times, values, column.scale, unit)
    return commands


def with_zeros(replay: Replay, other: Replay) -> Replay:
    """Return a replay with those channels at zero that only another replay has.

    A quantity of the base or of a joint that is zero all the time has no channel. Without any channel of its kind,
    nothing is known.
    """
    recorded = {(channel.group, channel.name, channel.commanded) for channel in replay.channels}
    has_twist = any(group == "base" and commanded for group, _, commanded in recorded)
    groups = {True: {"base"} if has_twist else set(), False: {"base", "joints"} if recorded else set()}
    still = [
        channel.model_copy(update={"time": None, "values": TextColumn(scale=channel.values.scale, first=0)})
        for channel in other.channels
        if channel.group in groups[channel.commanded]
        and (channel.group, channel.name, channel.commanded) not in recorded
    ]
    return replay.model_copy(update={"channels": (*replay.channels, *still)})


def _limit_text(limit: float, unit: str) -> str:
    is_small = unit == "m" and limit < _ONE_M
    return units.display(1000 * limit, "mm") if is_small else units.display(limit, unit)


def _differences(
    ours: Replay, theirs: Replay, times: FloatArray, tolerance: Tolerance
) -> Iterator[tuple[FloatArray, float, str]]:
    """Yield each difference over time, its limit and its unit."""
    mine, other = _base_at(ours, times), _base_at(theirs, times)
    yield np.linalg.norm(mine[:, :3] - other[:, :3], axis=1), tolerance.position, "m"
    yield rotation_angles(mine[:, 3:], other[:, 3:]), tolerance.angle, "rad"
    if _at_one_place(ours, theirs):
        sliding = _sliding(ours)
        others = dict(zip(theirs.joint_names, theirs.frames.joints, strict=True))
        for number, (name, column) in enumerate(zip(ours.joint_names, ours.frames.joints, strict=True)):
            if name in others:
                gap = np.abs(_column_at(ours, column, times) - _column_at(theirs, others[name], times))
                slides = number in sliding
                yield gap, tolerance.position if slides else tolerance.angle, "m" if slides else "rad"


def _sliding(replay: Replay) -> set[int]:
    return {link.joint.column for link in replay.scene.links if link.joint and link.joint.type == "prismatic"}


def _times(replay: Replay) -> FloatArray:
    return replay.frames.time.decoded(replay.frames.count)


def _column_at(replay: Replay, column: Column, times: FloatArray) -> FloatArray:
    return np.interp(times, _times(replay), column.decoded(replay.frames.count))


def _base_at(replay: Replay, times: FloatArray) -> FloatArray:
    """Return (N, 7): position in m and quaternion of the base at some times."""
    poses = np.column_stack([column.decoded(replay.frames.count) for column in replay.frames.base])
    return poses_at(times, _times(replay), poses[:, :3], poses[:, 3:])


def _at_one_place(ours: Replay, theirs: Replay) -> bool:
    return not _moves(ours) and not _moves(theirs)


def _moves(replay: Replay) -> bool:
    count = replay.frames.count
    return any(float(np.ptp(column.decoded(count))) > _MIN_MOVE_M for column in replay.frames.base)

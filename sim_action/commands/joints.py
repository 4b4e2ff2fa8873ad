"""Joint targets over time: `joints: [{at: 2 s, position: {elbow: 90 deg}}]`."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise
from types import MappingProxyType
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from sim_action.commands import CommandSource, Controller, OpenLoop
from sim_action.core import units
from sim_action.core.field_types import (
    FrozenModel,
    JointEffort,
    JointPosition,
    JointVelocity,
    NonNegativeSeconds,
    PositiveHertz,
)
from sim_action.core.messages import FirstFew
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.kinematics import beyond_limits, too_fast, too_strong
from sim_action.robot.robot_model import Joint, Reading
from sim_action.state.command import JointTargets
from sim_action.world.scene import Scene

Interpolation = Literal["linear", "minimum_jerk", "hold"]


class JointPoint(FrozenModel):
    """Where some joints shall be, how fast they shall move or how hard their motors shall push at one time."""

    at: Annotated[NonNegativeSeconds, Field(description="sim time; each point is later than the one before")]
    position: Annotated[dict[str, JointPosition], Field(description="of joints, by name")] = Field(default_factory=dict)
    velocity: Annotated[dict[str, JointVelocity], Field(description="of joints, by name")] = Field(default_factory=dict)
    effort: Annotated[dict[str, JointEffort], Field(description="of joints' motors, by name")] = Field(
        default_factory=dict
    )

    @model_validator(mode="after")
    def _names_a_joint(self) -> Self:
        if not any(targets for _, targets in self.groups()):
            raise ValueError("a point names at least one joint, below 'position', 'velocity' or 'effort'")
        return self

    def groups(self) -> Iterator[tuple[Reading, Mapping[str, float | str]]]:
        """What is wanted, and of which joints."""
        yield "position", self.position
        yield "velocity", self.velocity
        yield "effort", self.effort


class JointCommands(CommandSource):
    """Moves joints through points in time: by position, by velocity or by effort.

    Every joint goes its own way, through the points that name it; the others do not concern it. At 0 s it begins where
    the joint does (`robot.joints`), a velocity or an effort with 0, unless a point at 0 s says otherwise. So it is on
    its way to its first point from 0 s on; to let it wait, give it a point where it waits. After its last point it
    stays as it is there. A joint is given positions, or velocities, or efforts, not some of each.

    Between two points, `linear` is a straight line. `minimum_jerk` begins and ends at rest, in every point that names
    the joint, also in those that it only passes through; half way it is at its fastest, 1.875 times as fast as the
    straight line. `hold` is a step at each point.

    Positions are held by a servo, which may use the effort and the velocity that the model allows; it is told how fast
    its target moves on, so that the joint does not fall behind. Velocities are held by a motor with the same effort.
    An effort is applied as it is: nothing else holds such a joint, from 0 s on. While the robot comes to rest before
    0 s, joints with positions are held where they begin, and those with velocities are braked.

    Positions, speeds and efforts that are beyond the limits of the model are errors before anything is run. What a
    tick says holds until the next one: with a higher `rate`, curves are finer.
    """

    points: Annotated[tuple[JointPoint, ...], Field(alias="joints", min_length=1, description="in rising time")]
    interpolation: Annotated[Interpolation, Field(description="the way from one point to the next")] = "linear"
    # It divides what people have as rate of the physics, such as 200, 240 and 1000 Hz.
    rate: Annotated[PositiveHertz, Field(description="of the ticks at which a command is given")] = 40.0

    def problems(self, workspace: Workspace) -> SpecProblems:
        """Points that are not in rising time, joints that are given two kinds of targets."""
        yield from order_problems(self.points)
        yield from two_kinds_problems(self.points)

    def model_problems(self, scene: Scene) -> SpecProblems:
        """See CommandSource.model_problems."""
        yield from misfits(self.points, BLENDS[self.interpolation], scene)

    def joints(self, scene: Scene) -> frozenset[str]:
        """See CommandSource.joints."""
        return frozenset(knot.joint for knot in knots(self.points))

    def _holding(self, scene: Scene) -> JointTargets:
        """Positions where the joints begin, and speeds at 0."""
        beginnings = scene.joint_positions
        return JointTargets(
            position={knot.joint: beginnings[knot.joint] for knot in knots(self.points) if knot.reading == "position"},
            velocity={knot.joint: 0.0 for knot in knots(self.points) if knot.reading == "velocity"},
        )

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open."""
        paths, jumps, last = self._paths(scene), BLENDS[self.interpolation].jumps, self.points[-1].at
        period = 1 / self.rate
        # A servo goes after its target step by step, and the first step of a tick begins at the tick.
        half_way, half_time = (0.0, 0.0) if jumps else ((period - 1 / scene.physics.rate) / 2, period / 2)

        positions_at = lru_cache(maxsize=2)(partial(_values, paths["position"]))  # a tick begins where another ended

        def command(time: float) -> JointTargets | None:
            if time > last + period:
                return None  # all stay as they are
            now = _tick(time)
            here = positions_at(now)
            speeds = {} if jumps else _mean_speeds(here, positions_at(_tick(time + period)), period)
            return JointTargets(
                position=_values(paths["position"], now + half_way) if half_way else here,
                velocity={**speeds, **_values(paths["velocity"], now + half_time)},
                effort=_values(paths["effort"], now + half_time),
            )

        return OpenLoop(command, self._holding(scene))

    def _paths(self, scene: Scene) -> dict[Reading, dict[str, JointPath]]:
        """What is wanted -> joint name -> its path."""
        beginnings = scene.joint_positions
        ways: dict[tuple[Reading, str], dict[float, float]] = {}
        for knot in knots(self.points):
            beginning = beginnings[knot.joint] if knot.reading == "position" else 0.0
            ways.setdefault((knot.reading, knot.joint), {0.0: beginning})[knot.time] = in_si(scene, knot)
        paths: dict[Reading, dict[str, JointPath]] = {"position": {}, "velocity": {}, "effort": {}}
        for (reading, joint), way in ways.items():
            paths[reading][joint] = JointPath(tuple(way), tuple(way.values()), BLENDS[self.interpolation])
        return paths


def _values(paths: Mapping[str, JointPath], time: float) -> dict[str, float]:
    return {name: path.value(time) for name, path in paths.items()}


def _mean_speeds(here: Mapping[str, float], there: Mapping[str, float], period: float) -> dict[str, float]:
    return {name: (there[name] - value) / period for name, value in here.items()}


def _tick(time: float) -> float:
    """A tick that falls on a point belongs to what follows it, whatever the rounding of either."""
    return round(time, 9) + 1e-9


@dataclass(frozen=True, slots=True)
class Blend:
    """The way from one knot to the next.

    Attributes:
        share: of the way, after a share of the time; both in [0, 1).
        peak: greatest speed, as a multiple of the mean speed; None where it jumps.
    """

    share: Callable[[float], float]
    peak: float | None

    @property
    def jumps(self) -> bool:
        """Whether it is a step, which no joint can follow."""
        return self.peak is None


def _minimum_jerk(share: float) -> float:
    """Of all ways from rest to rest the one with the least squared jerk (Flash and Hogan 1985)."""
    return share**3 * (10 + share * (6 * share - 15))


BLENDS: Final = MappingProxyType[Interpolation, Blend](
    {
        "linear": Blend(lambda share: share, 1.0),
        "minimum_jerk": Blend(_minimum_jerk, 1.875),
        "hold": Blend(lambda _: 0.0, None),
    }
)


@dataclass(frozen=True, slots=True)
class JointPath:
    """A number over time, through all of its knots; before the first and after the last, it is as there.

    Attributes:
        times: of the knots, in s, rising.
        values: at the knots.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]
    blend: Blend

    def value(self, time: float) -> float:
        """The number at a time in s."""
        after = bisect_right(self.times, time)
        if after == 0:
            return self.values[0]
        before = after - 1
        if after == len(self.times):
            return self.values[before]
        start, value = self.times[before], self.values[before]
        share = (time - start) / (self.times[after] - start)
        return value + (self.values[after] - value) * self.blend.share(share)


@dataclass(frozen=True, slots=True)
class Knot:
    """What one point says of one joint, as it was written; `index`: of the point."""

    joint: str
    reading: Reading
    index: int
    time: float
    written: float | str

    @property
    def path(self) -> tuple[str | int, ...]:
        """The keys that lead to it."""
        return "joints", self.index, self.reading, self.joint


def knots(points: Iterable[JointPoint]) -> Iterator[Knot]:
    """All of them, point by point."""
    for index, point in enumerate(points):
        for reading, targets in point.groups():
            for joint, written in targets.items():
                yield Knot(joint, reading, index, point.at, written)


def in_si(scene: Scene, knot: Knot) -> float:
    """What is wanted, in rad and N m, or in m and N. Raises units.UnitError."""
    return units.parse(knot.written, scene.model.joints_by_name[knot.joint].dimension(knot.reading))


_LIMITS: Final = MappingProxyType({"position": beyond_limits, "velocity": too_fast, "effort": too_strong})
_WITH_ARTICLE: Final = MappingProxyType({"position": "a position", "velocity": "a velocity", "effort": "an effort"})
# In s, of sim time: scenarios may last no longer.
_LONGEST: Final = 86_400
# Times that are advised are rounded up to it, in s.
_ADVISED: Final = 0.01


def order_problems(points: Sequence[JointPoint]) -> SpecProblems:
    """Points that are not later than the one before."""
    for index, (before, point) in enumerate(pairwise(points), start=1):
        if point.at <= before.at:
            yield ("joints", index, "at"), f"must be later than the point before it, at {before.at:g} s"


def two_kinds_problems(points: Sequence[JointPoint]) -> SpecProblems:
    """Joints that are given targets of two kinds, each once."""
    first: dict[str, Knot] = {}
    told = set[str]()
    for knot in knots(points):
        earlier = first.setdefault(knot.joint, knot)
        if knot.reading != earlier.reading and knot.joint not in told:
            told.add(knot.joint)
            message = f"joint '{knot.joint}' is given {_WITH_ARTICLE[earlier.reading]} as well, at {earlier.time:g} s"
            yield knot.path, f"{message}; a joint is moved by position, by velocity or by effort"


def misfits(points: Sequence[JointPoint], blend: Blend, scene: Scene) -> SpecProblems:
    """Joints that are not there or have no motor, units that are not theirs, what they cannot do."""
    by_joint: dict[str, list[Knot]] = {}
    for knot in knots(points):
        by_joint.setdefault(knot.joint, []).append(knot)
    unknown = FirstFew()
    for name, told in by_joint.items():
        if (trouble := scene.model.why_not_driven(name)) is None:
            yield from _joint_problems(scene.model.joints_by_name[name], told, blend, scene)
        elif unknown.one_more():
            yield told[0].path, trouble


def _joint_problems(joint: Joint, told: Sequence[Knot], blend: Blend, scene: Scene) -> SpecProblems:
    """Values that are not the joint's; where there are none, ways that take longer than they may."""
    goals: list[float] = []
    for knot in told:
        try:
            goals.append(in_si(scene, knot))
        except units.UnitError as error:
            yield knot.path, str(error)
        else:
            if (problem := _LIMITS[knot.reading](joint, goals[-1])) is not None:
                yield knot.path, problem
                goals.pop()
    try:
        beginning = scene.joint_positions[joint.name]
    except units.UnitError:
        return  # which is told of the robot
    if len(goals) == len(told) and blend.peak is not None and all(knot.reading == "position" for knot in told):
        yield from _way_problems(joint, beginning, zip(told, goals, strict=True), blend.peak)


def _way_problems(joint: Joint, value: float, wanted: Iterable[tuple[Knot, float]], peak: float) -> SpecProblems:
    """Ways between positions that would be too fast; the first begins at `value`, at 0 s."""
    time = 0.0
    for knot, goal in wanted:
        way = peak * abs(goal - value)
        # No time is left where the points are not in order, which is told, or where the first is a step at 0 s.
        found = too_fast(joint, way / (knot.time - time)) if knot.time > time else None
        if found is not None and joint.max_velocity is not None:
            yield knot.path, f"too little time from {time:g} s to here: {found}; {_advice(way / joint.max_velocity)}"
        time, value = knot.time, goal


def _advice(least: float) -> str:
    """How much time a way takes; a model may say of a joint that it hardly moves."""
    return f"it takes {math.ceil(least / _ADVISED) * _ADVISED:.4g} s" if least <= _LONGEST else "it takes days"

"""Joint targets over time: `joints: [{at: 2 s, position: {elbow: 90 deg}}]`."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import Annotated, ClassVar, Final, Literal, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.commands import Controller, LinkCommands, OpenLoop
from sim_action.core import units
from sim_action.core.field_types import (
    FrozenModel,
    JointEffort,
    JointPosition,
    JointVelocity,
    NonNegativeSeconds,
    PositiveHertz,
)
from sim_action.core.records import dataclass
from sim_action.core.wording import FirstFew, quoted
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.joint_selection import joints_set_by, selects, setting_problems
from sim_action.robot.model.kinematics import beyond_limits, too_fast, too_strong
from sim_action.robot.model.robot_model import Joint, Reading, RobotModel
from sim_action.state.command import JointTargets
from sim_action.state.joint_motion import Curve, JointMotion, held, resting, straight
from sim_action.state.timeline import TimeMark
from sim_action.world.claims import Findings, Setting, late_points
from sim_action.world.scene import Scene

Interpolation = Literal["linear", "minimum_jerk", "hold"]
_LIMITS: Final[Mapping[Reading, Callable[[Joint, float], str | None]]] = MappingProxyType(
    {"position": beyond_limits, "velocity": too_fast, "effort": too_strong}
)
_WITH_ARTICLE: Final = MappingProxyType({"position": "a position", "velocity": "a velocity", "effort": "an effort"})
_MAX_TIME_S: Final = 86_400  # the longest sim time of a scenario
_ADVICE_STEP_S: Final = 0.01  # times in advice are rounded up to a multiple of this


class JointPoint(FrozenModel):
    """Targets for joints at a time: positions, velocities or efforts."""

    at: Annotated[NonNegativeSeconds, Field(description="sim time, later than that of the point before")]
    position: Annotated[
        dict[str, JointPosition],
        Field(description="target positions of joints, by name, by pattern such as `'*_hip'`, or by group of an SRDF"),
    ] = Field(default_factory=dict)
    velocity: Annotated[dict[str, JointVelocity], Field(description="target velocities of joints, likewise")] = Field(
        default_factory=dict
    )
    effort: Annotated[dict[str, JointEffort], Field(description="efforts of the joints' motors, likewise")] = Field(
        default_factory=dict
    )

    @model_validator(mode="after")
    def _names_a_joint(self) -> Self:
        if not any(targets for _, targets in self.groups()):
            raise ValueError("a point must name at least one joint in 'position', 'velocity' or 'effort'")
        return self

    def groups(self) -> Iterator[tuple[Reading, Mapping[str, float | str]]]:
        """Yield each quantity with its targets by joint name."""
        yield "position", self.position
        yield "velocity", self.velocity
        yield "effort", self.effort


class JointCommands(LinkCommands):
    """Moves joints through points in time: by position, by velocity or by effort.

    A pattern such as `'*_hip'` means every joint with a motor that matches it, and a group of the SRDF (`robot.srdf`)
    its joints. In one point, the name of a joint wins. A joint has positions, velocities or efforts, not a mixture.

    Each joint follows the points that name it. Without a point at 0 s, it starts there with its initial position
    (`robot.joints`), or with a velocity or effort of 0, and moves towards its first point from then on. To let it wait,
    add a point with the same value. After its last point it keeps the value.

    Between two points, `linear` has a constant speed, which changes within 20 ms at a point. `minimum_jerk` is at rest
    at each point that names the joint; its peak speed is 1.875 times the mean. `hold` is a step at each point.

    A servo follows positions without lag, and a motor follows velocities, both within the limits of the model. An
    effort is applied directly: nothing else holds such a joint from 0 s on. Values beyond the limits of the model are
    errors before the run. Positions do not depend on `rate` unless commands are lost or late; for velocities and
    efforts, a higher `rate` gives smoother curves.
    """

    key: ClassVar[str] = "joints"
    is_written: ClassVar[bool] = True

    points: Annotated[
        tuple[JointPoint, ...], Field(alias="joints", min_length=1, description="points in the order of time")
    ]
    interpolation: Annotated[Interpolation, Field(description="interpolation between two points")] = "linear"
    rate: Annotated[PositiveHertz, Field(description="rate of the ticks at which velocities and efforts are given")] = (
        40.0
    )

    @override
    def time_marks(self, sender: str) -> Iterator[TimeMark]:
        yield from super().time_marks(sender)
        for point in self.points:
            names = quoted([name for _, targets in point.groups() for name in targets])
            yield TimeMark(point.at, point.at, f"commanded a target for {names}", is_planned=True)

    def problems(self, workspace: Workspace) -> SpecProblems:
        """Yield points that are not in the order of time, and joints with two kinds of targets."""
        for index, (before, point) in enumerate(pairwise(self.points), start=1):
            if point.at <= before.at:
                yield ("joints", index, "at"), f"must be later than the point before it, at {before.at:g} s"
        yield from mixed_target_problems(self.points)

    @override
    def claims(self, setting: Setting) -> Findings:
        yield from late_points(("joints",), [point.at for point in self.points], setting)

    @override
    def model_problems(self, scene: Scene) -> SpecProblems:
        yield from model_fit_problems(self.points, BLENDS[self.interpolation], scene)

    @override
    def joints(self, scene: Scene) -> frozenset[str]:
        return frozenset(knot.joint for knot in knots(self.points, scene.model))

    def _holding(self, scene: Scene) -> JointTargets:
        """Return the targets before 0 s: initial positions, and velocities of 0."""
        beginnings = scene.joint_positions
        all_knots = list(knots(self.points, scene.model))
        return JointTargets(
            position={knot.joint: beginnings[knot.joint] for knot in all_knots if knot.reading == "position"},
            velocity={knot.joint: 0.0 for knot in all_knots if knot.reading == "velocity"},
        )

    @override
    def open(self, scene: Scene) -> Controller:
        paths, last, half_time = self._paths(scene), self.points[-1].at, 1 / self.rate / 2
        curves = {name: path.blend.curve(path.times, path.values) for name, path in paths["position"].items()}
        motions = (JointMotion.of(curves),) if curves else ()

        def command(time: float) -> JointTargets | None:
            if time > last + 1 / self.rate:
                return None  # all targets stay as they are
            # Velocities and efforts are those at the middle of a tick.
            middle = (round(time, 9) + 1e-9) + (0.0 if self.interpolation == "hold" else half_time)
            return JointTargets(
                velocity=_values(paths["velocity"], middle), effort=_values(paths["effort"], middle), motions=motions
            )

        return OpenLoop(command, self._holding(scene))

    @property
    @override
    def needed_rate(self) -> float | None:
        return None if self._only_moves else super().needed_rate

    @override
    def tick_rate(self, physics_rate: float) -> float:
        return physics_rate / max(1, round(physics_rate)) if self._only_moves else self.rate

    @property
    def _only_moves(self) -> bool:
        """True if there are only positions that arrive at once: these move between ticks, so few ticks will do."""
        return self.is_perfect and not any(point.velocity or point.effort for point in self.points)

    def _paths(self, scene: Scene) -> dict[Reading, dict[str, JointPath]]:
        """Return quantity -> joint name -> path."""
        beginnings = scene.joint_positions
        ways: dict[tuple[Reading, str], dict[float, float]] = {}
        for knot in knots(self.points, scene.model):
            beginning = beginnings[knot.joint] if knot.reading == "position" else 0.0
            ways.setdefault((knot.reading, knot.joint), {0.0: beginning})[knot.time] = in_si(scene, knot)
        paths: dict[Reading, dict[str, JointPath]] = {"position": {}, "velocity": {}, "effort": {}}
        for (reading, joint), way in ways.items():
            paths[reading][joint] = JointPath(tuple(way), tuple(way.values()), BLENDS[self.interpolation])
        return paths


def _values(paths: Mapping[str, JointPath], time: float) -> dict[str, float]:
    return {name: path.value(time) for name, path in paths.items()}


@dataclass(frozen=True, slots=True)
class Blend:
    """An interpolation between two knots."""

    share: Callable[[float], float]  # share of the time -> share of the distance; both in [0, 1)
    peak: float | None  # peak speed as a multiple of the mean speed, without ramps; None for a step
    # times in s and values of knots -> the curve that a position follows
    curve: Callable[[Sequence[float], Sequence[float]], Curve]


def _minimum_jerk(share: float) -> float:
    return share**3 * (10 + share * (6 * share - 15))


BLENDS: Final = MappingProxyType[Interpolation, Blend](
    {
        "linear": Blend(lambda share: share, 1.0, straight),
        "minimum_jerk": Blend(_minimum_jerk, 1.875, resting),
        "hold": Blend(lambda _: 0.0, None, held),
    }
)


@dataclass(frozen=True, slots=True)
class JointPath:
    """A number over time, through knots; constant before the first and after the last."""

    times: tuple[float, ...]  # times of the knots, in s, rising
    values: tuple[float, ...]  # values at the knots
    blend: Blend

    def value(self, time: float) -> float:
        """Return the number at a time in s."""
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
    """The target of one point for one joint, as it is written in the scenario."""

    joint: str
    reading: Reading
    index: int  # the index of the point
    time: float
    written: float | str
    name: str  # the name, pattern or group in the scenario that means the joint

    @property
    def path(self) -> tuple[str | int, ...]:
        """The YAML keys of the target."""
        return "joints", self.index, self.reading, self.name

    def problem(self, message: str) -> tuple[tuple[str | int, ...], str]:
        """Return a problem of the joint; the message names it if the scenario does not."""
        return self.path, message if self.name == self.joint else f"joint '{self.joint}': {message}"


def knots(points: Iterable[JointPoint], model: RobotModel | None = None) -> Iterator[Knot]:
    """Yield all targets, point by point. Without a model, each name is taken for a joint."""
    for index, point in enumerate(points):
        names = {name: None for _, targets in point.groups() for name in targets}
        meant = {name: (name,) for name in names} if model is None else joints_set_by(model, names)
        for reading, targets in point.groups():
            for name, written in targets.items():
                for joint in meant[name]:
                    yield Knot(joint, reading, index, point.at, written, name)


def in_si(scene: Scene, knot: Knot) -> float:
    """Return a target in SI units: rad and N m, or m and N. Raises units.UnitError."""
    return units.parse(knot.written, scene.model.joints_by_name[knot.joint].dimension(knot.reading))


def mixed_target_problems(points: Sequence[JointPoint], model: RobotModel | None = None) -> SpecProblems:
    """Yield each joint with targets of two kinds, once."""
    first: dict[str, Knot] = {}
    reported = set[str]()
    for knot in knots(points, model):
        earlier = first.setdefault(knot.joint, knot)
        if knot.reading != earlier.reading and knot.joint not in reported:
            reported.add(knot.joint)
            message = f"joint '{knot.joint}' also has {_WITH_ARTICLE[earlier.reading]} target, at {earlier.time:g} s"
            yield knot.path, f"{message}; use only one of position, velocity and effort for a joint"


def model_fit_problems(points: Sequence[JointPoint], blend: Blend, scene: Scene) -> SpecProblems:
    """Yield joints that are unknown or cannot be driven, wrong units, and targets beyond the limits."""
    by_joint: dict[str, list[Knot]] = {}
    for knot in knots(points, scene.model):
        by_joint.setdefault(knot.joint, []).append(knot)
    hinted = FirstFew()
    any_selected = False
    for index, point in enumerate(points):
        for reading, targets in point.groups():
            any_selected |= any(selects(scene.model, name) for name in targets)
            for below, message in setting_problems(scene.model, targets, hinted):
                yield ("joints", index, reading, *below), message
    if any_selected:
        yield from mixed_target_problems(points, scene.model)
    unknown = FirstFew()
    for name, joint_knots in by_joint.items():
        if (trouble := scene.model.why_not_driven(name, joint_knots[0].reading)) is None:
            yield from _joint_problems(scene.model.joints_by_name[name], joint_knots, blend, scene)
        elif unknown.one_more():
            yield joint_knots[0].path, trouble


def _joint_problems(joint: Joint, joint_knots: Sequence[Knot], blend: Blend, scene: Scene) -> SpecProblems:
    """Yield invalid targets of a joint; if there are none, motions that are too fast for it."""
    goals: list[float] = []
    for knot in joint_knots:
        try:
            goals.append(in_si(scene, knot))
        except units.UnitError as error:
            yield knot.problem(str(error))
        else:
            if (problem := _LIMITS[knot.reading](joint, goals[-1])) is not None:
                yield knot.problem(problem)
                goals.pop()
    try:
        beginning = scene.joint_positions[joint.name]
    except units.UnitError:
        return  # reported for robot.joints
    if (
        len(goals) == len(joint_knots)
        and blend.peak is not None
        and all(knot.reading == "position" for knot in joint_knots)
    ):
        yield from _way_problems(joint, beginning, zip(joint_knots, goals, strict=True), blend.peak)


def _way_problems(joint: Joint, value: float, goals: Iterable[tuple[Knot, float]], peak: float) -> SpecProblems:
    """Yield motions between positions that are too fast; the first starts at `value` at 0 s."""
    time = 0.0
    for knot, goal in goals:
        way = peak * abs(goal - value)
        # There is no time between points that are not in order, which is reported, or before a step at 0 s.
        problem = too_fast(joint, way / (knot.time - time)) if knot.time > time else None
        if problem is not None and joint.max_velocity is not None:
            advice = _advice(way / joint.max_velocity)
            yield knot.problem(f"the time since {time:g} s is too short: {problem}; {advice}")
        time, value = knot.time, goal


def _advice(least: float) -> str:
    """Return the shortest time for a motion; a model may have a very small velocity limit."""
    return (
        f"allow {math.ceil(least / _ADVICE_STEP_S) * _ADVICE_STEP_S:.4g} s"
        if least <= _MAX_TIME_S
        else "the joint would need days"
    )

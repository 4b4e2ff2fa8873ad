"""A goal must become true: the rule for conditions that are true before anything happens.

With commands or disturbances, a goal that is true at t = 0 says nothing: the robot has not moved yet. It counts only
after it has been false once, or when it holds for an explicit time that begins after something moved, or after a
disturbance began. Without commands and disturbances it must hold for a time from t = 0 on.
"""

from __future__ import annotations

import math
from typing import Any, Final, Self

from typing_extensions import override

from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.bounds import joined
from sim_action.assertions.temporal_logic.windows import HoldTime
from sim_action.core import units
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Signal, Verdict
from sim_action.world.scene import Scene

HOLD_S: Final = 1.0  # the time in s for which a goal that is true from t = 0 on must hold if nothing acts on the robot
MOVED_M: Final = 1e-3  # in m: what moved less has not moved
_MOVED_RAD: Final = math.radians(0.1)
_TURNED_RAD: Final = math.radians(5)  # in PyBullet, braked wheels creep by 0.15 deg/s


@dataclass(frozen=True, eq=False)
class Rest:
    """The state at t = 0, to find out when something moved: the base, or a joint, by 1 mm or 0.1 deg.

    A wheel, that is a continuous joint of a robot with a free base, counts from 5 deg on.
    """

    base_position_xyz: NDArray[Any]  # (3,) m
    base_orientation_xyzw: NDArray[Any]  # (4,) unit quaternion
    joint_position: NDArray[Any]  # (J,) rad or m, in the order of a trace
    joint_limits: NDArray[Any]  # (J,) rad or m; a joint that differs by more has moved

    @classmethod
    def of(cls, scene: Scene, start: Observation) -> Self:
        """Return the state in `start`."""
        return cls(
            np.array(start.pose.position_xyz),
            np.array(start.pose.orientation_xyzw),
            np.array([reading.position for reading in start.joints.values()]),
            np.array([_least_motion(scene, name) for name in start.joints]),
        )

    @classmethod
    def of_trace(cls, trace: Trace) -> Self:
        """Return the state of the base at the first moment of a trace; no joint counts."""
        return cls(trace.base_position_xyz[0], trace.base_orientation_xyzw[0], np.empty(0), np.empty(0))

    def moved(self, trace: Trace) -> NDArray[np.bool_]:
        """Return (T,) True where the base or a joint is away from its state at t = 0."""
        return self.base_moved(trace) | self.joints_moved(trace)

    def base_moved(self, trace: Trace) -> NDArray[np.bool_]:
        """Return (T,) True where the base is away from its pose at t = 0."""
        away = np.linalg.norm(trace.base_position_xyz - self.base_position_xyz, axis=1)
        # |<p, q>| of unit quaternions is the cosine of half the angle between them.
        cosine = np.abs(trace.base_orientation_xyzw @ self.base_orientation_xyzw)
        return np.asarray((away > MOVED_M) | (cosine < math.cos(_MOVED_RAD / 2)), dtype=np.bool_)

    def joints_moved(self, trace: Trace) -> NDArray[np.bool_]:
        """Return (T,) True where a joint is away from its position at t = 0."""
        if not self.joint_position.size or len(trace.joint_names) != self.joint_position.size:
            return np.zeros(len(trace), dtype=np.bool_)
        away = np.abs(trace.joint_position - self.joint_position) > self.joint_limits
        return np.asarray(np.any(away, axis=1), dtype=np.bool_)


def _least_motion(scene: Scene, name: str) -> float:
    """Return the smallest motion in rad or m that counts as a movement of the joint."""
    joint = scene.model.joints_by_name[name]
    if joint.type == "continuous" and not scene.bolted:
        return _TURNED_RAD
    return MOVED_M if joint.dimension("position").si == "m" else _MOVED_RAD


@dataclass(frozen=True, slots=True)
class BecomingTrue(Monitor):
    """The monitor of a goal that must become true. The goal sees the run from the moment on at which it may count."""

    goal: Monitor  # the goal itself
    probe: Monitor  # the goal on all steps so far; it gives the truth before the goal may count
    rest: Rest | None  # the state at t = 0; None if nothing acts on the robot
    hold: HoldTime | None  # the fold of the time for which the goal must hold; None if one moment is enough
    early: HoldTime  # the fold of the time for which it has held since t = 0, if nothing acts on the robot
    disturbed: float = math.inf  # sim time in s of the first disturbance; infinite if there is none
    is_explicit: bool = False  # True if the user gave a time for which the goal must hold
    is_open: bool = False  # True if the goal may count
    at_start: bool | None = None  # True if it was true at the first moment; None before the first moment

    @property
    @override
    def leaves(self) -> tuple[Monitor, ...]:
        return (self.goal if self.is_open else self.probe).leaves

    @property
    @override
    def state(self) -> State:
        if not self.is_open:
            limits = State.BROKEN if self.probe.state is State.BROKEN else State.HOLDS
            return joined(limits, self.early.state)
        if self.hold is None or self.goal.state is State.BROKEN:
            return self.goal.state
        return self.hold.state

    @property
    @override
    def is_decided(self) -> bool:
        judge = self.goal if self.is_open else self.probe
        return self.state is State.BROKEN or (self.state is State.HOLDS and judge.is_decided)

    def begin(self, trace: Trace) -> Self:
        """See Monitor.begin. A goal that was false before the window has been false once."""
        if not len(trace):
            return self
        later = self if self.is_open else replace(self._opened(trace)[0], probe=self.probe.begin(trace))
        return replace(later, goal=later.goal.begin(trace))

    @override
    def observe(self, trace: Trace) -> Self:
        if not len(trace):
            return self
        if self.is_open:
            return self.judged_on(trace)
        later, opening = self._opened(trace)
        if self.rest is None:
            truth = self.probe.truth(trace)
            until = truth.time < opening
            later = replace(later, early=self.early.observe(truth.time[until], truth.holds[until]))
            if later.early.state is State.HOLDS:
                later = replace(later, is_open=False)
        if later.is_open:
            before = trace.between(-math.inf, opening - 2 * TIME_EPSILON_S)
            later = replace(later, goal=self.goal.begin(before))
            return later.judged_on(trace.between(opening, math.inf))
        return replace(later, goal=self.goal.begin(trace), probe=self.probe.observe(trace))

    def judged_on(self, trace: Trace) -> Self:
        """Return the monitor after steps at which the goal counts."""
        hold = None if self.hold is None else self.hold.observe(*self.goal.truth(trace))
        return replace(self, goal=self.goal.observe(trace), hold=hold)

    def _opened(self, trace: Trace) -> tuple[Self, float]:
        """Return the monitor, open if the goal may count, and the sim time in s from which it counts; else infinity."""
        truth = self.probe.truth(trace)
        at_start = bool(truth.holds[0]) if self.at_start is None and len(truth.holds) else self.at_start
        ends = truth.time[~truth.holds]
        opening = float(ends[0]) if len(ends) else math.inf
        if self.rest is not None and self.is_explicit:
            acted = self.rest.moved(trace) | (trace.time >= self.disturbed)
            opening = min(opening, float(trace.time[acted.argmax()])) if acted.any() else opening
        return replace(self, at_start=at_start, is_open=opening < math.inf), opening

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns the time for which the goal has held, if it must hold for a time."""
        truth = self.goal.truth(trace)
        hold = self.early if self.hold is None and self.rest is None and truth.holds[:1].any() else self.hold
        if hold is None or not len(truth.time):
            return ()
        return (Signal("time for which it holds", "s", truth.time, hold.lasting(*truth), lower=hold.wanted),)

    def verdict(self) -> Verdict:
        """Return the verdict of the goal, or on the time for which it held."""
        if not self.is_open:
            return self._unopened(self.probe.verdict())
        told = self.goal.verdict()
        if self.hold is not None and told.passed:
            told = self._held(told, self.hold)
        if told.passed or not self.at_start or self.goal.state is State.BROKEN:
            return told
        return replace(told, message=f"{_ONLY_BEFORE}; {told.message}")

    def _unopened(self, told: Verdict) -> Verdict:
        """Return the verdict on a goal that was true from the first moment on."""
        if not self.at_start or not told.passed:
            return told
        if self.early.state is State.HOLDS:
            message = f"{told.message}; it held for {units.display(self.early.wanted, 's')}"
            return replace(told, time=self.early.goal.time, message=f"{message}, from {self.early.began:.2f} s on")
        if self.rest is None:
            return self._held(told, self.early)
        # To count, the quantity must first miss its limit: it is away from that by this much.
        margin = None if told.margin is None else 0.0 - abs(told.margin)
        return replace(told, passed=False, margin=margin, message=f"{_ONLY_BEFORE}; {_HINT}")

    def _held(self, told: Verdict, hold: HoldTime) -> Verdict:
        """Return the verdict on the time for which the goal held without interruption."""
        passed = hold.state is State.HOLDS
        longest, wanted = units.display_apart(hold.longest, hold.wanted, "s")
        lasted = longest if passed else f"at most {longest} of {wanted}"
        message = f"held for {lasted}, from {hold.began:.2f} s on; {told.message}"
        margin = hold.longest - hold.wanted
        return Verdict(passed, hold.longest, hold.wanted, margin, "s", hold.goal.time, message, judged=told.judged)


_ONLY_BEFORE: Final = "was already true at t = 0, and never became true again"
_HINT: Final = (
    "a goal counts after it was false once, or if it holds for a time 'for' after the base or a joint moved (by 1 mm "
    "or 0.1 deg) or a disturbance began; to demand that nothing changes, use stay_within or joint_within"
)


def becoming_true(
    goal: Monitor, scene: Scene, start: Observation, span: float | None, own_span: float | None, *, explicit: bool
) -> BecomingTrue:
    """Return the monitor of a goal that must become true.

    `span`: the time in s for which the goal must hold; `own_span`: the time in s that the goal checks by itself;
    `explicit`: True if the user gave one of them.
    """
    return BecomingTrue(
        goal,
        goal,
        rest=Rest.of(scene, start) if scene.acted_on else None,
        hold=None if span is None else HoldTime(span),
        early=HoldTime(span or HOLD_S),
        disturbed=min((disturbance.at for disturbance in scene.world.disturbances), default=math.inf),
        is_explicit=explicit,
        # A goal with a time of its own already has to hold.
        is_open=not scene.acted_on and own_span is not None,
    )

"""The time at which an assertion counts: `after`, `before` and `for`, and goals that must become true.

With commands or disturbances, a goal that is true at t = 0 says nothing: the robot has not moved yet. It counts only
after it has been false once, or when it holds for an explicit time that begins after something moved, or after a
disturbance began. Without commands and disturbances it must hold for a time from t = 0 on.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Final, Self

from typing_extensions import override

from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.bounds import Goal, joined
from sim_action.core import units
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, delegated, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.observation import Observation
from sim_action.state.timeline import waits
from sim_action.state.trace import Trace
from sim_action.state.verdict import Judged, Signal, Verdict
from sim_action.world.scene import Scene

HOLD_S: Final = 1.0  # the time in s for which a goal that is true from t = 0 on must hold if nothing acts on the robot
MOVED_M: Final = 1e-3  # in m: what moved less has not moved
_MOVED_RAD: Final = math.radians(0.1)
_TURNED_RAD: Final = math.radians(5)  # in PyBullet, braked wheels creep by 0.15 deg/s
_DIGITS: Final = 9  # sim time is step / rate: equal durations differ by rounding


@dataclass(frozen=True, slots=True)
class Window(Monitor):
    """A monitor that passes on the steps from `after` to `before` only. When it closes, a pending goal is judged."""

    monitor: Monitor
    after: float = 0.0  # after, before: in s of sim time; infinite: an event has not happened, or there is no end
    before: float = math.inf
    over: bool = False  # True if the window has closed
    steps: Judged = Judged()

    @property
    @override
    def state(self) -> State:
        state = self.monitor.state
        if not self.over or state is not State.PENDING:
            return state
        return State.BROKEN if self.verdict().status == "failed" else State.HOLDS

    @property
    def needed_until(self) -> float:
        """See Monitor.needed_until. Nothing is needed after the window, or if no later step can matter."""
        if waits(self.after):
            return 0.0
        if self.over or self.monitor.is_decided:
            return self.after
        return self.before if math.isfinite(self.before) else max(self.after, self.monitor.needed_until)

    leaves: ClassVar[tuple[Monitor, ...]] = delegated("monitor.leaves")
    unmet_premises: ClassVar[tuple[str, ...]] = delegated("monitor.unmet_premises")

    @override
    def observe(self, trace: Trace) -> Self:
        if self.over or not len(trace):
            return self
        monitor = self.monitor
        if trace.time[0] <= self.after + TIME_EPSILON_S:
            monitor = monitor.begin(trace.between(-math.inf, self.after))
        seen = trace.between(self.after, self.before)
        over = bool(trace.time[-1] >= self.before - TIME_EPSILON_S)
        # `replace` would take longer than many a monitor.
        return type(self)(monitor.observe(seen), self.after, self.before, over, self.steps.followed_by(seen.time))

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """Return the curves of the monitor over a whole run. Cumulative quantities begin where the window opens."""
        monitor = self.monitor.begin(trace.between(-math.inf, self.after))
        seen = trace if monitor.is_momentary else trace.between(self.after, self.before)
        if not len(seen):
            return ()
        end = min(self.before, float(trace.time[-1]))
        return tuple(signal.within(self.after, end) for signal in monitor.signals(seen))

    def verdict(self) -> Verdict:
        """Return the verdict of the monitor with the moments at which it was judged."""
        verdict = self.monitor.verdict().counted(self.steps)
        if self.steps.moments or verdict.status != "not_exercised":
            return verdict
        message = f"never checked: the run ended before {self.after:g} s (after); run for longer, or lower 'after'"
        return replace(verdict, message=message)


@dataclass(frozen=True, slots=True)
class HoldTime:
    """A goal: a condition holds without interruption for a given time."""

    duration: float
    # sim time in s since which the condition holds; None if it does not hold at the last step
    since: float | None = None
    goal: Goal = Goal()  # the fold of the duration. Its time is the end of the longest interval.

    state: ClassVar[State] = delegated("goal.state")

    @property
    def longest(self) -> float:
        """The longest duration so far in s; 0 if the condition never held."""
        return max(0.0, self.duration + (-math.inf if self.goal.margin is None else self.goal.margin))

    @property
    def began(self) -> float:
        """Sim time in s at which the longest interval began. Meaningful only if there is one."""
        return (self.goal.time or 0.0) - self.longest

    def observe(self, time: FloatArray, holds: NDArray[np.bool_]) -> Self:
        """Return the fold after these steps; `time` in s and `holds`, each (T,)."""
        if not len(time):
            return self
        since = self._since(time, holds)
        margin = np.where(holds, np.round(time - since - self.duration, _DIGITS) + 0.0, -math.inf)
        goal = self.goal.observe(time, margin)
        return replace(self, since=float(since[-1]) if holds[-1] else None, goal=goal)

    def lasting(self, time: FloatArray, holds: NDArray[np.bool_]) -> FloatArray:
        """Return (T,) s for which the condition has held at each step; 0 where it does not hold."""
        return np.where(holds, np.round(time - self._since(time, holds), _DIGITS), 0.0)

    def _since(self, time: FloatArray, holds: NDArray[np.bool_]) -> FloatArray:
        """Return (T,) s of sim time since which the condition holds, where it holds."""
        held_before = np.concatenate(([self.since is not None], holds[:-1]))
        begins = np.where(holds & ~held_before, time, -math.inf)
        first = begins[0] if self.since is None else self.since
        return np.asarray(np.maximum.accumulate(np.concatenate(([first], begins[1:]))), dtype=np.float64)


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
        return (Signal("time for which it holds", "s", truth.time, hold.lasting(*truth), lower=hold.duration),)

    def verdict(self) -> Verdict:
        """Return the verdict of the goal, or on the time for which it held."""
        if not self.is_open:
            return self._unopened(self.probe.verdict())
        verdict = self.goal.verdict()
        if self.hold is not None and verdict.passed:
            verdict = self._held(verdict, self.hold)
        if verdict.passed or not self.at_start or self.goal.state is State.BROKEN:
            return verdict
        return replace(verdict, message=f"{_ONLY_BEFORE}; {verdict.message}")

    def _unopened(self, verdict: Verdict) -> Verdict:
        """Return the verdict on a goal that was true from the first moment on."""
        if not self.at_start or not verdict.passed:
            return verdict
        if self.early.state is State.HOLDS:
            message = f"{verdict.message}; it held for {units.display(self.early.duration, 's')}"
            return replace(verdict, time=self.early.goal.time, message=f"{message}, from {self.early.began:.2f} s on")
        if self.rest is None:
            return self._held(verdict, self.early)
        # To count, the quantity must first miss its limit: it is away from that by this much.
        margin = None if verdict.margin is None else 0.0 - abs(verdict.margin)
        return replace(verdict, passed=False, margin=margin, message=f"{_ONLY_BEFORE}; {_HINT}")

    def _held(self, verdict: Verdict, hold: HoldTime) -> Verdict:
        """Return the verdict on the time for which the goal held without interruption."""
        passed = hold.state is State.HOLDS
        longest, required = units.display_apart(hold.longest, hold.duration, "s")
        lasted = longest if passed else f"at most {longest} of {required}"
        message = f"held for {lasted}, from {hold.began:.2f} s on; {verdict.message}"
        margin = hold.longest - hold.duration
        return Verdict(passed, hold.longest, hold.duration, margin, "s", hold.goal.time, message, judged=verdict.judged)


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

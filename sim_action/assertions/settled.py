"""`settled: {for: 1 s}` and `stops_before: {body: wall, gap: [20 cm, 60 cm]}`: the robot comes to rest."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, ClassVar, NamedTuple, Self

from annotated_types import Gt
from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Assertion, Reference
from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.base_motion import BaseMotion
from sim_action.assertions.monitors.bounds import check_interval
from sim_action.assertions.monitors.contacts import distances, nearest_of, touching_at
from sim_action.assertions.monitors.watched import MotionAssertion, Watched
from sim_action.assertions.monitors.windows import HoldTime
from sim_action.core import units
from sim_action.core.field_types import NonNegativeMetres, PositiveMetresPerSecond, PositiveSeconds, Quantity
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, delegated, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_document import SpecProblems
from sim_action.state.observation import Contact, Observation
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, ClearanceWatch, Nearness
from sim_action.state.verdict import Mark, Polyline, Signal, Verdict
from sim_action.world.claims import UNSTABLE, Ceiling, ClaimFinding, Findings
from sim_action.world.distance_lines import distance_lines
from sim_action.world.scene import Scene

RestRadiansPerSecond = Annotated[float, Gt(0), Quantity((units.ANGULAR_SPEED,), most_bare=1.0)]
"""An angular speed of a robot at rest: from 1 rad/s on, a number without a unit is probably in deg/s."""


class AtRest(Assertion):
    """The definition of rest: the maximum speeds and the minimum duration."""

    ceilings: ClassVar[tuple[Ceiling, ...]] = (
        Ceiling("speed", "m/s", f"{UNSTABLE}max_speed", lambda setting: setting.physics.max_speed),
        Ceiling("turn_rate", "rad/s", f"{UNSTABLE}max_turn_rate", lambda setting: setting.physics.max_turn_rate),
    )

    speed: Annotated[PositiveMetresPerSecond, Field(description="maximum speed of the base and of sliding joints")] = (
        0.01
    )
    turn_rate: Annotated[
        RestRadiansPerSecond, Field(description="maximum turn rate of the base and of rotating joints")
    ] = math.radians(1)
    span: Annotated[PositiveSeconds, Field(alias="for", description="required time at rest")] = 1.0

    hold_time: ClassVar[float | None] = delegated("span")


class Settled(AtRest, MotionAssertion):
    """The robot comes to rest and stays at rest for the time `for`.

    It is a goal. The robot is at rest while the base, and the joints if they count, are no faster than `speed` and
    `turn_rate`; with `link`, the link relative to `frame`. Motion after that time does not matter. The robot is also at
    rest before its first command: if it waits for one, set `after`.
    """

    key: ClassVar[str] = "settled"
    reference: ClassVar[Reference] = Reference(
        "motion",
        "goal",
        "The robot moved, and then was at rest for the time `for`.",
        "The robot was never at rest for so long, or it was at rest from t = 0 on and never moved.",
    )
    subject_ends: ClassVar[str] = ": "

    joints: Annotated[
        bool | None,
        Field(description="true: joints must be at rest too; default: only if the base is fixed, without 'link'"),
    ] = None

    is_goal: ClassVar[bool] = True
    has_truth: ClassVar[bool] = True

    @property
    @override
    def judges_motion_alone(self) -> bool:
        return not self.joints

    @override
    def fixed_base_claims(self) -> Findings:
        if self.joints is False:
            message = "only the base must come to rest, but it is fixed and never moves; remove 'joints: false'"
            yield ClaimFinding("fixed-base", ("joints",), message)

    @override
    def title_of(self, watched: Watched) -> str:
        return f"{self.key_of(watched)} for {units.display(self.span, 's')}"

    @override
    def opened_on(self, watched: Watched, scene: Scene, start: Observation) -> Monitor:
        counting = scene.bolted and not watched.name if self.joints is None else self.joints
        joints = {joint.name: joint.dimension("velocity").si for joint in scene.model.moving_joints if counting}
        return SettledMonitor(
            self, watched.who, tuple(joints.items()), HoldTime(self.span), BaseMotion.of(scene, start)
        )


class Motion(NamedTuple):
    """One speed over time, (T,) in `unit`, and the limit below which it counts as rest."""

    name: str
    what: str
    speed: FloatArray
    limit: float
    unit: str

    @property
    def last(self) -> str:
        """The motion at the last step as text."""
        speed, _ = units.display_apart(float(self.speed[-1]), self.limit, self.unit)
        return f"{self.what} with {speed}"


@dataclass(frozen=True, slots=True)
class SettledMonitor(Monitor):
    """The fold of the time at rest, and the fastest motion at the last step."""

    is_goal = True

    spec: Settled
    who: str  # the name of the frame that must be at rest
    joints: tuple[tuple[str, str], ...]  # the joints that count, each with the unit of its velocity
    rest: HoldTime
    motion: BaseMotion
    end: float | None = None
    last: str = ""

    state: ClassVar[State] = delegated("rest.state")

    @override
    def observe(self, trace: Trace) -> Self:
        if not len(trace) or self.state is State.HOLDS:
            return self
        motions = list(self._motions(trace))
        slow = _are_slow(motions)
        fastest = max(motions, key=lambda motion: float(motion.speed[-1]) / motion.limit)
        return replace(
            self,
            rest=self.rest.observe(trace.time, slow),
            motion=self.motion.after(trace),
            end=float(trace.time[-1]),
            last="it still was" if slow[-1] else fastest.last,
        )

    def truth(self, trace: Trace) -> Truth:
        """See Monitor.truth. It is true while the robot is at rest, from the first step on."""
        return Truth(trace.time, _are_slow(list(self._motions(trace))))

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns the time at rest and the speeds with their limits."""
        motions = list(self._motions(trace))
        rest = self.rest.lasting(trace.time, _are_slow(motions))
        return (
            Signal("time at rest", "s", trace.time, rest, lower=self.rest.duration),
            *(Signal(motion.name, motion.unit, trace.time, motion.speed, upper=motion.limit) for motion in motions),
        )

    def _motions(self, trace: Trace) -> Iterator[Motion]:
        """Yield the speeds of the base and the joints."""
        spec = self.spec
        yield Motion("speed", f"{self.who} moved", self.motion.speed(trace), spec.speed, "m/s")
        yield Motion("turn rate", f"{self.who} turned", self.motion.turn_rate(trace), spec.turn_rate, "rad/s")
        for name, unit in self.joints:
            speed = abs(trace.joint_velocity[:, trace.joint_names.index(name)])
            limit = spec.speed if unit == "m/s" else spec.turn_rate
            yield Motion(f"{name} speed", f"{name} moved", speed, limit, unit)

    def verdict(self) -> Verdict:
        """Return the verdict. `measured` is the longest time at rest."""
        passed, rest = self.state is State.HOLDS, self.rest
        if self.end is None:
            return Verdict(False, None, rest.duration, None, "s", None, "no physics step to measure")
        longest, required = units.display_apart(rest.longest, rest.duration, "s")
        when = f", from {rest.began:.2f} s on" if rest.longest else ""
        message = (
            f"at rest from {rest.began:.2f} s on, for {longest}"
            if passed
            else f"at rest for {longest} of {required}{when}; at {self.end:.2f} s {self.last}"
        )
        return Verdict(passed, rest.longest, rest.duration, rest.longest - rest.duration, "s", rest.goal.time, message)


def _are_slow(motions: Sequence[Motion]) -> NDArray[np.bool_]:
    return np.asarray(np.all([motion.speed <= motion.limit for motion in motions], axis=0))


class StopsBefore(AtRest):
    """The robot stops in front of `body`, at a distance between the two values of `gap`, and never touches the body.

    It is a goal. The gap is the least distance of any link from the body. It is checked only while the robot is at
    rest; it may have been smaller before. To limit it at all times, add `clearance`. Motion after the stop does not
    matter.
    """

    key: ClassVar[str] = "stops_before"
    reference: ClassVar[Reference] = Reference(
        "contact",
        "goal; not touching: invariant",
        "The robot moved, and then was at rest for the time `for` with an allowed gap.",
        "The robot touched the body, was never at rest for so long with an allowed gap, or only from t = 0 on.",
    )
    sees_shapes: ClassVar[bool] = True

    body: Annotated[str, Field(min_length=1, description="name of the object")]
    gap: Annotated[tuple[NonNegativeMetres, NonNegativeMetres], Field(description="a goal: [lower, upper]")]

    @model_validator(mode="after")
    def _is_a_gap(self) -> Self:
        check_interval("gap", *self.gap, "m")
        return self

    is_goal: ClassVar[bool] = True
    has_truth: ClassVar[bool] = True

    @property
    @override
    def title(self) -> str:
        return f"{self.key} {self.body} with a gap of {' to '.join(units.display(bound, 'm') for bound in self.gap)}"

    @property
    def near(self) -> ClearanceWatch:
        """The distances that are recorded at every step, up to the greatest allowed gap."""
        return ClearanceWatch(bodies=(self.body,), within=self.gap[1], always=True)

    @property
    def far(self) -> ClearanceWatch:
        """The least distance, for a robot that stops too far away."""
        return ClearanceWatch(bodies=(self.body,))

    @property
    @override
    def channels(self) -> Channels:
        return Channels(contacts=True, clearances=frozenset({self.near, self.far}))

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield a body that does not exist."""
        bodies = scene.world.names
        if self.body not in bodies:
            yield ("body",), f"the world has no body '{self.body}'{did_you_mean(self.body, bodies)}"

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """See Assertion.marks. Returns a line at each bound of the gap, if the body does not move."""
        bounds = (bound for bound in self.gap if bound > 0)
        return tuple(
            Polyline(points, is_aside=True) for bound in bounds for points in distance_lines(scene, (self.body,), bound)
        )

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        return StopsBeforeMonitor(self, HoldTime(self.span), BaseMotion.of(scene, start))


@dataclass(frozen=True, slots=True)
class StopsBeforeMonitor(Monitor):
    """The fold of the time at rest with an allowed gap, and of the facts for the message."""

    spec: StopsBefore
    rest: HoldTime
    base: BaseMotion  # the motion of the base, with its jumps
    touch: Contact | None = None  # the first contact with the body
    nearest: Nearness | None = None  # the least distance
    gap: float | None = None  # gap at the last step in m; None if it is greater than allowed
    met: float | None = None  # gap in m when the robot had rested long enough
    motion: str = ""  # the motion at the last step as text
    end: float | None = None

    @property
    @override
    def state(self) -> State:
        return State.BROKEN if self.touch is not None else self.rest.state

    @property
    def is_decided(self) -> bool:
        """See Monitor.is_decided. Only a contact decides, because a stopped robot may move on."""
        return self.state is State.BROKEN

    @override
    def observe(self, trace: Trace) -> Self:
        touches = (contact for contact in trace.contacts if contact.body == self.spec.body)
        seen = replace(
            self, touch=self.touch or next(touches, None), nearest=nearest_of(trace, self.spec.far, self.nearest)
        )
        return seen.moved(trace, self._gaps(trace)) if len(trace) else seen

    def moved(self, trace: Trace, gaps: FloatArray) -> Self:
        """Return the monitor after these steps; `gaps`: (T,) m, infinite where greater than allowed."""
        rest = self.rest.observe(trace.time, self._rests(trace, gaps))
        met = self.met
        if met is None and rest.state is State.HOLDS:
            met = float(gaps[int((trace.time == rest.goal.time).argmax())])
        gap = float(gaps[-1]) if np.isfinite(gaps[-1]) else None
        return replace(
            self,
            rest=rest,
            base=self.base.after(trace),
            met=met,
            gap=gap,
            motion=self._motion(trace),
            end=float(trace.time[-1]),
        )

    def truth(self, trace: Trace) -> Truth:
        """See Monitor.truth. It is true at steps at rest with an allowed gap, without a touch, after t = 0."""
        times = np.unique([contact.time for contact in trace.contacts if contact.body == self.spec.body])
        touching = touching_at(trace, times, 2 * TIME_EPSILON_S)
        rests = self._rests(trace, self._gaps(trace))[len(trace) - len(touching.time) :]
        return Truth(touching.time, rests & ~touching.holds)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns the gap and the time at rest with an allowed gap."""
        lower, upper = self.spec.gap
        rest = self.rest.lasting(trace.time, self._rests(trace, self._gaps(trace)))
        return (
            Signal(f"gap to {self.spec.body}", "m", *self._known_gaps(trace), lower, upper),
            Signal("time at rest", "s", trace.time, rest, lower=self.rest.duration),
        )

    def _known_gaps(self, trace: Trace) -> tuple[FloatArray, FloatArray]:
        """Return (N,) s and (N,) m: all recorded gaps up to the first contact."""
        time, gaps = distances(trace, self.spec.near, self.spec.far)
        touch = next((contact for contact in trace.contacts if contact.body == self.spec.body), None)
        if touch is None:
            return time, gaps
        before = time < touch.time
        return np.append(time[before], touch.time), np.append(gaps[before], 0.0)

    def _rests(self, trace: Trace, gaps: FloatArray) -> NDArray[np.bool_]:
        """Return (T,) True where the robot is at rest with an allowed gap."""
        lower, upper = self.spec.gap
        slow = (self.base.speed(trace) <= self.spec.speed) & (self.base.turn_rate(trace) <= self.spec.turn_rate)
        return np.asarray(slow & (gaps >= lower) & (gaps <= upper))

    def _motion(self, trace: Trace) -> str:
        speed, turn_rate = float(self.base.speed(trace)[-1]), float(self.base.turn_rate(trace)[-1])
        if speed > self.spec.speed:
            return f"moving with {units.display(speed, 'm/s')}"
        return "at rest" if turn_rate <= self.spec.turn_rate else f"turning with {units.display(turn_rate, 'rad/s')}"

    def verdict(self) -> Verdict:
        """Return the verdict. `measured` is the gap, or the time at rest if that is too short."""
        lower, upper = self.spec.gap
        if self.touch is not None:
            message = f"{self.touch.link} touched {self.spec.body} at {self.touch.time:.2f} s"
            return Verdict(False, 0.0, lower, -lower, "m", self.touch.time, message, body=self.spec.body)
        if self.met is not None:
            limit, margin = min((lower, self.met - lower), (upper, upper - self.met), key=lambda side: side[1])
            message = f"at rest {units.display(self.met, 'm')} before {self.spec.body} from {self.rest.began:.2f} s on"
            return Verdict(True, self.met, limit, margin, "m", self.rest.goal.time, message)
        if self.gap is not None and self.gap >= lower:
            return self._too_short()
        return self._elsewhere()

    def _too_short(self) -> Verdict:
        rest, where = self.rest, f"{units.display(self.gap or 0.0, 'm')} before {self.spec.body}"
        lasted, required = units.display_apart(rest.longest, rest.duration, "s")
        message = f"at rest for {lasted} of {required}; {self._last()} {where}"
        return Verdict(False, rest.longest, rest.duration, rest.longest - rest.duration, "s", self.end, message)

    def _elsewhere(self) -> Verdict:
        lower, upper = self.spec.gap
        if self.gap is None and self.nearest is None:
            what = "no physics step to measure" if self.end is None else "no distance to measure"
            return Verdict(False, None, upper, None, "m", self.end, what)
        if self.gap is not None:
            gap, limit = units.display_apart(self.gap, lower, "m")
            message = f"{self._last()} {gap} before {self.spec.body}, less than {limit}"
            return Verdict(False, self.gap, lower, self.gap - lower, "m", self.end, message)
        distance, time = (self.nearest.distance, self.nearest.time) if self.nearest else (0.0, 0.0)
        near, limit = units.display_apart(distance, upper, "m")
        message = f"{self._last()} more than {limit} before {self.spec.body}; closest was {near} at {time:.2f} s"
        return Verdict(False, distance, upper, min(0.0, upper - distance), "m", self.end, message)

    def _last(self) -> str:
        return f"at {self.end or 0.0:.2f} s it was {self.motion},"

    def _gaps(self, trace: Trace) -> FloatArray:
        gaps = np.full(len(trace), np.inf)
        record = trace.clearances.get(self.spec.near)
        if record is not None:
            # A stored trace is decimated: it has fewer steps than distances.
            _, moments, indices = np.intersect1d(trace.time, record.time, return_indices=True)
            gaps[moments] = record.distance[indices]
        return gaps

"""`settled: {speed: 1 cm/s, for: 1 s}`: the robot, or a link, comes to rest."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, ClassVar, NamedTuple, Self

from annotated_types import Gt
from pydantic import Field
from typing_extensions import override

from sim_action.assertions import Assertion, Reference
from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.base_motion import BaseMotion
from sim_action.assertions.monitors.watched import MotionAssertion, Watched
from sim_action.assertions.temporal_logic.windows import HoldTime
from sim_action.core import units
from sim_action.core.field_types import PositiveMetresPerSecond, PositiveSeconds, Quantity
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, replace
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Signal, Verdict
from sim_action.world.claims import UNSTABLE, Ceiling, ClaimFinding, Findings
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

    @property
    @override
    def hold_time(self) -> float | None:
        return self.span


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

    @property
    @override
    def state(self) -> State:
        return self.rest.state

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
            Signal("time at rest", "s", trace.time, rest, lower=self.rest.wanted),
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
            return Verdict(False, None, rest.wanted, None, "s", None, "no physics step to measure")
        longest, wanted = units.display_apart(rest.longest, rest.wanted, "s")
        when = f", from {rest.began:.2f} s on" if rest.longest else ""
        message = (
            f"at rest from {rest.began:.2f} s on, for {longest}"
            if passed
            else f"at rest for {longest} of {wanted}{when}; at {self.end:.2f} s {self.last}"
        )
        return Verdict(passed, rest.longest, rest.wanted, rest.longest - rest.wanted, "s", rest.goal.time, message)


def _are_slow(motions: Sequence[Motion]) -> NDArray[np.bool_]:
    return np.asarray(np.all([motion.speed <= motion.limit for motion in motions], axis=0))

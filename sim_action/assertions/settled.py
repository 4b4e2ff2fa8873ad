"""`settled: {speed: 1 cm/s, for: 1 s}`: the robot comes to rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import Field

from sim_action import units
from sim_action.assertions import Monitor, State
from sim_action.assertions.at_rest import AtRest
from sim_action.assertions.stretch import Stretch
from sim_action.observation import Observation
from sim_action.scene import Scene
from sim_action.verdict import Verdict

if TYPE_CHECKING:
    from sim_action.trace import FloatArray, Trace


class Settled(AtRest):
    """A goal: the robot comes to rest, and stays at rest for some time.

    At rest is what moves and turns no faster than two limits: the base, and the joints where they count. The time is
    one stretch without a break; what the robot does after it is not asked. Before its first command the robot is at
    rest, too: where it has to wait for one, say with `after` from when on this counts.
    """

    key: ClassVar[str] = "settled"

    joints: Annotated[bool | None, Field(description="whether they count; left out: if the base is fixed")] = None

    @property
    def title(self) -> str:
        """See Assertion.title."""
        return f"settled for {units.display(self.span, 's')}"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        counting = scene.bolted if self.joints is None else self.joints
        joints = {joint.name: joint.dimension("velocity").si for joint in scene.model.moving_joints if counting}
        return SettledMonitor(self, tuple(joints.items()), Stretch(self.span))

    def motions(self, trace: Trace, joints: tuple[tuple[str, str], ...]) -> Iterator[Motion]:
        """What must be slow: of the base, and of `joints`, each with the unit of its velocity."""
        yield Motion("the base moved", trace.speed, self.speed, "m/s")
        yield Motion("the base turned", trace.turn_rate, self.turn_rate, "rad/s")
        for name, unit in joints:
            speed = abs(trace.joint_velocity[:, trace.joint_names.index(name)])
            yield Motion(f"{name} moved", speed, self.speed if unit == "m/s" else self.turn_rate, unit)


class Motion(NamedTuple):
    """One speed over time, (T,) in `unit`, and the limit below which it is rest."""

    what: str
    speed: FloatArray
    limit: float
    unit: str

    @property
    def last(self) -> str:
        """What it is in the end, for messages."""
        speed, _ = units.display_apart(float(self.speed[-1]), self.limit, self.unit)
        return f"{self.what} with {speed}"


@dataclass(frozen=True, slots=True)
class SettledMonitor:
    """How long all motions were slow, and the one that is the least so at the end."""

    spec: Settled
    joints: tuple[tuple[str, str], ...]
    rest: Stretch
    end: float | None = None
    last: str = ""

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self.rest.state

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if not len(trace) or self.state is State.HOLDS:
            return self
        motions = list(self.spec.motions(trace, self.joints))
        slow = np.all([motion.speed <= motion.limit for motion in motions], axis=0)
        fastest = max(motions, key=lambda motion: float(motion.speed[-1]) / motion.limit)
        return replace(
            self,
            rest=self.rest.observe(trace.time, slow),
            end=float(trace.time[-1]),
            last="it still was" if slow[-1] else fastest.last,
        )

    def verdict(self) -> Verdict:
        """Measured is the longest rest, up to the one that was long enough."""
        passed, rest = self.state is State.HOLDS, self.rest
        if self.end is None:
            return Verdict(False, None, rest.wanted, None, "s", None, "no moment to measure")
        longest, wanted = units.display_apart(rest.longest, rest.wanted, "s")
        message = (
            f"at rest from {rest.began:.2f} s on, for {longest}"
            if passed
            else f"at rest for {longest} of {wanted}{self._when()}; at {self.end:.2f} s {self.last}"
        )
        return Verdict(passed, rest.longest, rest.wanted, rest.longest - rest.wanted, "s", rest.goal.time, message)

    def _when(self) -> str:
        return f", from {self.rest.began:.2f} s on" if self.rest.longest else ""

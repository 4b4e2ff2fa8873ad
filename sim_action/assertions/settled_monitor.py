"""Speeds folded into a rest: what the monitor of `settled` does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from sim_action import units
from sim_action.assertions import State
from sim_action.assertions.stretch import Stretch
from sim_action.verdict import Verdict

if TYPE_CHECKING:
    from sim_action.assertions.settled import Settled
    from sim_action.trace import FloatArray, Trace


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
    """How long all motions were slow, and the one that is the least so at the end.

    Attributes:
        joints: those that count, each with the unit of its velocity.
    """

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
        motions = list(self._motions(trace))
        slow = np.all([motion.speed <= motion.limit for motion in motions], axis=0)
        fastest = max(motions, key=lambda motion: float(motion.speed[-1]) / motion.limit)
        return replace(
            self,
            rest=self.rest.observe(trace.time, slow),
            end=float(trace.time[-1]),
            last="it still was" if slow[-1] else fastest.last,
        )

    def _motions(self, trace: Trace) -> Iterator[Motion]:
        """What must be slow: of the base, and of the joints."""
        spec = self.spec
        yield Motion("the base moved", trace.speed, spec.speed, "m/s")
        yield Motion("the base turned", trace.turn_rate, spec.turn_rate, "rad/s")
        for name, unit in self.joints:
            speed = abs(trace.joint_velocity[:, trace.joint_names.index(name)])
            yield Motion(f"{name} moved", speed, spec.speed if unit == "m/s" else spec.turn_rate, unit)

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

"""Speeds folded into a rest: what the monitor of `settled` does."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sim_action.assertions import State
from sim_action.assertions.stretch import Stretch
from sim_action.core import units
from sim_action.state.verdict import Signal, Verdict

if TYPE_CHECKING:
    from sim_action.assertions.settled import Settled
    from sim_action.state.trace import FloatArray, Trace


class Motion(NamedTuple):
    """One speed over time, (T,) in `unit`, and the limit below which it is rest."""

    name: str
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

    is_momentary: ClassVar[bool] = False

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
        slow = _are_slow(motions)
        fastest = max(motions, key=lambda motion: float(motion.speed[-1]) / motion.limit)
        return replace(
            self,
            rest=self.rest.observe(trace.time, slow),
            end=float(trace.time[-1]),
            last="it still was" if slow[-1] else fastest.last,
        )

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Drawn.signals: how long it has rested, and what has to be slow for that."""
        motions = list(self._motions(trace))
        rest = self.rest.lasting(trace.time, _are_slow(motions))
        return (
            Signal("time at rest", "s", trace.time, rest, lower=self.rest.wanted),
            *(Signal(motion.name, motion.unit, trace.time, motion.speed, upper=motion.limit) for motion in motions),
        )

    def _motions(self, trace: Trace) -> Iterator[Motion]:
        """What must be slow: of the base, and of the joints."""
        spec = self.spec
        yield Motion("speed", "the base moved", trace.speed, spec.speed, "m/s")
        yield Motion("turn rate", "the base turned", trace.turn_rate, spec.turn_rate, "rad/s")
        for name, unit in self.joints:
            speed = abs(trace.joint_velocity[:, trace.joint_names.index(name)])
            limit = spec.speed if unit == "m/s" else spec.turn_rate
            yield Motion(f"{name} speed", f"{name} moved", speed, limit, unit)

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


def _are_slow(motions: Sequence[Motion]) -> NDArray[np.bool_]:
    """(T,) whether all are."""
    return np.asarray(np.all([motion.speed <= motion.limit for motion in motions], axis=0))

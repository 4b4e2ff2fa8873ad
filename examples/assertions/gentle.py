"""How fast a robot may change its speed."""

from __future__ import annotations

import numpy as np

from sim_action import Trace, Verdict

# Single steps of an engine say more of its contacts than of the ride.
PERIOD = 0.2


class Gentle:
    """The mean acceleration over PERIOD, in m/s^2, stays within a limit."""

    kind = "invariant"

    def __init__(self, limit: float) -> None:
        self.limit = limit

    def judge(self, trace: Trace) -> Verdict:
        """Judges all that was seen so far."""
        later = np.interp(trace.time + PERIOD, trace.time, trace.speed)
        acceleration = np.abs(later - trace.speed) / PERIOD
        worst = acceleration.argmax()
        most, when = acceleration[worst], trace.time[worst]
        message = f"sped up or slowed down by {most:.2f} m/s^2"
        return Verdict(most <= self.limit, most, self.limit, self.limit - most, "m/s^2", when, message)

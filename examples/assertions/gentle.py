"""A limit on how fast a robot changes its speed."""

from __future__ import annotations

import numpy as np

from sim_action import Trace, Verdict

# Accelerations of single physics steps are dominated by contacts.
PERIOD = 0.2


class Gentle:
    """The mean acceleration over PERIOD, in m/s^2, stays within a limit."""

    kind = "invariant"

    def __init__(self, limit: float) -> None:
        self.limit = limit

    def judge(self, trace: Trace) -> Verdict:
        """Return the verdict on the run so far."""
        later = np.interp(trace.time + PERIOD, trace.time, trace.speed)
        acceleration = np.abs(later - trace.speed) / PERIOD
        worst = acceleration.argmax()
        most, when = acceleration[worst], trace.time[worst]
        message = f"sped up or slowed down by {most:.2f} m/s^2"
        return Verdict(most <= self.limit, most, self.limit, self.limit - most, "m/s^2", when, message)

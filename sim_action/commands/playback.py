"""The live half of a replay: which commands of a log are given at a tick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from sim_action.commands.logs import Moment
from sim_action.core.geometry import Twist
from sim_action.state.command import Command, JointTargets

_ROUNDING: Final = 1e-9
"""In s: a command at a tick counts there, whatever the rounding of either."""


class Playback:
    """One replay; it is asked at times that rise.

    Args:
        moments: the log; a command holds until the next one.
        start: of the log's own time in s; what it says then is said at t = 0.
        timeout: after how many s a twist holds no longer; None: it does.
    """

    def __init__(self, moments: Sequence[Moment], start: float, timeout: float | None) -> None:
        self._moments = moments
        self._start = start
        self._timeout = float("inf") if timeout is None else timeout
        self._next = 0

    def command(self, time: float) -> Command | None:
        """What is new at a tick, at a sim time in s; None: nothing."""
        now = self._start + time
        new: Command | None = None
        while self._next < len(self._moments) and self._moments[self._next][0] <= now + _ROUNDING:
            new = _after(new, self._moments[self._next][1])
            self._next += 1
        last, command = self._moments[max(0, self._next - 1)]
        if isinstance(command, Twist) and now - last > self._timeout + _ROUNDING:
            return Twist()
        return new


def _after(earlier: Command | None, later: Command) -> Command:
    """Both, one after the other: joints that the later one does not name keep what the earlier one told them."""
    if isinstance(earlier, JointTargets) and isinstance(later, JointTargets):
        return earlier.updated_by(later)
    return later

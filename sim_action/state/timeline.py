"""The timeline of a run: marks of actions on the robot and of changes around it, such as pushes and faults.

Each part that acts at a time yields its own marks: bodies, patches, disturbances, faults, command sources, and the
transmission of commands and readings. Reports show all of them; the message of a failure names the nearest ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

from sim_action.core.records import dataclass
from sim_action.core.units import TIME_EPSILON_S, display
from sim_action.core.wording import counted
from sim_action.core.yaml_document import KeyPath, SpecProblems

MAX_TIME_MARKS: Final = 200  # the number of marks that the results of a run keep, the first ones
NOT_YET: Final = math.inf  # the time of a part that waits for an event that has not happened
_MAX_NAMED: Final = 3  # the number of marks that a message names


def waits(time: float | None) -> bool:
    """Return True for the time of a part that waits for an event."""
    return time == NOT_YET


def is_late(time: float | None, end: float) -> bool:
    """Return True for a time that is stated, but not earlier than an end in s."""
    return time is not None and end <= time and not waits(time)


def late_problems(path: KeyPath, time: float | None, limit: float) -> SpecProblems:
    """Yield a time of a scenario that is not earlier than its time limit in s."""
    if is_late(time, limit):
        yield path, f"{time:g} s is not earlier than time_limit ({limit:g} s)"


@dataclass(frozen=True, slots=True)
class TimeMark:
    """Something that happened at a time of a run.

    Attributes:
        time: the sim time in s at which it happened or began.
        until: the sim time in s of its end, equal to `time` for an instant; None: it lasts until the end of the run.
        words: a clause in words without a time, such as "pushed with 8 N" or "body 'crate' appeared".
        is_planned: True for a command that the scenario states: it explains a failure only if nothing is nearer.
    """

    time: float
    until: float | None
    words: str
    is_planned: bool = False

    @property
    def title(self) -> str:
        """The mark with its times, such as "pushed with 8 N at 1.00 s for 0.2 s"."""
        if self.until is None:
            return f"{self.words} from {self.time:.2f} s on"
        lasts = self.until - self.time
        span = f" for {display(lasts, 's')}" if lasts > TIME_EPSILON_S else ""
        return f"{self.words} at {self.time:.2f} s{span}"


def waypoint_mark(time: float, passed: int, total: int, link: str = "") -> TimeMark:
    """Return the mark of a waypoint, counted from 1, that the robot or one of its links passed at a sim time in s."""
    what = (
        f"ended a path of {counted(total, 'waypoint')}" if passed == total else f"passed waypoint {passed} of {total}"
    )
    return TimeMark(time, time, f"link '{link}' {what}" if link else what, is_planned=True)


def in_order(marks: Iterable[TimeMark], end: float) -> tuple[TimeMark, ...]:
    """Return the marks of a run that ended at a time in s, in order, as many as fit, without a command at 0 s."""
    begun = (mark for mark in marks if mark.time <= end + TIME_EPSILON_S and (mark.time or not mark.is_planned))
    return tuple(sorted(begun, key=lambda mark: mark.time)[:MAX_TIME_MARKS])


def nearest_causes(marks: Iterable[TimeMark], time: float) -> tuple[TimeMark, ...]:
    """Return the marks that may explain a failure at a sim time in s, the nearest one first.

    These are the last mark before it, the last one that is no command, and others that still act. Conditions that hold
    from the start count only if nothing else happened.
    """
    before = [mark for mark in marks if mark.time <= time + TIME_EPSILON_S]
    before.sort(key=lambda mark: -mark.time)
    later = [mark for mark in before if mark.time] or before
    unplanned = [mark for mark in later if not mark.is_planned]
    acting = [mark for mark in unplanned if mark.until is None or mark.until >= time]
    named = dict.fromkeys((*later[:1], *unplanned[:1], *acting))
    return tuple(sorted(named, key=lambda mark: -mark.time)[:_MAX_NAMED])

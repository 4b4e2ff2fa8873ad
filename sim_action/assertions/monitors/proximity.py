"""Least distances to bodies, and the steps with a contact, read from traces."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, Final, Self

from typing_extensions import override

from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.monitors.contact_force import times_of
from sim_action.assertions.temporal_logic.formula import quoted
from sim_action.core import units
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.observation import Contact
from sim_action.state.trace import Trace
from sim_action.state.trace_channels import ClearanceWatch
from sim_action.state.trace_records import ClearanceRecord, Nearness
from sim_action.state.verdict import Signal, Verdict


def nearest_of(trace: Trace, watch: ClearanceWatch | None, before: Nearness | None) -> Nearness | None:
    """Return the least distance in a trace and `before`; the first of equal ones, None if nothing is known."""
    record = None if watch is None else trace.clearances.get(watch)
    if record is None or not len(record):
        return before
    nearest = record.at(int(record.distance.argmin()))
    return nearest if before is None or nearest.distance < before.distance else before


def recorded(trace: Trace, *watches: ClearanceWatch) -> ClearanceRecord:
    """Return all moments that several watches of the same bodies recorded."""
    records = [trace.clearances[watch] for watch in watches if watch in trace.clearances]
    if len(records) < 2:
        return records[0] if records else ClearanceRecord.of(())
    joined = ClearanceRecord.concatenate(records)
    return joined.rows(np.unique(joined.time, return_index=True)[1])


def distances_known(trace: Trace, record: ClearanceRecord, known: bool) -> FloatArray:
    """Return the times in s of the steps at which a body is there, from the first distance on if none is `known`."""
    if known:
        return record.there(trace.time)
    return record.there(trace.time[trace.time >= record.time[0] - TIME_EPSILON_S] if len(record) else trace.time[:0])


def distances(trace: Trace, *watches: ClearanceWatch) -> tuple[FloatArray, FloatArray]:
    """Return (N,) s and (N,) m: all distances that several watches of the same bodies recorded."""
    record = recorded(trace, *watches)
    return record.time, record.distance


def least_so_far(trace: Trace, *watches: ClearanceWatch) -> tuple[FloatArray, FloatArray]:
    """Return (N,) s and (N,) m: the running minimum at each step that lowers it, and at the last step."""
    time, distance = distances(trace, *watches)
    if not len(time):
        return time, distance
    least = np.minimum.accumulate(distance)
    last = float(trace.time[-1])
    return (np.append(time, last), np.append(least, least[-1])) if last > time[-1] else (time, least)


NO_FORCE: Final = "with no computed force (neither gives way)"
"""The part of a message about a contact without a force, see `Contact.has_force`."""


def clearance_signal(body: str) -> str:
    """Return the distance of the robot from a body as a formula writes it: 0 or less where they touch."""
    return f"clearance({quoted(body)})"


def strength(contact: Contact) -> str:
    """Return the force of a contact as in messages, such as "with 5 N in that physics step"."""
    return f"with {units.display(contact.force, 'N')} in that physics step" if contact.has_force else NO_FORCE


def touching_at(trace: Trace, time: FloatArray, step: float) -> Truth:
    """Return True at each step of `step` s with a contact at (N,) s; the first moment is the first step."""
    steps = trace.time[trace.time > step / 2]
    # Two computations of the time of a step differ by rounding.
    at = np.searchsorted(time, steps - step / 2)
    return Truth(steps, np.append(time, np.inf)[at] <= steps + step / 2)


@dataclass(frozen=True, slots=True)
class FirstTouchMonitor(Monitor):
    """The base class of monitors of the first forbidden contact, with the force of all its points."""

    is_momentary = True

    step: float  # s of sim time
    first: Any = None  # the Contact or SelfContact
    end: float | None = None

    @abstractmethod
    def forbidden(self, trace: Trace) -> Sequence[Any]:
        """Return the contacts that are not allowed."""

    @abstractmethod
    def summed(self, touches: Sequence[Any]) -> Any:
        """Return the first contact, with the force of all points of its pair at that moment."""

    @property
    @override
    def state(self) -> State:
        return State.HOLDS if self.first is None else State.BROKEN

    @override
    def observe(self, trace: Trace) -> Self:
        if self.first is not None:
            return self
        # A stored trace is decimated: it may have contacts between its steps, or no step at all.
        end = float(trace.time[-1]) if len(trace) else self.end
        touches = self.forbidden(trace)
        return replace(self, first=self.summed(touches) if touches else None, end=end)

    @override
    def truth(self, trace: Trace) -> Truth:
        touches = touching_at(trace, times_of(self.forbidden(trace)), self.step)
        return Truth(touches.time, np.logical_not(touches.holds))

    def touching(self, name: str, trace: Trace, forbidden: Sequence[Any]) -> Signal:
        """Return contact (0 or 1) at each step of a trace."""
        times = times_of(forbidden)
        return Signal(name, "contacts", *with_zeros(trace.time, times, np.ones(len(times)), self.step), upper=0.0)

    def touched(self, who: str, whom: str, how: str, body: str = "") -> Verdict:
        """Return the verdict on the first contact."""
        x, y, z = self.first.position_xyz
        message = f"{who} touched {whom} at {self.first.time:.2f} s, at ({x:.2f}, {y:.2f}, {z:.2f}) m, {how}"
        return Verdict(False, 1.0, 0.0, -1.0, "contacts", self.first.time, message, body=body)


def with_zeros(moments: FloatArray, time: FloatArray, values: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Return a curve that is zero at all `moments` without a value, and one step around each run of values."""
    if not len(time):
        return moments, np.zeros(len(moments))
    beside = np.concatenate((moments, time - step, time + step))
    inside = beside[(beside >= moments[0]) & (beside <= moments[-1])]
    # Two computations of the time of a step differ by rounding.
    at = np.searchsorted(time, inside - step / 2)
    known = np.append(time, np.inf)[at] <= inside + step / 2
    zeros = np.unique(np.round(inside[~known] / step)) * step
    grid = np.concatenate((time, zeros))
    order = np.argsort(grid)
    return grid[order], np.concatenate((values, np.zeros(len(zeros))))[order]

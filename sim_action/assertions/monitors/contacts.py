"""Contacts and least distances, read from traces: mean forces, the first forbidden touch.

The force of a single physics step depends on the rate: an impact may last one step, however long the step is. The
impulse of the impact, and so the mean force over a fixed time, does not.
"""

from __future__ import annotations

import itertools
import math
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple, Self

from typing_extensions import override

from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.assertions.temporal_logic import quoted
from sim_action.core import units
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, replace
from sim_action.core.units import STEP_EPSILON, TIME_EPSILON_S
from sim_action.state.observation import Contact, SelfContact
from sim_action.state.trace import Trace
from sim_action.state.trace_records import ClearanceRecord, ClearanceWatch, Nearness
from sim_action.state.verdict import Signal, Verdict

_DIGITS: Final = 9  # in N: sums of forces differ by rounding


class Forces(NamedTuple):
    """Mean forces, (N,) N, at (N,) s of sim time, rising."""

    time: FloatArray
    mean: FloatArray


def times_of(contacts: Iterable[Contact | SelfContact]) -> FloatArray:
    """Return (N,) s, rising: the steps that have one of these contacts."""
    return np.array(list(dict.fromkeys(contact.time for contact in contacts)))


def duration_text(seconds: float) -> str:
    """Return a duration as text; below one second it is in ms, such as "50 ms"."""
    return f"{seconds * 1000:.4g} ms" if seconds < 1 else f"{seconds:.4g} s"


@dataclass(frozen=True, slots=True)
class MeanForce:
    """The mean of the contact force over the last `window` s, across blocks of steps."""

    rate: float  # physics steps per second
    window: float  # the time in s, at least one step
    # the index of each step with a contact, and its force in N, as far back as the window reaches
    recent: tuple[tuple[int, float], ...] = ()

    @classmethod
    def of(cls, rate: float, window: float, start: Iterable[Contact]) -> Self:
        """Return the mean before the first step. The contacts at t = 0 have lasted for longer than the window."""
        opened = cls(rate, max(window, 1 / rate))
        force = sum(contact.force for contact in start)
        return (
            replace(opened, recent=tuple((-step, force) for step in range(opened._reach, -1, -1))) if force else opened
        )

    @property
    def _steps(self) -> float:
        steps = self.window * self.rate
        return float(round(steps)) if abs(steps - round(steps)) < STEP_EPSILON else steps

    @property
    def _reach(self) -> int:
        return math.ceil(self._steps)

    def observe(self, trace: Trace, contacts: Iterable[Contact]) -> tuple[Self, Forces]:
        """Return the mean after the steps of `trace`, and the mean force at these steps.

        `contacts` are the relevant ones of the trace. A stored trace has fewer steps than contacts: there are also
        moments between its steps, as long as a contact is in the window.
        """
        rows = np.rint(trace.time * self.rate).astype(np.int64)
        force_by_step = dict(self.recent)
        seen = self._by_step(contacts)
        force_by_step.update(seen)
        if not force_by_step or not (len(rows) or seen):
            return self, Forces(rows / self.rate, np.zeros(len(rows)))
        ends = [*rows[[0, -1] if len(rows) else []].tolist(), *seen]
        first, last = min(ends), max(ends)
        steps, mean = _with_rows(rows, *self._near_contacts(force_by_step, first, last))
        oldest = last - self._reach
        later = replace(self, recent=tuple((step, force) for step, force in force_by_step.items() if step > oldest))
        return later, Forces(steps / self.rate, mean)

    def is_filling(self, time: FloatArray, contacts: Iterable[Contact]) -> NDArray[np.bool_]:
        """Return True at (N,) s of the first window while there was a contact at each step: it may be older."""
        if any(step <= 0 for step, _ in self.recent) or not len(time) or time[0] > self.window:
            return np.zeros(len(time), dtype=bool)
        touched = {*dict(self.recent), *self._by_step(contacts)}
        lasting = next(step for step in itertools.count(1) if step not in touched)
        return np.asarray(time * self.rate < min(lasting, self._steps) - STEP_EPSILON)

    def _by_step(self, contacts: Iterable[Contact]) -> dict[int, float]:
        """Return the sum of the forces in N at each step with a contact."""
        sums: dict[int, float] = {}
        for contact in contacts:
            step = round(contact.time * self.rate)
            sums[step] = sums.get(step, 0.0) + contact.force
        return sums

    def _near_contacts(
        self, force_by_step: dict[int, float], first: int, last: int
    ) -> tuple[NDArray[np.int64], FloatArray]:
        """Return all steps from `first` to `last` that have a contact in their window, and their mean forces."""
        at, forces = (np.array(column) for column in zip(*sorted(force_by_step.items()), strict=True))
        # Between two runs of steps, there is no contact in the window.
        cuts = np.flatnonzero(np.diff(at) > self._reach) + 1
        steps, means = [np.empty(0, dtype=np.int64)], [np.empty(0)]
        for run, values in zip(np.split(at, cuts), np.split(forces, cuts), strict=True):
            begin, end = max(int(run[0]), first), min(int(run[-1]) + self._reach, last)
            if begin <= end:
                oldest = begin - self._reach
                inside = (run >= oldest) & (run <= end)
                force = np.zeros(end - oldest + 1)
                force[run[inside] - oldest] = values[inside]
                steps.append(np.arange(begin, end + 1))
                means.append(self._means(force))
        return np.concatenate(steps), np.concatenate(means)

    def _means(self, force: FloatArray) -> FloatArray:
        """Return the mean force at each step but the first ones, which are only in the windows of the others."""
        steps, reach = self._steps, self._reach
        whole, part = int(steps), steps - int(steps)
        sums = _sliding_sums(force, whole)[reach - whole + 1 :]
        # A window that is no whole number of steps has a part of the oldest one.
        oldest = force[reach - whole :][: len(sums)] * part
        return np.asarray(np.round((sums + oldest) / steps, _DIGITS))


def _with_rows(
    rows: NDArray[np.int64], steps: NDArray[np.int64], mean: FloatArray
) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the steps and their mean forces, completed by the other steps of `rows`, which have no force."""
    at = np.searchsorted(steps, rows)
    others = rows[np.append(steps, -1)[at] != rows]
    if not len(others):
        return steps, mean
    everything = np.concatenate((steps, others))
    order = np.argsort(everything, kind="stable")
    return everything[order], np.concatenate((mean, np.zeros(len(others))))[order]


def _sliding_sums(values: FloatArray, count: int) -> FloatArray:
    """Return (N - count + 1,) sums of `count` successive values, each in the same order in any block."""
    total: FloatArray | None = None
    offset, size, sums = 0, 1, values
    length = len(values) - count + 1
    while size <= count:
        if count & size:
            part = sums[offset : offset + length]
            total = part if total is None else total + part
            offset += size
        sums = sums[:-size] + sums[size:]
        size *= 2
    assert total is not None, "there is at least one step in a window"
    return total


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


def distances_known(trace: Trace, record: ClearanceRecord, is_known: bool) -> FloatArray:
    """Return the times in s of the steps at which a body is there, from the first distance on unless `is_known`."""
    if is_known:
        return record.valid(trace.time)
    return record.valid(trace.time[trace.time >= record.time[0] - TIME_EPSILON_S] if len(record) else trace.time[:0])


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
    covered = np.append(time, np.inf)[at] <= inside + step / 2
    zeros = np.unique(np.round(inside[~covered] / step)) * step
    grid = np.concatenate((time, zeros))
    order = np.argsort(grid)
    return grid[order], np.concatenate((values, np.zeros(len(zeros))))[order]

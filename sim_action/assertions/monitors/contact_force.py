"""The contact force, averaged over a sliding time window.

The force of a single physics step depends on the rate: an impact may last one step, whatever its duration. The impulse
of the impact, and so the mean force over a fixed time, does not.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from typing import Final, NamedTuple, Self

from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, replace
from sim_action.core.units import STEP_EPSILON
from sim_action.state.observation import Contact, SelfContact
from sim_action.state.trace import Trace

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
        known = dict(self.recent)
        seen = self._by_step(contacts)
        known.update(seen)
        if not known or not (len(rows) or seen):
            return self, Forces(rows / self.rate, np.zeros(len(rows)))
        ends = [*rows[[0, -1] if len(rows) else []].tolist(), *seen]
        first, last = min(ends), max(ends)
        steps, mean = _with_rows(rows, *self._near_contacts(known, first, last))
        oldest = last - self._reach
        later = replace(self, recent=tuple((step, force) for step, force in known.items() if step > oldest))
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

    def _near_contacts(self, known: dict[int, float], first: int, last: int) -> tuple[NDArray[np.int64], FloatArray]:
        """Return all steps from `first` to `last` that have a contact in their window, and their mean forces."""
        at, forces = (np.array(column) for column in zip(*sorted(known.items()), strict=True))
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
    """Return the steps and their mean forces with those of `rows` that are not among them: they have no force."""
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

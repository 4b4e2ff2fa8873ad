"""The fold of a run against a golden trajectory."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Final, Self

import numpy as np

from sim_action.assertions import State
from sim_action.core import units
from sim_action.state.golden_trajectory import Golden, interpolated, rows_of, wrapped
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Signal, Verdict

if TYPE_CHECKING:
    from sim_action.state.trace import FloatArray

# Of what left the golden trajectory, in a message.
_MOST_TOLD: Final = 3
# In s: golden times are written in milliseconds.
_SAME_MOMENT: Final = 1e-3


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far something may be off.

    Attributes:
        what: "position", "heading", or the name of a joint.
        columns: of a golden trajectory, between which the distance is taken.
        turns: whether a whole turn is no difference.
    """

    what: str
    unit: str
    limit: float
    columns: tuple[int, ...]
    turns: bool = False

    def errors(self, rows: FloatArray, golden: FloatArray) -> FloatArray:
        """(N,) distances between rows of the same times, in `unit`."""
        difference = rows[:, self.columns] - golden[:, self.columns]
        difference = wrapped(difference) if self.turns else difference
        return np.asarray(np.sqrt(np.square(difference).sum(axis=1)), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Deviation:
    """How far something was off.

    Attributes:
        largest, time: the largest error, and the sim time in s at which it was.
        left: the sim time in s at which it was first more than is allowed.
    """

    tolerance: Tolerance
    largest: float = -1.0
    time: float = 0.0
    left: float | None = None

    def observe(self, time: FloatArray, errors: FloatArray) -> Self:
        """The fold after these moments."""
        later = self
        index = int(errors.argmax())
        if not errors[index] <= self.largest:  # what is not a number is off
            later = replace(later, largest=float(errors[index]), time=float(time[index]))
        over = ~(errors <= self.tolerance.limit)
        if self.left is None and over.any():
            later = replace(later, left=float(time[int(over.argmax())]))
        return later

    @property
    def margin(self) -> float:
        """Of the largest error, in its unit."""
        return self.tolerance.limit - self.largest

    @property
    def text(self) -> str:
        """Such as "5 cm off at 3.40 s, limit 2 cm", with what it is of."""
        tolerance = self.tolerance
        error, allowed = units.display_apart(self.largest, tolerance.limit, tolerance.unit)
        what = "" if tolerance.what == "position" else f" in {tolerance.what}"
        return f"at most {error} off{what}, at {self.time:.2f} s, limit {allowed}"


@dataclass(frozen=True, eq=False)
class MatchesMonitor:
    """Holds each moment of a golden trajectory against the run, which it takes to be straight between two steps.

    Attributes:
        name: of the golden file.
        duration: how much earlier or later the run may be over, in s.
        before: (1, 5 + J) the last moment seen.
        next: the first row of the golden trajectory that has not been compared.
    """

    is_momentary: ClassVar[bool] = False

    name: str
    golden: Golden
    duration: float
    before: FloatArray
    deviations: tuple[Deviation, ...]
    next: int = 0

    @classmethod
    def at_start(
        cls, name: str, golden: Golden, asked: tuple[Tolerance, ...], duration: float, start: Observation
    ) -> Self:
        """Before the first step."""
        before = rows_of(Trace.of_observation(start), golden.form.joint_names)
        return cls(name, golden, duration, before, tuple(map(Deviation, asked)))

    @property
    def state(self) -> State:
        """See Monitor.state: it ends no run, as the largest error may still come."""
        return State.HOLDS

    def begin(self, trace: Trace) -> Self:
        """See Follower.begin."""
        return replace(self, before=self._rows(trace)[-1:]) if len(trace) else self

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if not len(trace):
            return self
        return self._compared(np.concatenate((self.before, self._rows(trace))))

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Drawn.signals: how far off everything was, at the golden moments that the trace has."""
        rows = np.concatenate((self.before, self._rows(trace)))
        due = self.golden.rows
        due = due[(due[:, 0] >= rows[0, 0]) & (due[:, 0] <= rows[-1, 0])]
        after = np.clip(np.searchsorted(rows[:, 0], due[:, 0]), 1, len(rows) - 1)
        away = np.minimum(np.abs(rows[after, 0] - due[:, 0]), np.abs(rows[after - 1, 0] - due[:, 0]))
        due = due[away <= _SAME_MOMENT]
        if not len(due):
            return ()
        ours = interpolated(rows, due[:, 0])
        return tuple(
            Signal(f"{one.what} off the golden run", one.unit, due[:, 0], one.errors(ours, due), None, one.limit)
            for one in (deviation.tolerance for deviation in self.deviations)
        )

    def verdict(self) -> Verdict:
        """Of what left the golden trajectory, the first speaks; else of what came nearest to its limit."""
        seen = [one for one in self.deviations if one.largest >= 0 or one.left is not None]
        if not seen:
            return Verdict(False, None, None, None, "", None, f"no moment to compare with {self.name}")
        left = sorted((one for one in seen if one.left is not None), key=lambda one: one.left or 0.0)
        lasting = self._lasting
        if not left and lasting is not None:
            return lasting
        told = left[0] if left else min(seen, key=lambda one: one.margin / one.tolerance.limit)
        parts = [self._of_left(left)] if left else []
        parts += [one.text for one in left[:_MOST_TOLD] or (told,)]
        message = "; ".join(parts if lasting is None else [*parts, lasting.message])
        limit, unit = told.tolerance.limit, told.tolerance.unit
        return Verdict(not left, told.largest, limit, told.margin, unit, told.time, message)

    def _of_left(self, left: list[Deviation]) -> str:
        when = ", ".join(f"in {one.tolerance.what} at {one.left:.2f} s" for one in left[:_MOST_TOLD])
        return f"left {self.name} {when}{', and in more' if len(left) > _MOST_TOLD else ''}"

    @property
    def _lasting(self) -> Verdict | None:
        """On a run that was over too early or too late; None if it was not."""
        end, golden_end = float(self.before[0, 0]), float(self.golden.time[-1])
        apart = abs(end - golden_end)
        # What is written in whole milliseconds matches itself.
        if apart <= self.duration + 1e-3:
            return None
        which, how = ("shorter", "over at") if end < golden_end else ("longer", "still on at")
        message = f"{apart:.2f} s {which} than {self.name}: {how} {end:.2f} s, and that ends at {golden_end:.2f} s"
        return Verdict(False, apart, self.duration, self.duration - apart, "s", end, message)

    def _rows(self, trace: Trace) -> FloatArray:
        return rows_of(trace, self.golden.form.joint_names)

    def _compared(self, rows: FloatArray) -> Self:
        """The fold after rows that begin with the last moment seen."""
        end = int(np.searchsorted(self.golden.time, rows[-1, 0], side="right"))
        later = replace(self, before=rows[-1:], next=max(self.next, end))
        due = self.golden.rows[self.next : end]
        due = due[due[:, 0] >= rows[0, 0]]
        if not len(due):
            return later
        ours = interpolated(rows, due[:, 0])
        deviations = tuple(one.observe(due[:, 0], one.tolerance.errors(ours, due)) for one in self.deviations)
        return replace(later, deviations=deviations)


@dataclass(frozen=True, slots=True)
class Renewal:
    """Takes the place of a comparison where the golden file is written anew: any run matches itself."""

    name: str
    seen: bool = False

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return State.HOLDS

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        return replace(self, seen=self.seen or len(trace) > 0)

    def verdict(self) -> Verdict:
        """See Monitor.verdict."""
        message = f"{self.name} is written from this run" if self.seen else "no moment to write"
        return Verdict(self.seen, None, None, None, "", None, message)

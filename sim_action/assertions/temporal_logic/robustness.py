"""The samples of signals, the robustness of a formula at each step, and the comparison that decides it.

A step is left out as long as a signal is unknown: before the first reading of a sensor, or before an object appears.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import reduce
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from sim_action.assertions.monitors import FORCE_WINDOW_S
from sim_action.assertions.monitors.base_motion import BaseMotion
from sim_action.assertions.monitors.contacts import MeanForce
from sim_action.assertions.sensor import picked
from sim_action.assertions.temporal_logic import formula as stl
from sim_action.assertions.temporal_logic.formula import Formula, Interval, Term, horizon, signed_parts
from sim_action.assertions.temporal_logic.formula_signals import watch_of
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, field, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.robot.model.kinematics import LinkMotion, link_motion
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.observation import Contact, Observation
from sim_action.state.trace import Trace, yaw_angles
from sim_action.state.trace_records import BodyRecord
from sim_action.world.scene import Scene

_UNREACHED: Final = 1e9  # the value of an infinite reading, such as the range of a ray that hits nothing


@dataclass(frozen=True, eq=False)
class Samples:
    """The values of signals at T steps, in SI units."""

    signals: tuple[stl.Signal, ...]  # the S signals, each once
    rows: FloatArray  # (T, 1 + S), time and the signals

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return consecutive samples of the same signals in one piece."""
        first, *others = parts
        return first if not others else replace(first, rows=np.concatenate([part.rows for part in parts]))

    @property
    def time(self) -> FloatArray:
        """Sim time, (T,) s, increasing."""
        return self.rows[:, 0]

    def of_signal(self, signal: stl.Signal) -> FloatArray:
        """Return (T,) the values of one signal."""
        return self.rows[:, 1 + self.signals.index(signal)]

    def between(self, first: int, last: int) -> Self:
        """Return the samples from index `first` up to, not including, `last`."""
        return replace(self, rows=self.rows[first:last])

    def at_or_after(self, time: float | FloatArray) -> NDArray[np.intp]:
        """Return the index of the first step at or after a time, or (N,) of them."""
        return np.asarray(np.searchsorted(self.time, np.asarray(time) - TIME_EPSILON_S), dtype=np.intp)

    def after(self, time: float | FloatArray) -> NDArray[np.intp]:
        """Return the index of the first step after a time, or (N,) of them."""
        return np.asarray(np.searchsorted(self.time, np.asarray(time) + TIME_EPSILON_S), dtype=np.intp)


@dataclass(frozen=True, slots=True)
class SignalReader:
    """Reads the signals of a formula."""

    signals: tuple[stl.Signal, ...]
    model: RobotModel
    start_xy: tuple[float, float]
    motion: BaseMotion
    forces: Mapping[stl.Signal, MeanForce] = field(default_factory=dict)
    readings: Mapping[stl.Signal, float] = field(default_factory=dict)

    @classmethod
    def of(cls, signals: tuple[stl.Signal, ...], scene: Scene, start: Observation) -> Self:
        """Return the reader before the first step; `start` is the state at t = 0."""
        x, y, _ = start.pose.position_xyz
        forces = {
            signal: MeanForce.of(scene.physics.rate, FORCE_WINDOW_S, _meant(signal, start.contacts))
            for signal in signals
            if signal.name == "force" and signal.source == "pair"
        }
        return cls(signals, scene.model, (x, y), BaseMotion.of(scene, start), forces)

    def begun(self, trace: Trace) -> Self:
        """Return the reader after steps that are not judged: forces are means, and readings last."""
        if not (bool(self.forces) or any(signal.source == "sensor" for signal in self.signals)):
            return self
        forces = {
            signal: mean.observe(trace, _meant(signal, trace.contacts))[0] for signal, mean in self.forces.items()
        }
        return replace(self, forces=forces, readings={**self.readings, **dict(self._last_readings(trace))})

    def after(self, trace: Trace) -> Self:
        """Return the reader after the steps of a trace."""
        return replace(self.begun(trace), motion=self.motion.after(trace))

    def read(self, trace: Trace) -> Samples:
        """Return the samples at the steps of a trace at which all signals are known."""
        rows = np.column_stack([trace.time, *(self._column(trace, signal) for signal in self.signals)])
        if all(signal.source == "robot" for signal in self.signals):
            return Samples(self.signals, rows)
        complete = ~np.isnan(rows).any(axis=1)
        return Samples(self.signals, np.clip(rows if complete.all() else rows[complete], -_UNREACHED, _UNREACHED))

    def _last_readings(self, trace: Trace) -> Iterator[tuple[stl.Signal, float]]:
        for signal in self.signals:
            record = trace.sensors.get(signal.names[0]) if signal.source == "sensor" else None
            if record is not None and len(record):
                yield signal, float(picked(record.columns[signal.name][-1:], _which(signal))[0])

    def _column(self, trace: Trace, signal: stl.Signal) -> FloatArray:
        match signal.source:
            case "frame":
                return self._frame_column(trace, signal)
            case "sensor":
                return self._sensor_column(trace, signal)
            case "pair":
                return self._pair_column(trace, signal)
            case _:
                return self._robot_column(trace, signal)

    def _robot_column(self, trace: Trace, signal: stl.Signal) -> FloatArray:
        if signal.joint:
            columns: FloatArray = getattr(trace, f"joint_{signal.name}")
            return columns[:, trace.joint_names.index(signal.joint)]
        match signal.name:
            case "x" | "y" | "z":
                return trace.base_position_xyz[:, "xyz".index(signal.name)]
            case "travel":
                return trace.planar_distance_to(*self.start_xy)
            case "speed" | "turn_rate":
                return self.motion.speed(trace) if signal.name == "speed" else self.motion.turn_rate(trace)
            case "time":
                return trace.time
            case _:
                return _angle(trace.base_orientation_xyzw, signal.name)

    def _frame_column(self, trace: Trace, signal: stl.Signal) -> FloatArray:
        frame = self._frame(trace, signal.names[0])
        match signal.name:
            case "x" | "y" | "z":
                return frame.position_xyz[:, "xyz".index(signal.name)]
            case "speed" | "turn_rate":
                assert isinstance(frame, LinkMotion), "objects have no twists"
                return _norm(frame.linear_xyz if signal.name == "speed" else frame.angular_xyz)
            case _:
                return _angle(frame.orientation_xyzw, signal.name)

    def _frame(self, trace: Trace, name: str) -> LinkMotion | BodyRecord:
        return link_motion(self.model, trace, name) if name in self.model.links_by_name else trace.objects[name]

    def _pair_column(self, trace: Trace, signal: stl.Signal) -> FloatArray:
        if signal.name == "distance":
            first, second = (self._frame(trace, name).position_xyz for name in signal.names)
            return _norm(first - second)
        if signal.name == "force":
            _, (time, mean) = self.forces[signal].observe(trace, _meant(signal, trace.contacts))
            return _held(time, mean, trace.time + TIME_EPSILON_S, 0.0)
        record = trace.clearances.get(watch_of(signal))
        if record is None or not len(record):
            return np.full(len(trace), np.nan)
        at = np.searchsorted(record.time, trace.time - TIME_EPSILON_S).clip(max=len(record) - 1)
        is_there = np.abs(record.time[at] - trace.time) <= TIME_EPSILON_S
        return np.where(is_there, record.distance[at], np.nan)

    def _sensor_column(self, trace: Trace, signal: stl.Signal) -> FloatArray:
        """Return (T,) the last reading before each step; the reading at t = 0 also counts at t = 0."""
        before = self.readings.get(signal, np.nan)
        record = trace.sensors.get(signal.names[0])
        if record is None or not len(record):
            return np.full(len(trace), before)
        time = np.where(record.time > TIME_EPSILON_S, record.time, -np.inf)
        return _held(time, picked(record.columns[signal.name], _which(signal)), trace.time - TIME_EPSILON_S, before)


def _held(time: FloatArray, values: FloatArray, moments: FloatArray, before: float) -> FloatArray:
    at = np.searchsorted(time, moments, side="right")
    return np.concatenate(([before], values))[at]


def _meant(signal: stl.Signal, contacts: Iterable[Contact]) -> list[Contact]:
    *link, body = signal.names
    return [contact for contact in contacts if contact.body == body and (not link or contact.link == link[0])]


def _which(signal: stl.Signal) -> str | None:
    return signal.names[1] if len(signal.names) > 1 else None


def _angle(orientations: FloatArray, name: str) -> FloatArray:
    """Return (T,) rad: an angle of URDF's convention (roll about x, then pitch about y, then yaw about z), or tilt."""
    if name == "yaw":
        return yaw_angles(orientations)
    x, y, z, w = orientations.T
    match name:
        case "roll":
            angle = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        case "pitch":
            angle = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
        case _:
            angle = np.arccos(np.clip(1 - 2 * (x * x + y * y), -1.0, 1.0))
    return np.asarray(angle, dtype=np.float64)


def _norm(vectors: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)), dtype=np.float64)


def robustness(formula: Formula, samples: Samples, *, contrary: bool = False, strong: bool = False) -> FloatArray:  # noqa: PLR0911 - a line for each kind
    """Return (T,) margins: positive where the formula holds on the given samples, or its negation (`contrary`).

    An operator needs every step of its interval (`always`, and the negation of `eventually` and `until`), or one step
    (`eventually`, `until`, and the negation of `always`). An interval that reaches beyond the last step is cut there.
    If `strong`, an operator that needs every step of a finite interval must see it to its end, and gives -inf before.
    The inner formulas of an operator that needs one step are strong, so only a step with evidence is a witness. The
    inner formulas of an operator that needs every step up to the end of the run are not.
    """
    match formula:
        case stl.Comparison(left, relation, right):
            difference = values(left, samples) - values(right, samples)
            return -difference if (relation in ("<", "<=")) != contrary else difference
        case stl.Not():
            return robustness(formula.formula, samples, contrary=not contrary, strong=strong)
        case stl.And() | stl.Or() | stl.Implies():
            signed = signed_parts(formula, contrary)
            parts = (robustness(part, samples, contrary=flip, strong=strong) for part, flip in signed)
            return reduce(np.minimum if isinstance(formula, stl.And) != contrary else np.maximum, parts)
        case stl.Always() | stl.Eventually():
            first, last = windows = _windows(formula.interval, samples)
            if isinstance(formula, stl.Eventually) != contrary:
                return greatest_of_windows(
                    robustness(formula.formula, samples, contrary=contrary, strong=True), *windows
                )
            inner = robustness(
                formula.formula, samples, contrary=contrary, strong=strong and formula.interval.is_finite
            )
            least = least_of_windows(inner, first, last)
            return np.where(_unseen(formula.interval, samples), -np.inf, _with_evidence(least)) if strong else least
        case stl.Until():
            before, then = until_operands(formula, samples, contrary=contrary, strong=strong)
            if not contrary:
                return _until(before, then, formula.interval, samples)
            held = -_until(-before, -then, formula.interval, samples)
            return _with_evidence(np.minimum(held, _escape(formula, samples, before))) if strong else held


def until_operands(
    formula: stl.Until, samples: Samples, *, contrary: bool = False, strong: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return (T,) margins of both formulas of an `until`, or of their negations (`contrary`)."""
    before = robustness(formula.before, samples, contrary=contrary, strong=True)
    strong = not contrary or (strong and formula.interval.is_finite)
    return before, robustness(formula.then, samples, contrary=contrary, strong=strong)


def _unseen(interval: Interval, samples: Samples) -> NDArray[np.bool_]:
    last = samples.time[-1] + TIME_EPSILON_S
    return np.asarray(interval.is_finite & (samples.time + interval.end > last), dtype=np.bool_)


def _with_evidence(margins: FloatArray) -> FloatArray:
    return np.where(margins == NOTHING_LEAST, -np.inf, margins)


def _escape(formula: stl.Until, samples: Samples, contrary_before: FloatArray) -> FloatArray:
    failed = np.maximum.accumulate(contrary_before[::-1])[::-1]
    return np.where(_unseen(formula.interval, samples), failed, np.inf)


def values(term: Term, samples: Samples) -> FloatArray:
    """Return (T,) the value of a term at each step, in SI units."""
    match term:
        case stl.Number():
            return np.full(len(samples), term.value)
        case stl.Signal():
            return samples.of_signal(term)
        case stl.Negative():
            return -values(term.term, samples)
        case stl.Absolute():
            return np.abs(values(term.term, samples))
        case stl.Sum():
            return reduce(np.add, (values(part, samples) for part in term.terms))
        case stl.Product():
            return reduce(np.multiply, (values(factor, samples) for factor in term.factors))


def _windows(interval: Interval, samples: Samples) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    first = samples.at_or_after(samples.time + interval.start)
    return first, np.maximum(first, samples.after(samples.time + interval.end))


def _until(before: FloatArray, then: FloatArray, interval: Interval, samples: Samples) -> FloatArray:
    """Return the bounded `until` from three cheap parts (Donze 2013).

    `p until[a, b] q` equals `eventually[a, b] q`, and p at every step before a, and `p until q` at a.
    """
    endless = until(before, then)
    first, last = _windows(interval, samples)
    steps = np.arange(len(samples), dtype=np.intp)
    met = greatest_of_windows(then, first, last)
    held = least_of_windows(before, steps, first)
    later = np.append(endless, -np.inf)[first]
    least: FloatArray = np.minimum(np.minimum(met, held), later)
    return least


@dataclass(frozen=True, slots=True)
class Cause:
    """The comparison and the step whose difference equals the robustness of a whole formula."""

    comparison: stl.Comparison
    time: float  # sim time in s
    left: float  # left, right: both sides in SI units
    right: float
    margin: float  # their difference, positive if the formula holds


def cause(
    formula: Formula, samples: Samples, index: int = 0, *, contrary: bool = False, strong: bool = False
) -> Cause | None:
    """Return the comparison that decides a formula; None if its window is empty or cut off; see `robustness`."""
    ahead = samples.between(index, seen_from(formula, samples, index))
    match formula:
        case stl.Comparison():
            return _compared(formula, ahead, contrary=contrary)
        case stl.Not():
            return cause(formula.formula, ahead, contrary=not contrary, strong=strong)
        case stl.And() | stl.Or() | stl.Implies():
            decisive = min if isinstance(formula, stl.And) != contrary else max
            part, flip = decisive(
                signed_parts(formula, contrary),
                key=lambda one: float(robustness(one[0], ahead, contrary=one[1], strong=strong)[0]),
            )
            return cause(part, ahead, contrary=flip, strong=strong)
        case stl.Always() | stl.Eventually():
            return _cause_in_window(formula, ahead, contrary=contrary, strong=strong)
        case stl.Until():
            return _cause_of_until(formula, ahead, contrary=contrary, strong=strong)


def seen_from(formula: Formula, samples: Samples, index: int) -> int:
    """Return the end index of the samples that a formula at a step depends on, with the step that ends its windows."""
    if math.isinf(reach := horizon(formula)):
        return len(samples)
    return min(len(samples), int(samples.at_or_after(float(samples.time[index]) + reach)) + 1)


def _compared(comparison: stl.Comparison, samples: Samples, *, contrary: bool) -> Cause:
    now = samples.between(0, 1)
    left, right = (float(values(term, now)[0]) for term in (comparison.left, comparison.right))
    margin = float(robustness(comparison, now, contrary=contrary)[0])
    return Cause(comparison, float(now.time[0]), left, right, margin)


def _cause_in_window(
    formula: stl.Always | stl.Eventually, samples: Samples, *, contrary: bool, strong: bool
) -> Cause | None:
    first, last = (int(ends[0]) for ends in _windows(formula.interval, samples))
    greatest = isinstance(formula, stl.Eventually) != contrary
    if first == last or (strong and not greatest and _unseen(formula.interval, samples)[0]):
        return None
    strong = greatest or (strong and formula.interval.is_finite)
    inside = robustness(formula.formula, samples, contrary=contrary, strong=strong)[first:last]
    index = int(inside.argmax() if greatest else inside.argmin())
    return cause(formula.formula, samples, first + index, contrary=contrary, strong=strong)


def _cause_of_until(formula: stl.Until, samples: Samples, *, contrary: bool, strong: bool) -> Cause | None:
    first, last = (int(ends[0]) for ends in _windows(formula.interval, samples))
    operands = until_operands(formula, samples, contrary=contrary, strong=strong)
    before, then = (-margins for margins in operands) if contrary else operands
    held = np.minimum.accumulate(np.concatenate(([np.inf], before[:-1])))
    ways = np.minimum(then, held)[first:last]
    if contrary and strong and _unseen(formula.interval, samples)[0] and before.min() > ways.max(initial=-np.inf):
        return cause(formula.before, samples, int(before.argmin()), contrary=True, strong=True)
    if first == last:
        return None
    index = first + int(ways.argmax())
    if then[index] <= held[index]:
        strong = not contrary or (strong and formula.interval.is_finite)
        return cause(formula.then, samples, index, contrary=contrary, strong=strong)
    return cause(formula.before, samples, int(before[:index].argmin()), contrary=contrary, strong=True)


NOTHING_LEAST: Final = math.inf  # the minimum of an empty window


def least_of_windows(values: FloatArray, first: NDArray[np.intp], last: NDArray[np.intp]) -> FloatArray:
    """Return (N,) the minimum of `values[first:last]` for N windows; +inf for an empty one. Runs in O(n log n).

    Two overlapping windows of a power of two cover each window. Their minima come from a sparse table by doubling, of
    which only one row is kept.
    """
    least = np.full(len(first), NOTHING_LEAST)
    length = last - first
    # The base-2 logarithm of the length, rounded down.
    level = np.frexp(length.astype(np.float64))[1] - 1
    row, width = values, 1
    for step in range(int(level.max(initial=-1)) + 1):
        at_level = (level == step) & (length > 0)
        least[at_level] = np.minimum(row[first[at_level]], row[last[at_level] - width])
        row, width = np.minimum(row[:-width], row[width:]), 2 * width
    return least


def greatest_of_windows(values: FloatArray, first: NDArray[np.intp], last: NDArray[np.intp]) -> FloatArray:
    """Return (N,) the maximum of `values[first:last]` for N windows; -inf for an empty one."""
    return -least_of_windows(-values, first, last)


def until(before: FloatArray, then: FloatArray) -> FloatArray:
    """Return (T,) z with z[i] = max(then[i], min(before[i], z[i + 1])), and z[T] = -inf. Runs in O(n log n).

    Each step clips the value of the next one to [then, max(before, then)]. Two such clips are one clip again, so the
    clips of 1, 2, 4, ... steps are made by doubling.
    """
    lower = then.copy()
    upper = np.maximum(before, then)
    width = 1
    while width < len(lower):
        near_low, near_high = lower[:-width], upper[:-width]
        lower[:-width], upper[:-width] = (
            np.clip(lower[width:], near_low, near_high),
            np.clip(upper[width:], near_low, near_high),
        )
        width *= 2
    return lower

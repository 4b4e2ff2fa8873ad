"""Charts of signals over time for GitHub, as Mermaid text (`xychart-beta`): a curve and its limits."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Final

import numpy as np

from sim_action.core import units
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.wording import shortened
from sim_action.recording.replay.replay_data import Replay, ReplayError, SignalData, read_replay
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import one_line
from sim_action.results.artifacts import stored_file
from sim_action.results.outcome import Outcome
from sim_action.state.verdict import Signal, Verdict

_MAX_POINTS: Final = 60
_MAX_IN_TEXT: Final = 80
# All characters except a few that cannot end a quoted text of Mermaid or act as markup in it.
_UNSAFE: Final = re.compile(r"[^\w .,:()/+*=^'°·²\[\]-]")
# The colours of the curve and the limits are readable on a white and on a black page.
_CURVE, _LIMIT = "#2f81f7", "#e5534b"
_PADDING: Final = 0.08
_NOTICEABLE: Final = 0.02  # as a fraction of the range of all values: a smaller peak is not visible
_SHORTEST, _LARGEST = 1e-6, 1e12  # the shortest duration in s, and the largest absolute value in any unit
_SLIVER: Final = 1e-4  # as a fraction of an axis: an invisible difference


def chart(signal: Signal, moment: float | None = None) -> str:
    """Return a fenced chart of a signal with its limits, exact at the sim time `moment` (s); empty without data."""
    finite = np.isfinite(signal.values)
    time, factor, unit = signal.time[finite], *_shown_in(signal.unit)
    start, end = map(float, time[[0, -1]]) if len(time) else (0.0, 0.0)
    if not end - start > _SHORTEST or max(np.abs(time).max(), np.abs(signal.values[finite]).max()) > _LARGEST:
        return ""
    values = sampled(time, factor * signal.values[finite], moment)
    limits = [factor * limit for limit in (signal.lower, signal.upper) if limit is not None]
    low, high = _range([*values, *limits])
    lines = (values, *([limit, limit] for limit in limits))
    # The directive with sizes and colours; the default colours of Mermaid are almost white.
    palette = ", ".join((_CURVE, *[_LIMIT] * len(limits)))
    settings = {
        "xyChart": {"width": 720, "height": 320, "yAxis": {"titlePadding": 14}},
        "themeVariables": {"xyChart": {"plotColorPalette": palette}},
    }
    return "\n".join(
        (
            "```mermaid",
            f"%%{{init: {json.dumps(settings)}}}%%",
            "xychart-beta",
            f"    title {_text(_title(signal))}",
            f'    x-axis "sim time in s" {_span(start, end - _SLIVER * (end - start))}',
            f"    y-axis {_text(f'in {unit}' if unit else signal.name)} {_span(low, high)}",
            *(f"    line [{', '.join(_number(value, high - low) for value in line)}]" for line in lines),
            "```",
        )
    )


def sampled(time: FloatArray, values: FloatArray, moment: float | None = None, most: int = _MAX_POINTS) -> list[float]:
    """Return `most` values at even intervals, exact at the ends and at `moment`, with the peaks of single steps."""
    at = np.interp(np.linspace(time[0], time[-1], most), time, values)
    samples = at.copy()
    least = _NOTICEABLE * float(np.ptp(values))
    parts = np.rint((time - time[0]) / (time[-1] - time[0]) * (most - 1)).astype(np.intp)
    for part, value in zip(parts.tolist(), values.tolist(), strict=True):
        if 0 < part < most - 1 and _beyond(value, at[part - 1], at[part + 1]) > max(
            least, _beyond(samples[part], at[part - 1], at[part + 1])
        ):
            samples[part] = value
    if moment is not None and time[0] <= moment <= time[-1]:
        samples[round((moment - time[0]) / (time[-1] - time[0]) * (most - 1))] = np.interp(moment, time, values)
    return [float(value) for value in samples]


def _beyond(value: float, one: float, other: float) -> float:
    return max(min(one, other) - value, value - max(one, other), 0.0)


def _shown_in(unit: str) -> tuple[float, str]:
    if unit in ("rad", "rad/s"):
        return 1 / float(units.conversion("deg", "rad") or 1.0), unit.replace("rad", "deg")
    return 1.0, unit


def _title(signal: Signal) -> str:
    named = ((signal.lower, "at least"), (signal.upper, "at most"))
    limits = [f"{word} {units.display(limit, signal.unit)}" for limit, word in named if limit is not None]
    lines = "level line: limit" if len(limits) == 1 else "level lines: limits"
    return f"{shortened(signal.name, 30)} ({lines}, {' and '.join(limits)})" if limits else signal.name


def _range(values: Sequence[float]) -> tuple[float, float]:
    """Return the range of the axis: all values with some padding, extended to 0 if 0 is near."""
    low, high = min(values), max(values)
    # For large numbers the padding must be representable; less than a billionth is not visible.
    room = max(_PADDING * ((high - low) or abs(high) or 1.0), 1e-9 * max(abs(low), abs(high)), 1e-9)
    if low >= 0 and low <= (high - low):
        return 0.0, high + room
    if high <= 0 and -high <= (high - low):
        return low - room, 0.0
    return low - room, high + room


def _text(text: str) -> str:
    return f'"{shortened(one_line(_UNSAFE.sub(" ", text)), _MAX_IN_TEXT)}"'


def _span(low: float, high: float) -> str:
    return f"{_number(low, _SLIVER * (high - low))} --> {_number(high, _SLIVER * (high - low))}"


def _number(value: float, span: float) -> str:
    digits = min(max(0, 4 - math.ceil(math.log10(span))), 12)
    text = f"{value + 0.0:.{digits}f}"
    return text.rstrip("0").rstrip(".") if digits else text


_SAME_LIMIT: Final = 1e-9  # the limit of a verdict may differ from the stored limit by rounding errors


def load_replay(outcome: Outcome, options: ReportOptions) -> Replay | None:
    """Read the replay of an outcome; None if there is none or it cannot be read."""
    path = None if outcome.replay is None else stored_file(options.folder, outcome.replay)
    if path is None:
        return None
    try:
        return read_replay(path)
    except ReplayError:
        return None


def signal_of_verdict(replay: Replay, expectation: int, verdict: Verdict) -> Signal | None:
    """Return the stored signal that best matches the verdict of an expectation, counted from 0; None without one."""
    stored = [signal for signal in replay.signals if signal.expectation == expectation]
    curves = [_decoded_signal(signal, replay) for signal in stored]
    return min(curves, key=lambda one: _mismatch(one, verdict), default=None)


def _decoded_signal(stored: SignalData, replay: Replay) -> Signal:
    frames = replay.frames
    column, count = (frames.time, frames.count) if stored.time is None else (stored.time, 1 + len(stored.time.deltas))
    return Signal(
        stored.name,
        stored.unit,
        column.decoded(count),
        stored.values.decoded(count),
        stored.lower,
        stored.upper,
        stored.start,
        np.inf if stored.end is None else stored.end,
    )


def _mismatch(signal: Signal, verdict: Verdict) -> tuple[bool, bool, float]:
    """Return a sort key for the difference between a signal and a verdict: unit, limit, value at the decisive time."""
    limits = [limit for limit in (signal.lower, signal.upper) if limit is not None]
    limit = verdict.limit
    is_other = limit is None or not any(abs(one - limit) <= _SAME_LIMIT * max(1.0, abs(limit)) for one in limits)
    finite = np.isfinite(signal.values)
    if verdict.measured is None or verdict.time is None or not finite.any():
        return signal.unit != verdict.unit, is_other, np.inf
    value = float(np.interp(verdict.time, signal.time[finite], signal.values[finite]))
    return signal.unit != verdict.unit, is_other, abs(value - verdict.measured)

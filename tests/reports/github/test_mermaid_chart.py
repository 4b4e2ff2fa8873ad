"""Charts that GitHub draws."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sim_action.recording.replay.replay_data import SignalData, write_replay
from sim_action.reports import ReportOptions
from sim_action.reports.github.mermaid_chart import chart, load_replay, sampled, signal_of_verdict
from sim_action.state.verdict import Signal, Verdict
from tests.outcomes import like
from tests.reports.replays import replay, signal
from tests.reports.samples import SAMPLES

TIME = np.linspace(0.0, 6.0, 7)
VALUES = np.array([0.0, 0.5, 1.0, 1.0, 1.0, 1.0, 1.0])

LINE = re.compile(
    r'```mermaid|```|%%\{init: \{[\w "#,:{}]+\}\}%%|xychart-beta|    title "[^"`#;<>{}&%]*"'
    r'|    [xy]-axis "[^"`#;<>{}&%]*" -?[\d.]+ --> -?[\d.]+|    line \[-?[\d.]+(, -?[\d.]+)*\]'
)


def curve(**changed: object) -> Signal:
    return Signal(**({"name": "travelled", "unit": "m", "time": TIME, "values": VALUES} | changed))  # type: ignore[arg-type] # the fields of a Signal


def lines(text: str) -> list[list[float]]:
    return [[float(value) for value in line.split(", ")] for line in re.findall(r"    line \[(.*)\]", text)]


def axis(text: str, which: str) -> tuple[float, ...]:
    ((low, high),) = re.findall(rf'    {which}-axis "[^"]*" (\S+) --> (\S+)', text)
    return float(low), float(high)


def test_a_curve_stands_beside_its_limit_and_the_title_says_which_is_which() -> None:
    text = chart(curve(lower=1.5))
    assert '    title "travelled (level line: limit, at least 1.5 m)"' in text
    assert axis(text, "y") == (0.0, 1.62)
    assert axis(text, "x") == (0.0, 5.9994)
    assert '"sim time in s"' in text
    assert '"in m"' in text
    values, limit = lines(text)
    assert (values[0], values[-1], max(values), len(values)) == (0.0, 1.0, 1.0, 60)
    assert limit == [1.5, 1.5]


def test_units_and_limits_of_a_chart() -> None:
    # Angles are in degrees.
    text = chart(curve(name="tilt", unit="rad", values=VALUES * math.pi / 18, upper=math.pi / 9))
    assert '"tilt (level line: limit, at most 20 deg)"' in text
    assert '"in deg"' in text
    values, limit = lines(text)
    assert max(values) == 10.0
    assert limit == [20.0, 20.0]
    # Both limits are drawn.
    text = chart(curve(lower=-1.0, upper=2.0))
    assert "level lines: limits, at least -1 m and at most 2 m" in text
    assert lines(text)[1:] == [[-1.0, -1.0], [2.0, 2.0]]
    assert axis(text, "y") == (-1.24, 2.24)


@pytest.mark.parametrize(
    ("values", "limit", "expected"),
    [
        ([100.0, 101.0], None, (99.92, 101.08)),
        ([1.0, 2.0], None, (0.0, 2.08)),
        ([-2.0, -1.0], None, (-2.08, 0.0)),
        ([0.0, 0.0], 0.0, (0.0, 0.08)),
        ([5.0, 5.0], None, (4.6, 5.4)),
        ([1e-5, 2e-5], 1e-4, (0.0, 0.0001072)),
        ([0.0, 2e6], None, (0.0, 2160000.0)),
    ],
)
def test_the_axis_shows_all_of_it_and_zero_where_that_is_near(
    values: list[float], limit: float | None, expected: tuple[float, float]
) -> None:
    text = chart(curve(time=np.array([0.0, 1.0]), values=np.array(values), upper=limit))
    assert axis(text, "y") == pytest.approx(expected)


def test_gaps_are_bridged_and_what_is_all_gap_is_not_drawn() -> None:
    values, *_ = lines(chart(curve(values=np.where(TIME == 3.0, np.nan, TIME))))
    assert values == pytest.approx(np.linspace(0.0, 6.0, 60).tolist(), abs=1e-3)
    assert chart(curve(values=np.full(7, np.nan))) == ""
    # One moment is no curve.
    assert [chart(curve(time=TIME[:count], values=VALUES[:count])) for count in (0, 1)] == ["", ""]


def test_peaks_curves_and_moments_are_kept() -> None:
    # A blow of one step is seen.
    time = np.arange(0, 30, 1 / 240)
    force = np.where(np.arange(len(time)) == 1234, 80.0, 0.0)
    assert max(sampled(time, force)) == 80.0
    assert len(sampled(time, force)) == 60
    # A smooth curve stays smooth.
    time = np.linspace(0.0, 6.0, 601)
    drawn = sampled(time, np.sin(time))
    assert drawn == pytest.approx(np.sin(np.linspace(0.0, 6.0, 60)).tolist(), abs=1e-3)
    # The moment of the verdict is as it was.
    time = np.linspace(0.0, 60.0, 6001)
    values = np.where(np.abs(time - 20.3) < 0.005, 0.01, 0.0) + time
    assert np.interp(20.3, time, values) in sampled(time, values, 20.3)


@given(name=st.text(), unit=st.text(max_size=20))
def test_no_text_is_more_than_text(name: str, unit: str) -> None:
    text = chart(curve(name=name, unit=unit, lower=1.0))
    assert all(LINE.fullmatch(line) for line in text.split("\n"))
    assert len(text.split("\n")) == 9


LARGE = st.floats(-1e9, 1e9)


@given(st.lists(LARGE, min_size=2, max_size=200), st.none() | LARGE, st.none() | st.floats(-1.0, 300.0))
def test_any_curve_is_drawn_within_its_axis(values: list[float], limit: float | None, moment: float | None) -> None:
    text = chart(curve(time=np.arange(len(values), dtype=float), values=np.array(values), upper=limit), moment)
    assert all(LINE.fullmatch(line) for line in text.split("\n"))
    low, high = axis(text, "y")
    assert low < high
    assert len(text) < 2_000
    for line in lines(text):
        assert low <= min(line)
        assert max(line) <= high


anything = st.floats(allow_nan=True, allow_infinity=True)
# Larger numbers are not drawn at all.
drawn = st.floats(-1e12, 1e12)
gaps = st.sampled_from((math.nan, math.inf, -math.inf))


@given(
    st.lists(st.tuples(anything, anything), max_size=50)
    | st.lists(st.tuples(drawn, drawn | gaps), min_size=6, max_size=50),
    st.none() | anything,
)
@example([(1e300, 0.0), (-1.7e308, 0.0)], None)
def test_nothing_that_a_file_may_hold_breaks_it(rows: list[tuple[float, float]], moment: float | None) -> None:
    """Times rise, and nothing else is sure."""
    rising = {time: value for time, value in sorted(rows, key=lambda row: row[0]) if math.isfinite(time)}
    time, values = np.array(sorted(rising)), np.array([rising[at] for at in sorted(rising)])
    text = chart(curve(time=time, values=values, upper=1.0), moment)
    assert all(LINE.fullmatch(line) for line in text.split("\n") if text)
    assert len(text) < 3_000


SHORT = Verdict(False, 1.12, 1.5, -0.38, "m", 3.0)


def found(*signals: SignalData, verdict: Verdict = SHORT) -> Signal:
    curve = signal_of_verdict(replay(*signals), 0, verdict)
    assert curve is not None
    return curve


@pytest.mark.parametrize(
    "name", [None, "../a.json.gz", "replays/none.json.gz", "/etc/passwd", "replays/\0", "replays/text.json.gz"]
)
def test_a_file_from_elsewhere_or_another_one_is_no_replay(name: str | None, options: ReportOptions) -> None:
    made = replay(signal("travelled", [0.0, 1.0, 1.12, 1.12], lower=1.5))
    for path in ("../a.json.gz", "replays/a.json.gz"):
        write_replay(made, options.folder / path)
    (options.folder / "replays/text.json.gz").write_bytes(b"not a replay")
    outcome = SAMPLES["passed"].outcomes[0]
    assert load_replay(like(outcome, replay=name), options) is None
    assert load_replay(like(outcome, replay="replays/a.json.gz"), options) == made


def test_the_stored_curve_of_a_verdict() -> None:
    # A curve is as it was stored.
    own = found(signal("travelled", [0.0, 1.0, 1.12, 1.12], lower=1.5))
    assert (own.name, own.unit, own.lower, own.upper, own.start) == ("travelled", "m", 1.5, None, 0.0)
    np.testing.assert_allclose(own.time, [0.0, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(own.values, [0.0, 1.0, 1.12, 1.12])
    # A curve may have moments of its own.
    np.testing.assert_allclose(found(signal("travelled", [0.0, 1.0], time=[0.5, 0.75])).time, [0.5, 0.75])


def test_the_curve_that_fits_a_verdict() -> None:
    # Of several it is the one with the unit the limit and the value.
    x = signal("x", [0.0, 1.0, 2.0, 3.0], lower=1.5)
    seconds = signal("time at rest", [0.0, 1.0, 1.12, 1.12], unit="s", lower=1.5)
    other = signal("y", [0.0, 1.0, 1.12, 1.12], lower=1.6)
    assert found(x, seconds, other, signal("travelled", [0.0, 1.0, 1.12, 1.12], lower=1.5)).name == "travelled"
    # Of none that fits it is the first.
    several = signal("x", [0.0] * 4), signal("y", [0.0] * 4)
    assert found(*several, verdict=replace(SHORT, measured=None, limit=None)).name == "x"
    # Curves belong to one expectation and may have no values.
    assert signal_of_verdict(replay(signal("x", [0.0] * 4, expectation=1)), 0, SHORT) is None
    assert np.isnan(found(signal("x", [np.nan] * 4)).values).all()

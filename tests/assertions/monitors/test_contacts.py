"""The mean contact force over a sliding window."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.monitors.contacts import MeanForce
from sim_action.state.observation import Contact
from sim_action.state.trace import Trace
from tests.soak import examples
from tests.traces import contact, piece, trace

RATES = (120.0, 240.0, 480.0, 960.0, 1920.0)
rates = st.sampled_from((60.0, 100.0, 130.0, *RATES))
forces = st.lists(st.just(0.0) | st.floats(0, 1e4), min_size=1, max_size=80)


def seen(rate: float, values: list[float]) -> Trace:
    """A step for each force; two points share it."""
    times = [(step + 1) / rate for step in range(len(values))]
    pairs = [(time, force / 2) for time, force in zip(times, values, strict=True) if force]
    return trace(times, contacts=[contact(*pair) for time, force in pairs for pair in [(time, "ball", "a", force)] * 2])


def naive(rate: float, window: float, values: list[float], start: float = 0.0) -> list[float]:
    """The integral of the force of each step over the window before its end."""
    means = []
    for now in range(1, len(values) + 1):
        total, begin = 0.0, now / rate - window
        for step in range(now - int(window * rate) - 2, now + 1):
            force = start if step <= 0 else values[step - 1]
            total += force * max(0.0, step / rate - max(begin, (step - 1) / rate))
        means.append(total / window)
    return means


@examples(100)
@given(rates, st.floats(0.02, 0.2), forces, st.just(0.0) | st.floats(0, 100))
def test_it_is_the_integral_over_the_window(rate: float, window: float, values: list[float], start: float) -> None:
    known = seen(rate, values)
    opened = MeanForce.of(rate, window, [contact(0.0, force=start)])
    time, mean = opened.observe(known, known.contacts)[1]
    assert time.tolist() == known.time.tolist()
    assert mean.tolist() == pytest.approx(naive(rate, window, values, start), rel=1e-6, abs=1e-6)


@examples(60)
@given(rates, st.floats(0.02, 0.2), forces, st.lists(st.integers(0, 80), max_size=8))
def test_blocks_do_not_change_it(rate: float, window: float, values: list[float], cuts: list[int]) -> None:
    known = seen(rate, values)
    opened = MeanForce.of(rate, window, ())
    whole = opened.observe(known, known.contacts)[1].mean.tolist()
    found: list[float] = []
    for start, end in pairwise(sorted([0, *(min(cut, len(known)) for cut in cuts), len(known)])):
        block = piece(known, start, end)
        opened, means = opened.observe(block, block.contacts)
        found += means.mean.tolist()
    assert found == whole


@pytest.mark.parametrize("duration", [0.0, 0.01, 0.04])
def test_the_mean_of_an_impact_does_not_depend_on_the_rate(duration: float) -> None:
    """An impact of 0.5 N s in this time, or in one step if that takes longer, in a push by 6 N."""
    most = []
    for rate in RATES:
        steps = max(1, round(duration * rate))
        values = [6.0] * round(0.2 * rate)
        start = round(0.1 * rate)
        values[start : start + steps] = [6.0 + 0.5 * rate / steps] * steps
        known = seen(rate, values)
        most.append(float(MeanForce.of(rate, 0.05, ()).observe(known, known.contacts)[1].mean.max()))
    assert most == pytest.approx([16.0] * len(RATES), rel=1e-6)


def test_a_decimated_trace_has_moments_near_its_contacts_only() -> None:
    far = [contact(1.0, force=12.0), contact(500.0, force=24.0)]
    rows = trace([0.0, 1000.0])
    time, mean = MeanForce.of(240, 0.05, ()).observe(rows, far)[1]
    assert len(time) == 2 + 2 * 13
    assert (mean.max(), mean[0], mean[-1]) == (2.0, 0.0, 0.0)
    assert time[mean > 0].tolist() == [step / 240 for begin in (240, 120_000) for step in range(begin, begin + 12)]


def test_nothing_is_no_force() -> None:
    none: list[Contact] = []
    opened = MeanForce.of(240, 0.05, none)
    assert opened.observe(trace([]), none)[1].mean.tolist() == []
    assert opened.observe(trace([0.5, 1.0]), none)[1].mean.tolist() == [0.0, 0.0]
    assert np.all(opened.observe(trace([]), [contact(0.5, force=12.0)])[1].mean == 1.0)

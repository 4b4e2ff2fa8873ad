"""When messages arrive, which are lost, and what their statistics are."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.state.transmission import PERFECT, Line, Transmission
from tests.soak import examples

RATE = 240.0


def line(*, seed: int = 1, **keys: Any) -> Line[int]:
    return Line(Transmission.model_validate(keys), RATE, np.random.default_rng(seed))


def delays(count: int, spacing: int, **keys: Any) -> np.ndarray:
    """Return the delays in steps of messages that are sent `spacing` steps apart, in which none can meet another."""
    found = line(**keys)
    late = []
    for sent in range(0, count * spacing, spacing):
        if found.send(sent, sent):
            late += [found.next_step - sent]
            assert found.arrived(sent + spacing) == [sent]
    return np.array(late)


def test_a_message_takes_its_latency_in_whole_steps_rounded_up() -> None:
    found = line(latency="10 ms")  # 2.4 steps
    assert found.send(10, 1)
    assert found.next_step == 13
    assert found.arrived(12) == []
    assert found.arrived(13) == [1]
    assert found.next_step == math.inf


@pytest.mark.parametrize("steps", [0, 1, 12, 240])
def test_a_latency_of_whole_steps_is_not_one_more(steps: int) -> None:
    found = line(latency=steps / RATE)
    found.send(7, 1)
    assert found.next_step == 7 + steps


def test_nothing_is_late_or_lost_by_default() -> None:
    assert PERFECT.is_perfect
    assert Transmission().is_perfect
    assert not any(Transmission.model_validate({key: 0.1}).is_perfect for key in ("latency", "jitter", "dropouts"))


@examples(50)
@given(
    latency=st.floats(0, 0.1),
    jitter=st.floats(0, 0.5),
    dropouts=st.floats(0, 0.99),
    gaps=st.lists(st.integers(0, 20), max_size=40),
    seed=st.integers(0, 2**32),
)
def test_messages_keep_their_order_and_each_arrives_once_within_its_bounds(
    latency: float, jitter: float, dropouts: float, gaps: list[int], seed: int
) -> None:
    found, sent, arrived = line(seed=seed, latency=latency, jitter=jitter, dropouts=dropouts), list[int](), list[int]()
    when: dict[int, int] = {}
    steps = np.cumsum(gaps).tolist()
    for number, step in enumerate(steps):
        if found.send(step, number):
            sent.append(number)
    for step in range((steps or [0])[-1] + 200):
        for number in found.arrived(step):
            arrived.append(number)
            when[number] = step
    assert arrived == sent
    assert found.sent - found.lost == len(arrived)
    latest = -1
    for number in arrived:
        at = when[number]
        assert steps[number] + latency * RATE <= at + 1e-5
        # Only an earlier message can hold it up any longer.
        assert at <= max(latest, steps[number] + math.ceil((latency + jitter) * RATE))
        latest = at


def test_jitter_is_uniform_between_the_latency_and_its_sum() -> None:
    count = 4000
    found = delays(count, 60, latency=24 / RATE, jitter=24 / RATE)
    # Rounded up, the delays are 25 to 48 steps, each as likely as another; a draw of exactly 0 has 24.
    assert (found.min(), found.max()) == (25, 48)
    expected, deviation = count / 24, math.sqrt(count / 24 * 23 / 24)
    counts = np.bincount(found.astype(int))[25:]
    # 24 counts, each within 4 standard deviations: P = 0.998.
    assert np.abs(counts - expected).max() < 4 * deviation
    assert found.mean() == pytest.approx(36.5, abs=4 * 24 / math.sqrt(12 * count))
    # Neighbours are independent: the correlation of a sample has a standard deviation of 1 / sqrt(count).
    assert abs(np.corrcoef(found[:-1], found[1:])[0, 1]) < 4 / math.sqrt(count)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.9])
def test_as_many_are_lost_as_a_binomial_distribution_allows(share: float) -> None:
    count, found = 4000, line(dropouts=share)
    lost = np.array([not found.send(step, step) for step in range(count)])
    assert found.lost == lost.sum()
    assert abs(lost.sum() - count * share) < 4 * math.sqrt(count * share * (1 - share))
    # Losses come alone: after a lost message, the next one is lost as often as any.
    pairs = (lost[:-1] & lost[1:]).sum()
    assert abs(pairs - count * share**2) < 4 * math.sqrt(count * share**2)


def test_the_draws_of_one_key_do_not_depend_on_another() -> None:
    lossy, both = line(dropouts=0.5), line(dropouts=0.5, jitter=1.0)
    assert [lossy.send(step, step) for step in range(50)] == [both.send(step, step) for step in range(50)]
    # The seed decides.
    first, same, other = (delays(30, 60, seed=seed, jitter=0.1).tolist() for seed in (1, 1, 2))
    assert first == same != other


@pytest.mark.parametrize(
    "keys", [{"latency": -0.1}, {"jitter": "-1 ms"}, {"dropouts": 1}, {"dropouts": -0.1}, {"latency": "5 m"}]
)
def test_impossible_keys_are_refused(keys: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Transmission.model_validate(keys)

"""The distributions of draws, compared with independent formulae."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from random import Random
from statistics import NormalDist, fmean, variance
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.scenario import variations as draws

COUNT = 4000
SHARES = st.floats(0, 1, exclude_max=True)
FIGURES = st.floats(-1e6, 1e6)


def drawn(draw: draws.Distribution, seed: int = 1) -> list[Any]:
    generator = Random(seed)
    return list(draw.drawn(generator.random() for _ in range(COUNT)))


def largest_gap(samples: Sequence[float], share_below: Callable[[float], float]) -> float:
    """The statistic of Kolmogorov and Smirnov: the largest difference of both distribution functions."""
    ordered = sorted(samples)
    return max(
        max((index + 1) / len(ordered) - share_below(value), share_below(value) - index / len(ordered))
        for index, value in enumerate(ordered)
    )


SIGNIFICANT = 1.95 / COUNT**0.5  # larger differences have a probability of 1e-3; the seed is fixed


def simpson(function: Callable[[float], float], low: float, high: float, steps: int = 2000) -> float:
    width = (high - low) / steps
    inner = sum((4 if step % 2 else 2) * function(low + step * width) for step in range(1, steps))
    return (function(low) + inner + function(high)) * width / 3


@pytest.mark.parametrize(
    ("draw", "share_below"),
    [
        (draws.Uniform(uniform=(-2, 6)), lambda x: (x + 2) / 8),
        (draws.Sobol(sobol=(-2, 6)), lambda x: (x + 2) / 8),
        (draws.LogUniform(log_uniform=(0.01, 100)), lambda x: (math.log10(x) + 2) / 4),
        (draws.Normal(normal=(3, 2)), NormalDist(3, 2).cdf),
    ],
)
def test_samples_have_the_distribution_that_they_are_drawn_from(
    draw: draws.Distribution, share_below: Callable[[float], float]
) -> None:
    assert largest_gap(drawn(draw), share_below) < SIGNIFICANT
    assert largest_gap(drawn(draw), lambda x: share_below(x) ** 1.2) > SIGNIFICANT


@pytest.mark.parametrize(
    "between", [(-1, 1), (0, 0.1), (-5, -1), (2, 3), (4, 9), (-30, 30), (-0.5, 40), (-40, 0.5), (5, 5.5), (-5.9, -5.8)]
)
def test_a_truncated_normal_distribution_is_the_density_integrated_over_its_range(between: tuple[float, float]) -> None:
    """By Simpson's rule, which shares no code with the error function."""
    mean, deviation = 2.0, 3.0
    low, high = (mean + deviation * bound for bound in between)
    samples = drawn(draws.Normal(normal=(mean, deviation), between=(low, high)))

    def density(x: float) -> float:
        return math.exp(-(((x - mean) / deviation) ** 2) / 2)

    near = max(low, mean - 12 * deviation), min(high, mean + 12 * deviation)
    whole = simpson(density, *near)
    assert all(low <= sample <= high for sample in samples)
    for share in (0.02, 0.1, 0.5, 0.9, 0.98):
        value = sorted(samples)[int(share * COUNT)]
        assert abs(simpson(density, near[0], value) / whole - share) < SIGNIFICANT
    expected = simpson(lambda x: x * density(x), *near) / whole
    assert abs(fmean(samples) - expected) < 4 * (variance(samples) / COUNT) ** 0.5


def test_quantiles_of_a_truncated_normal_distribution_are_exact_far_from_its_mean() -> None:
    """The median halves the tail, with all digits of the error function."""
    for side in (1, -1):
        between = (5.5, 30.0) if side > 0 else (-30.0, -5.5)
        (median,) = draws.Normal(normal=(0, 1), between=between).drawn([0.5])
        assert isinstance(median, float)
        tail = math.erfc(abs(median) / math.sqrt(2)) / math.erfc(5.5 / math.sqrt(2))
        assert tail == pytest.approx(0.5, rel=1e-9)


@given(FIGURES, st.floats(1e-3, 1e6), st.floats(-6, 6), st.floats(-6, 6), SHARES)
def test_truncated_samples_are_in_their_range(mean: float, deviation: float, a: float, b: float, share: float) -> None:
    low, high = sorted((mean + deviation * a, mean + deviation * b))
    assume((high - low) / deviation > 0.1)
    (sample,) = draws.Normal(normal=(mean, deviation), between=(low, high)).drawn([share])
    assert isinstance(sample, float)
    assert low <= sample <= high


@given(FIGURES, FIGURES, SHARES)
def test_samples_of_a_range_are_in_it(one: float, other: float, share: float) -> None:
    low, high = sorted((one, other))
    assume(low < high)
    for draw in (draws.Uniform(uniform=(low, high)), draws.Sobol(sobol=(low, high))):
        (sample,) = draw.drawn([share])
        assert isinstance(sample, float)
        assert low <= sample <= high


@given(st.floats(1e-300, 1e300), st.floats(1e-300, 1e300), SHARES)
def test_samples_of_orders_of_magnitude_are_in_their_range(one: float, other: float, share: float) -> None:
    low, high = sorted((one, other))
    assume(low < high)
    (sample,) = draws.LogUniform(log_uniform=(low, high)).drawn([share])
    assert isinstance(sample, float)
    assert low <= sample <= high


@given(st.integers(-(2**52), 2**52), st.integers(-(2**52), 2**52), SHARES)
def test_whole_numbers_are_in_their_range(one: int, other: int, share: float) -> None:
    low, high = sorted((one, other))
    assume(low < high)
    draw = draws.Integers(integers=(low, high))
    first, sample, last = draw.drawn([0.0, share, 1 - 2**-53])
    assert isinstance(sample, int)
    assert first == low <= sample <= high == last


def test_whole_numbers_are_equally_likely() -> None:
    count = Counter(drawn(draws.Integers(integers=(-2, 5))))
    assert sorted(count) == list(range(-2, 6))
    squares = sum((found - COUNT / 8) ** 2 / (COUNT / 8) for found in count.values())
    # A chi-squared of 7 degrees of freedom is larger with a probability of 1e-3.
    assert squares < 24.3


def test_values_are_chosen_as_often_as_their_weights_say() -> None:
    generator = Random(2)
    choice = draws.Choice(choice=("a", "b", "c", "d"), weights=(0, 3, 1, 0))
    count = Counter(choice.indices(generator.random() for _ in range(COUNT)))
    assert set(count) == {1, 2}
    assert abs(count[1] / COUNT - 0.75) < 4 * (0.75 * 0.25 / COUNT) ** 0.5
    even = Counter(draws.Choice(choice=("a", "b", "c")).indices(generator.random() for _ in range(COUNT)))
    assert all(abs(even[index] / COUNT - 1 / 3) < 4 * (2 / 9 / COUNT) ** 0.5 for index in range(3))


@given(st.lists(st.floats(0, 1e300), min_size=2, max_size=8), SHARES)
def test_a_value_without_weight_is_never_chosen(weights: list[float], share: float) -> None:
    assume(0 < sum(weights) < math.inf)
    choice = draws.Choice(choice=tuple(range(len(weights))), weights=tuple(weights))
    for index in choice.indices([0.0, share, 1 - 2**-53]):
        assert weights[index] > 0


@pytest.mark.parametrize(
    ("way", "stated", "message"),
    [
        ("normal", {"normal": (0, 1), "between": (1, 1)}, "both bounds are 1; choose two different ones"),
        ("normal", {"normal": (0, 1), "between": ("2", 1)}, "found [2, 1]; write [1, 2]"),
        ("normal", {"normal": (0, 1), "between": (7, 9)}, "'between' holds 1e-12 of the normal distribution, less"),
        ("normal", {"normal": (0, 1), "between": (-9, -7)}, "widen it, move the mean, or use 'uniform'"),
        ("normal", {"normal": (0, 1), "between": (1e300, 1e301)}, "'between' holds 0 of the normal distribution"),
        ("normal", {"normal": (0, 1), "between": (0, 1e-12)}, "'between' holds 4e-13 of the normal distribution"),
        ("normal", {"normal": (0, 1), "between": (0, math.nan)}, "expected a finite number or quantity, found nan"),
        ("normal", {"normal": ("0 m", "1 m"), "between": ("0 s", "1 m")}, "of the same dimension as m; found '0 s'"),
        ("normal", {"normal": ("0 m", "1 m"), "between": (-1, 1)}, "units of the same dimension as m; found -1"),
        ("normal", {"normal": (0, 1), "between": ("0 m", 1)}, "must have no unit, like the mean; found '0 m'"),
        ("normal", {"normal": (0, 1e308)}, "samples would be larger than any number; choose a smaller standard"),
        ("normal", {"normal": (-1.79e308, 1e306)}, "samples would be larger than any number"),
        ("uniform", {"uniform": (math.nan, 1)}, "expected a finite number or quantity, found nan"),
        ("log_uniform", {"log_uniform": (0, 1)}, "must be above 0; found [0, 1]; use 'uniform' for a range with 0"),
        ("log_uniform", {"log_uniform": ("-1 m", "1 m")}, "both bounds must be above 0"),
        ("log_uniform", {"log_uniform": (2, 1)}, "must be below the second; found [2, 1]; write [1, 2]"),
        ("sobol", {"sobol": ("1 m", "5 s")}, "both figures must have units of one dimension, or none"),
        ("integers", {"integers": (3, 3)}, "both bounds are 3; choose two different ones, or list the value: [3]"),
        ("integers", {"integers": (3, 1)}, "must be below the second; found [3, 1]; write [1, 3]"),
        ("integers", {"integers": (0, 2.5)}, "Input should be a valid integer"),
        ("integers", {"integers": (0, 2**60)}, "less than or equal to 4503599627370496"),
        ("choice", {"choice": ("a",)}, "'choice' needs at least two values, found 1; a list can have a single one"),
        ("choice", {"choice": ("a", "b"), "weights": (1,)}, "one number for each of the 2 values, found 1"),
        ("choice", {"choice": ("a", "b"), "weights": (1, -1)}, "'weights' must be finite and not negative, found -1"),
        ("choice", {"choice": ("a", "b"), "weights": (1, math.nan)}, "must be finite and not negative, found nan"),
        ("choice", {"choice": ("a", "b"), "weights": (1, math.inf)}, "must be finite and not negative, found inf"),
        ("choice", {"choice": ("a", "b"), "weights": (0, 0)}, "the sum of 'weights' must be finite and above 0"),
        ("choice", {"choice": ("a", "b"), "weights": (1e308, 1e308)}, "the sum of 'weights' must be finite"),
    ],
)
def test_draws_that_cannot_be(way: str, stated: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError) as refused:
        draws.DRAWS[way].model_validate(stated)
    assert message in refused.value.errors()[0]["msg"]


def test_bounds_of_a_normal_distribution_have_the_unit_of_its_mean_or_none_for_0() -> None:
    plain, other = (
        list(draws.Normal(normal=("0 m", "5 cm"), between=between).drawn([0.1, 0.9]))
        for between in (("-1 cm", "10 cm"), ("-10 mm", "0.1 m"))
    )
    assert plain == other
    assert list(draws.Normal(normal=("3 cm", "5 cm"), between=(0, "1 m")).drawn([0.0])) == ["0.0 cm"]

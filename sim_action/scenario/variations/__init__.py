"""Variations of a scenario, and the ways to draw the values of a key.

These are distributions, choices, an even sample, and the rows of a CSV file. Each distribution turns numbers from 0 to
1 into values, by the inverse of its cumulative distribution. So samples depend on nothing else, and `sobol` differs
from `uniform` only in these numbers.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator
from itertools import accumulate
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Self

from pydantic import Field, model_validator

from sim_action.core import units
from sim_action.core.field_types import FrozenModel
from sim_action.core.wording import shown

if TYPE_CHECKING:
    from statistics import NormalDist

_QUANTITY: Final = re.compile(
    r"\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*((?:[A-Za-z][A-Za-z0-9/^ ]{0,19})?)\s*"
)

# The least number that is used instead of 0, at which the inverse normal distribution is infinite.
_LEAST: Final = 2.0**-53

# No sample of a whole normal distribution is farther from the mean: a number of 53 bits is at least `_LEAST` or 0.
_MOST_DEVIATIONS: Final = 9

_LEAST_MASS: Final = 1e-9  # the share of a normal distribution that a range must hold
_LEAST_CHOICE: Final = 2

# Sums and products of such numbers with a number from 0 to 1 are exact enough to reach each of them.
_MAX_INTEGER: Final = 2**52

Bounds = tuple[float | str, float | str]


class DrawError(ValueError):
    """A value of a draw that makes no sense; `key` leads to it."""

    def __init__(self, message: str, key: str) -> None:
        self.key = key
        super().__init__(message)


class Draw(FrozenModel):
    """Values drawn at random. Only the seed and the key decide them: other keys change nothing."""

    key: ClassVar[str]

    samples: Annotated[
        int | None,
        Field(ge=1, le=10_000, description="number of samples; the same for all drawn keys; default: runs of the gate"),
    ] = None


class Distribution(Draw):
    """Numbers of a distribution."""

    def drawn(self, numbers: Iterable[float]) -> Iterator[int | float | str]:
        """Yield a sample for each number from 0 to 1, without 1."""
        raise NotImplementedError

    @property
    def advice(self) -> str:
        """The end of a message about a sample that its key does not allow."""
        return f"drawn from {self}; {self._bounding}"

    @property
    def _bounding(self) -> str:
        return "choose bounds within the allowed range"

    def __str__(self) -> str:
        return f"{self.key}: {_listed(getattr(self, self.key))}"


class _Pair(Distribution):
    """A distribution with two figures, which may have units of one dimension."""

    def drawn(self, numbers: Iterable[float]) -> Iterator[float | str]:
        """Yield the samples in the unit of the figures."""
        first, second, unit = self.numbers
        quantile = self._quantile(first, second)
        samples = map(quantile, numbers)
        return (f"{sample!r} {unit}" for sample in samples) if unit else samples

    @property
    def numbers(self) -> tuple[float, float, str]:
        """Return both figures in the unit of the second, or of the first if that is a bare 0. Raises ValueError."""
        stated, bound = getattr(self, self.key)
        (first, unit), (second, other) = _number(stated), _number(bound)
        if unit == other or (unit and not other and second == 0):
            return first, second, unit
        if first == 0 and not unit:
            return first, second, other
        factor = units.conversion(unit, other) if unit and other else None
        if factor is None or not math.isfinite(first * factor):
            raise ValueError(
                f"both figures must have units of one dimension, or none; found {_shown(stated)} and {_shown(bound)}"
            )
        return first * factor, second, other

    def _quantile(self, first: float, second: float) -> Callable[[float], float]:
        raise NotImplementedError


class _Range(_Pair):
    """A distribution between two bounds."""

    @model_validator(mode="after")
    def _is_a_range(self) -> Self:
        low, high, _ = self.numbers
        _refuse_no_range(self.key, getattr(self, self.key), low, high)
        return self

    def _quantile(self, first: float, second: float) -> Callable[[float], float]:
        return lambda number: float(first + (second - first) * number)


class Uniform(_Range):
    """A uniform distribution between two bounds."""

    key = "uniform"

    uniform: Annotated[
        Bounds, Field(description="lower and upper bound: numbers, or quantities of one dimension; 0 needs no unit")
    ]


class LogUniform(_Range):
    """A distribution between two bounds whose logarithm is uniform: each order of magnitude is equally likely."""

    key = "log_uniform"

    log_uniform: Annotated[
        Bounds, Field(description="lower and upper bound, both above 0: numbers, or quantities of one dimension")
    ]

    @model_validator(mode="after")
    def _is_positive(self) -> Self:
        if self.numbers[0] <= 0:
            message = f"both bounds must be above 0; found {_listed(self.log_uniform)}"
            raise DrawError(f"{message}; use 'uniform' for a range with 0 or negative numbers", self.key)
        return self

    def _quantile(self, first: float, second: float) -> Callable[[float], float]:
        least = math.log(first)
        width = math.log(second) - least
        return lambda number: min(max(math.exp(least + width * number), first), second)


class Sobol(_Range):
    """Uniform numbers between two bounds, which cover the space of all keys with `sobol` evenly, not at random."""

    key = "sobol"

    sobol: Annotated[
        Bounds, Field(description="lower and upper bound: numbers, or quantities of one dimension; 0 needs no unit")
    ]


class Normal(_Pair):
    """A normal distribution, whole or between two bounds."""

    key = "normal"

    normal: Annotated[
        Bounds,
        Field(description="mean and standard deviation: numbers, or quantities of one dimension; 0 needs no unit"),
    ]
    between: Annotated[Bounds | None, Field(description="bounds of the samples; the rest of the bell is cut off")] = (
        None
    )

    @property
    def _bounding(self) -> str:
        return super()._bounding if self.between else "limit it with 'between', or use a smaller deviation"

    @model_validator(mode="after")
    def _spreads(self) -> Self:
        mean, deviation, _ = self.numbers
        if deviation <= 0:
            stated, remedy = _listed(self.normal), f"or list one value: [{_as_written(self.normal[0])}]"
            message = f"the second figure, the standard deviation, must be above 0; found {stated}"
            raise DrawError(f"{message}; choose a positive one, {remedy}", self.key)
        if not math.isfinite(abs(mean) + _MOST_DEVIATIONS * deviation):
            raise DrawError("samples would be larger than any number; choose a smaller standard deviation", self.key)
        if self.between is None:
            return self
        low, high = self._bounds
        _refuse_no_range("between", self.between, low, high)
        if (mass := _Bell(mean, deviation, low, high).mass) < _LEAST_MASS:
            message = f"'between' holds {mass:.1g} of the normal distribution, less than {_LEAST_MASS:g}"
            raise DrawError(f"{message}; widen it, move the mean, or use 'uniform'", "between")
        return self

    def __str__(self) -> str:
        return f"{super().__str__()}{f', between: {_listed(self.between)}' if self.between else ''}"

    @property
    def _bounds(self) -> tuple[float, float]:
        """The bounds in the unit of the mean. Raises ValueError."""
        assert self.between is not None
        unit = self.numbers[2]
        low, high = (_converted(bound, unit) for bound in self.between)
        return low, high

    def _quantile(self, first: float, second: float) -> Callable[[float], float]:
        if self.between is not None:
            return _Bell(first, second, *self._bounds).quantile
        standard = _standard_normal()
        return lambda number: float(first + second * standard.inv_cdf(number or _LEAST))


class _Bell:
    """A normal distribution between two bounds.

    It is mirrored if most of it is above its mean: probabilities near 0 have more digits than those near 1.
    """

    def __init__(self, mean: float, deviation: float, low: float, high: float) -> None:
        self._mean, self._low, self._high = mean, low, high
        least, most = (low - mean) / deviation, (high - mean) / deviation
        self._is_mirrored = least + most > 0
        self._deviation = -deviation if self._is_mirrored else deviation
        lower, upper = (-most, -least) if self._is_mirrored else (least, most)
        self._below = _below(lower)
        self.mass = _below(upper) - self._below

    def quantile(self, number: float) -> float:
        """Return the value with this share of the distribution below it."""
        share = 1 - number if self._is_mirrored else number
        below = min(max(self._below + self.mass * share, math.ulp(0.0)), 1 - _LEAST)
        return min(max(self._mean + self._deviation * _standard_normal().inv_cdf(below), self._low), self._high)


def _below(deviations: float) -> float:
    return math.erfc(-deviations / math.sqrt(2)) / 2


def _standard_normal() -> NormalDist:
    # Few scenarios draw from it, and this takes 3 ms to import.
    from statistics import NormalDist

    return NormalDist()


_Whole = Annotated[int, Field(ge=-_MAX_INTEGER, le=_MAX_INTEGER)]


class Integers(Distribution):
    """Whole numbers between two bounds, all equally likely."""

    key = "integers"

    integers: Annotated[tuple[_Whole, _Whole], Field(description="the least and the greatest number, both included")]

    @model_validator(mode="after")
    def _is_a_range(self) -> Self:
        _refuse_no_range(self.key, self.integers, *self.integers)
        return self

    def drawn(self, numbers: Iterable[float]) -> Iterator[int]:
        """Yield whole numbers."""
        low, high = self.integers
        return (low + int((high - low + 1) * number) for number in numbers)


class Choice(Draw):
    """Values of a list, all equally likely or by weights."""

    key = "choice"

    choice: Annotated[tuple[Any, ...], Field(description="the values; at least two")]
    weights: Annotated[
        tuple[float, ...] | None, Field(description="how often each value is chosen, relative to the others")
    ] = None

    @model_validator(mode="after")
    def _can_choose(self) -> Self:
        count = len(self.choice)
        if count < _LEAST_CHOICE:
            message = f"'choice' needs at least two values, found {count}; a list can have a single one"
            raise DrawError(message, self.key)
        if self.weights is None:
            return self
        if len(self.weights) != count:
            message = f"'weights' must have one number for each of the {count} values, found {len(self.weights)}"
            raise DrawError(message, "weights")
        for weight in self.weights:
            if not 0 <= weight < math.inf:
                raise DrawError(f"'weights' must be finite and not negative, found {_as_written(weight)}", "weights")
        if not 0 < sum(self.weights) < math.inf:
            raise DrawError("the sum of 'weights' must be finite and above 0, such as that of [3, 1]", "weights")
        return self

    def indices(self, numbers: Iterable[float]) -> Iterator[int]:
        """Yield the index of a value for each number from 0 to 1, without 1."""
        sums = list(accumulate(self.weights or [1.0] * len(self.choice)))
        # The last values may have no weight, and a product may be rounded up to the whole sum.
        last = sums.index(sums[-1])
        return (min(bisect_right(sums, sums[-1] * number), last) for number in numbers)


class CsvColumn(Draw):
    """Values of a column of a CSV file, one row for each sample, in the order of the file."""

    key = "csv"

    csv: Annotated[str, Field(min_length=1, description="path of the file, relative to the scenario")]
    column: Annotated[str | None, Field(description="header of the column; default: the last part of the key")] = None
    samples: Annotated[
        int | None,
        Field(ge=1, le=10_000, description="number of rows from the first one on; default: runs of the gate, else all"),
    ] = None


DRAWS: Final[dict[str, type[Draw]]] = {
    draw.key: draw for draw in (Uniform, Normal, LogUniform, Integers, Choice, Sobol, CsvColumn)
}
"""The ways to draw a value, by key."""

OPTIONS: Final = ("samples", "between", "weights", "column")  # the other keys of draws


def _refuse_no_range(key: str, stated: Bounds, low: float, high: float) -> None:
    """Raise DrawError unless the first bound is below the second, in one unit, and by a finite number."""
    if low == high:
        message = f"both bounds are {_as_written(stated[0])}"
        raise DrawError(f"{message}; choose two different ones, or list the value: [{_as_written(stated[0])}]", key)
    if low > high:
        swapped = _listed(reversed(stated))
        raise DrawError(f"the first bound must be below the second; found {_listed(stated)}; write {swapped}", key)
    if not math.isfinite(high - low):
        raise DrawError(f"the bounds {_listed(stated)} are farther apart than any number; choose nearer ones", key)


def _listed(figures: Iterable[float | str]) -> str:
    return f"[{', '.join(map(_as_written, figures))}]"


def _shown(figure: float | str) -> str:
    return shown(figure) if isinstance(figure, str) else _as_written(figure)


def _as_written(figure: float | str) -> str:
    return figure if isinstance(figure, str) else repr(figure).removesuffix(".0")


def _converted(value: float | str, unit: str) -> float:
    """Return a number in a unit. Raises ValueError."""
    number, own = _number(value)
    if own == unit or (number == 0 and not own):
        return number
    factor = units.conversion(own, unit) if own and unit else None
    if factor is None or not math.isfinite(number * factor):
        expected = f"units of the same dimension as {unit}" if unit else "no unit, like the mean"
        raise ValueError(f"the bounds of 'between' must have {expected}; found {_shown(value)}")
    return number * factor


def _number(value: float | str) -> tuple[float, str]:
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    number = float(match[1]) if match else math.nan if isinstance(value, str) else float(value)
    if not math.isfinite(number):
        raise ValueError(f"expected a finite number or quantity, found {_shown(value)}")
    return number, match[2] if match else ""

"""The values of a key in its variations: a list, or samples drawn at random."""

from __future__ import annotations

import math
import re
from random import Random
from typing import Annotated, Any, ClassVar, Final, Self

from pydantic import Field, ValidationError, model_validator

from sim_action.core import units
from sim_action.core.field_types import FrozenModel
from sim_action.core.records import dataclass
from sim_action.core.wording import did_you_mean, shown
from sim_action.core.yaml_document import KeyPath
from sim_action.core.yaml_errors import spec_errors

_QUANTITY: Final = re.compile(
    r"\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*((?:[A-Za-z][A-Za-z0-9/^ ]{0,19})?)\s*"
)

# The least number that is used instead of 0, at which the inverse normal distribution is infinite.
_LEAST: Final = 2.0**-53

SEED: Final = "seed"
"""The key of the random seed."""

MAX_SEED: Final = 2**63 - 1

# Many programs round larger numbers when they read JSON.
_DRAWN_SEED_BITS: Final = 53

Bounds = tuple[float | str, float | str]


@dataclass(frozen=True, slots=True)
class ValueList:
    """The values of one key.

    Attributes:
        draw: advice for an invalid value if they are drawn at random.
        whole: True if they are drawn as whole numbers.
    """

    values: tuple[Any, ...]
    draw: str = ""
    whole: bool = False

    @property
    def drawn(self) -> bool:
        """Return True if the values are drawn at random."""
        return bool(self.draw)


class ValuesError(Exception):
    """Invalid values; `path` leads to the problem."""

    def __init__(self, message: str, path: KeyPath = ()) -> None:
        self.path = path
        super().__init__(message)


class Draw(FrozenModel):
    """Values drawn at random. Only the seed and the key decide them: other keys change nothing."""

    key: ClassVar[str]
    bounding: ClassVar[str]
    """Advice for a sample outside the range of its key."""

    samples: Annotated[int, Field(ge=1, le=10_000, description="number of samples; the same for all drawn keys")]

    def drawn(self, generator: Random) -> tuple[float | str, ...]:
        """Return the samples, in the unit of the bounds."""
        first, second, unit = self.numbers
        numbers = (self._one(generator, first, second) for _ in range(self.samples))
        return tuple(f"{number!r} {unit}" if unit else number for number in numbers)

    @property
    def numbers(self) -> tuple[float, float, str]:
        """Return both figures in one unit: that of the second, or of the first if the second is a bare 0.

        Raises ValueError.
        """
        stated, bound = getattr(self, self.key)
        (first, unit), (second, other) = _number(stated), _number(bound)
        if unit == other or (unit and not other and second == 0):
            return first, second, unit
        if first == 0 and not unit:
            return first, second, other
        factor = units.conversion(unit, other) if unit and other else None
        if factor is None or not math.isfinite(first * factor):
            raise ValueError(
                f"both figures must have units of one dimension, or none; found {shown(stated)} and {shown(bound)}"
            )
        return first * factor, second, other

    def __str__(self) -> str:
        return f"{self.key}: [{', '.join(map(str, getattr(self, self.key)))}]"

    def _one(self, generator: Random, first: float, second: float) -> float:
        raise NotImplementedError


class Uniform(Draw):
    """A uniform distribution between two bounds."""

    key = "uniform"
    bounding = "choose bounds within the allowed range"

    uniform: Annotated[
        Bounds, Field(description="lower and upper bound: numbers, or quantities of one dimension; 0 needs no unit")
    ]

    @model_validator(mode="after")
    def _is_a_range(self) -> Self:
        low, high, _ = self.numbers
        if not low < high or not math.isfinite(high - low):
            raise ValueError("the first bound must be below the second")
        return self

    def _one(self, generator: Random, first: float, second: float) -> float:
        return float(first + (second - first) * generator.random())


class Normal(Draw):
    """A normal distribution."""

    key = "normal"
    bounding = "use 'uniform', which has bounds, or a smaller deviation"

    normal: Annotated[
        Bounds,
        Field(description="mean and standard deviation: numbers, or quantities of one dimension; 0 needs no unit"),
    ]

    @model_validator(mode="after")
    def _spreads(self) -> Self:
        if self.numbers[1] <= 0:
            raise ValueError("the standard deviation must be above 0")
        return self

    def _one(self, generator: Random, first: float, second: float) -> float:
        # Few scenarios draw from it, and this takes 3 ms to import.
        from statistics import NormalDist

        return float(first + second * NormalDist().inv_cdf(generator.random() or _LEAST))


DRAWS: Final[dict[str, type[Draw]]] = {draw.key: draw for draw in (Uniform, Normal)}
"""The key that tells one way to draw from the others."""

_EXPECTED: Final = "expected a list of values, or a draw such as {uniform: [0, 1], samples: 10}"


def value_list(key: str, stated: object, seed: int) -> ValueList:
    """Return the values of a key; `key` and `seed` decide random draws. Raises ValuesError."""
    if isinstance(stated, tuple) and stated:
        _refuse_twins(stated)
        return ValueList(stated)
    if not isinstance(stated, dict):
        raise ValuesError(f"{_EXPECTED}, found {shown(stated)}")
    ways = [way for way in DRAWS if way in stated]
    if len(ways) != 1:
        others = [name for name in stated if name not in DRAWS and name != "samples"]
        hint = did_you_mean(others[0], (*DRAWS, "samples")) if others else ""
        raise ValuesError(f"{_EXPECTED}{hint}")
    draw = _draw(DRAWS[ways[0]], stated)
    if key == SEED:
        return ValueList(_seeds(draw, _generator(key, seed)), _advice(draw), whole=True)
    return ValueList(draw.drawn(_generator(key, seed)), _advice(draw))


def _draw(model: type[Draw], stated: dict[str, object]) -> Draw:
    try:
        return model.model_validate(stated)
    except ValidationError as error:
        path, message = next(spec_errors(model, stated, error))
        raise ValuesError(message, path) from None


def sample_seed(seed: int, sample: int) -> int:
    """Return the seed of a sample, from the scenario's seed and the index of the sample alone."""
    return Random(f"sample {sample} of seed {seed}").getrandbits(_DRAWN_SEED_BITS)


def _seeds(draw: Draw, generator: Random) -> tuple[int, ...]:
    """Return different whole numbers; more samples keep the first ones. Raises ValuesError."""
    if not isinstance(draw, Uniform):
        example = "{uniform: [0, 1000000], samples: 20}"
        raise ValuesError(f"seeds are whole numbers: draw them with 'uniform', such as {example}", (draw.key,))
    low, high, unit = draw.numbers
    if unit or low < 0 or high > 2**_DRAWN_SEED_BITS or low % 1 or high % 1:
        raise ValuesError(f"the bounds of seeds must be whole numbers from 0 to {2**_DRAWN_SEED_BITS}", (draw.key,))
    size = int(high - low) + 1
    if draw.samples > size:
        message = f"{draw.samples} different seeds do not fit between {low:g} and {high:g}"
        raise ValuesError(f"{message}; choose wider bounds, such as [0, 1000000]", ("samples",))
    found: dict[int, None] = {}
    while len(found) < draw.samples:
        found[int(low) + int(size * generator.random())] = None
    return tuple(found)


def _advice(draw: Draw) -> str:
    return f"drawn from {draw}; {draw.bounding}"


def _generator(key: str, seed: int) -> Random:
    """Return Python's own generator: its numbers never change between versions, and `matrix` has no numpy."""
    return Random(f"variations {key} {seed}")


def _refuse_twins(values: tuple[object, ...]) -> None:
    seen: set[str] = set()
    for index, value in enumerate(values):
        if (written := repr(value)) in seen:
            raise ValuesError(f"{shown(value)} occurs twice", (index,))
        seen.add(written)


def _number(value: float | str) -> tuple[float, str]:
    found = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    number = float(found[1]) if found else math.nan if isinstance(value, str) else float(value)
    if not math.isfinite(number):
        raise ValueError(f"expected a finite number or quantity, found {shown(value)}")
    return number, found[2] if found else ""

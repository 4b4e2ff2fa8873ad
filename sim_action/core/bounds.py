"""What a key may be at the least and at the most, read from its field, in words with units."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any, Final, get_args

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from sim_action.core.quantities import Quantity

_DEGREE: Final = math.pi / 180
_BYTES: Final = ((2**30, "GiB"), (2**20, "MiB"), (1, "B"))
# From here on, commas help to count digits.
_LONG: Final = 10_000


def bound_text(value: float, unit: str) -> str:
    """A bound as people write it: all its digits, angles in degrees; of 0, no unit is needed."""
    number, unit = _written(value, unit)
    return f"{number} {unit}".rstrip() if value else "0"


def bounds_text(annotation: Any, metadata: Iterable[Any]) -> str:
    """Such as "at most 170 deg", or "1 to 1920"; nothing of what must only be positive, or no less than 0."""
    unit, found = unit_of(annotation, metadata), [*metadata, *_of_optional(annotation)]
    lower = next((item for item in found if isinstance(item, Gt | Ge) and _value(item)), None)
    upper = next((item for item in found if isinstance(item, Lt | Le)), None)
    if upper is None:
        word = "more than" if isinstance(lower, Gt) else "at least"
        return f"{word} {bound_text(_value(lower), unit)}" if lower else ""
    if lower is None:
        return f"{'less than' if isinstance(upper, Lt) else 'at most'} {bound_text(_value(upper), unit)}"
    return f"{_written(_value(lower), unit)[0]} to {bound_text(_value(upper), unit)}"


def unit_of(annotation: Any, metadata: Iterable[Any] = ()) -> str:
    """The SI unit of the first quantity in a field; "" if there is none, or it has several."""
    quantity = next((item for item in (*metadata, *_all_in(annotation)) if isinstance(item, Quantity)), None)
    return quantity.dimensions[0].si if quantity and len(quantity.dimensions) == 1 else ""


def _written(value: float, unit: str) -> tuple[str, str]:
    """A number and its unit."""
    if unit in ("rad", "rad/s"):
        value, unit = value / _DEGREE, unit.replace("rad", "deg")
    if unit == "B":
        value, unit = next((value / size, name) for size, name in _BYTES if value % size == 0)
    if float(value).is_integer():
        value = int(value)
        return f"{value:,}" if abs(value) >= _LONG else str(value), unit
    return f"{value:,.6g}", unit


def _value(item: Any) -> float:
    found: float = next(getattr(item, name) for name in ("gt", "ge", "lt", "le") if hasattr(item, name))
    return found


def _said_of(annotation: Any) -> Iterator[Any]:
    for item in getattr(annotation, "__metadata__", ()):
        yield from item.metadata if isinstance(item, FieldInfo) else (item,)


def _of_optional(annotation: Any) -> Iterator[Any]:
    """What is said of a type that may also be left out."""
    parts = [part for part in get_args(annotation) if part is not type(None)]
    if len(parts) == 1 and type(None) in get_args(annotation):
        yield from _said_of(parts[0])


def _all_in(annotation: Any) -> Iterator[Any]:
    """What is said anywhere in a type, such as of the entries of a list; not of what other models have."""
    yield from _said_of(annotation)
    for part in get_args(annotation):
        if not (isinstance(part, type) and issubclass(part, BaseModel)):
            yield from _all_in(part)

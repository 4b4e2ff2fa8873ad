"""Share the equal parts of similar frozen objects, such as the variations of a scenario, to save memory."""

from __future__ import annotations

import math
from functools import cache
from typing import Any, Final, TypeVar, cast

from sim_action.core.field_types import FrozenModel

Value = TypeVar("Value")
_PLAIN: Final = frozenset({str, int, bool, bytes, type(None)})


def share_parts(new: Value, previous: object) -> Value:
    """Return `new` with parts of `previous` in place of equal parts; `previous` itself if all parts are equal.

    Both are made of frozen models and records, tuples and plain values; of dictionaries, only empty ones are equal.
    A part is equal if all types and values are; 0.0 and -0.0 differ. `new` changes in place, so it must not be a
    dictionary or list that its owner changes.
    """
    if new is previous or type(new) is not type(previous):
        return new
    kind: type = type(new)
    if kind in _PLAIN:
        is_same = new == previous
    elif kind is float:
        is_same = new == previous and math.copysign(1.0, new) == math.copysign(1.0, previous)  # type: ignore[arg-type]  # floats
    elif kind is dict:
        is_same = not new and not previous
    elif kind is tuple:
        return cast(Value, _shared_tuple(cast(tuple[Any, ...], new), cast(tuple[Any, ...], previous)))
    elif isinstance(new, FrozenModel):
        is_same = _share_models(new, cast(FrozenModel, previous))
    elif names := _fields(kind):
        is_same = _share_fields(new, previous, names)
    else:
        return new
    return previous if is_same else new


def _shared_tuple(new: tuple[Any, ...], previous: tuple[Any, ...]) -> tuple[Any, ...]:
    if not new:
        return previous if not previous else new
    parts = tuple([share_parts(part, like) for part, like in zip(new, previous, strict=False)]) + new[len(previous) :]
    if len(new) == len(previous) and all(part is like for part, like in zip(parts, previous, strict=True)):
        return previous
    return parts if any(part is not before for part, before in zip(parts, new, strict=True)) else new


def _share_models(new: FrozenModel, previous: FrozenModel) -> bool:
    """Share the parts of a model; return True if all of them are equal."""
    values, like = new.__dict__, previous.__dict__
    is_same = len(values) == len(like)
    if new.__pydantic_fields_set__ == previous.__pydantic_fields_set__:
        object.__setattr__(new, "__pydantic_fields_set__", previous.__pydantic_fields_set__)
    else:
        is_same = False
    for name, value in values.items():
        if name in like:
            part = share_parts(value, like[name])
            if part is not value:
                values[name] = part
            is_same = is_same and part is like[name]
        else:
            is_same = False
    return is_same


def _share_fields(new: object, previous: object, names: tuple[str, ...]) -> bool:
    """Share the parts of a frozen record; return True if all of them are equal."""
    is_same = True
    for name in names:
        value, like = getattr(new, name), getattr(previous, name)
        part = share_parts(value, like)
        if part is not value:
            object.__setattr__(new, name, part)
        is_same = is_same and part is like
    return is_same


@cache
def _fields(kind: type) -> tuple[str, ...]:
    record = getattr(kind, "__record__", None)
    return tuple(record.fields) if record is not None and record.frozen else ()

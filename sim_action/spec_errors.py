"""pydantic's findings, as sentences for the person who wrote the file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, get_args

from pydantic import BaseModel, ValidationError

from sim_action.bounds import bound_text, unit_of
from sim_action.messages import did_you_mean, shown

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

_BOUNDS = ("gt", "ge", "lt", "le")
_EXPECTED = {
    "model_type": "a map of keys",
    "model_attributes_type": "a map of keys",
    "dict_type": "a map of keys",
    "tuple_type": "a list",
    "string_type": "text",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "is_instance_of": "a map of keys",
}

_SENTENCES = {
    "literal_error": "expected {expected}, found {found}",
    "greater_than": "must be greater than {gt}, found {found}",
    "greater_than_equal": "must be at least {ge}, found {found}",
    "less_than": "must be less than {lt}, found {found}",
    "less_than_equal": "must be at most {le}, found {found}",
    "too_long": "expected a list of {max_length}, found {found}",
    "too_short": "must not be empty",
    "string_too_short": "must not be empty",
    "string_too_long": "must have at most {max_length} characters",
}


def spec_errors(
    model: type[BaseModel], data: object, error: ValidationError
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Each finding about `data`, with the path of the key that it is about."""
    for details in error.errors(include_url=False):
        yield details["loc"], _sentence(model, details, _written(data, details))


def _written(data: Any, details: ErrorDetails) -> object:
    """The value as it was written: pydantic knows it in SI only."""
    try:
        for step in details["loc"]:
            data = data[step]
    except (LookupError, TypeError):
        return details["input"]
    return data


def _sentence(model: type[BaseModel], details: ErrorDetails, value: object) -> str:
    kind = details["type"]
    key = details["loc"][-1] if details["loc"] else ""
    if kind == "missing":
        # A list of a fixed length reports its entries as pydantic's models report their keys.
        return f"the list ends before entry {key + 1}" if isinstance(key, int) else f"the key '{key}' is missing"
    if kind == "extra_forbidden":
        return f"unknown key{did_you_mean(str(key), _keys_at(model, details['loc'][:-1]))}"
    if kind in _SENTENCES:
        return _SENTENCES[kind].format(found=shown(value), **_context(model, details))
    if kind in _EXPECTED:
        return f"expected {_EXPECTED[kind]}, found {shown(value)}{_hint(kind, value)}"
    return details["msg"].removeprefix("Value error, ")


def _context(model: type[BaseModel], details: ErrorDetails) -> dict[str, Any]:
    """What a sentence names, bounds with the unit of the key."""
    unit = _unit_at(model, details["loc"])
    named = details.get("ctx", {})
    return {key: bound_text(value, unit) if key in _BOUNDS else value for key, value in named.items()}


def _hint(kind: str, value: object) -> str:
    if kind == "string_type" and isinstance(value, (bool, int, float)):
        return "; put it in quotes"
    return "; begin each entry of a list with '- '" if kind == "tuple_type" and isinstance(value, dict) else ""


def _unit_at(model: type[BaseModel], path: tuple[str | int, ...]) -> str:
    at: Any = model
    unit = ""
    for step in path:
        fields = {field.alias or name: field for name, field in _fields(at).items()}
        if isinstance(step, str) and step in fields:
            at = fields[step].annotation
            unit = unit_of(at, fields[step].metadata)
    return unit


def _keys_at(model: type[BaseModel], path: tuple[str | int, ...]) -> list[str]:
    """The keys that are allowed at a path."""
    at: Any = model
    for step in path:
        names = {field.alias or name: field.annotation for name, field in _fields(at).items()}
        at = names.get(step, at) if isinstance(step, str) else at
    return [field.alias or name for name, field in _fields(at).items()]


def _fields(annotation: Any) -> dict[str, Any]:
    """The fields of the first model in an annotation such as `tuple[Body, ...] | None`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return dict(annotation.model_fields)
    return next((found for part in get_args(annotation) if (found := _fields(part))), {})

"""The errors of a YAML file: collected, each with its line and column, and pydantic's findings as sentences."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from sim_action.core.errors import InvalidScenario, Problem
from sim_action.core.field_types import bound_text, unit_of
from sim_action.core.wording import FirstFew, did_you_mean, shown
from sim_action.core.yaml_document import Document, KeyPath

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


# The keys that lead to a problem in a scenario, and its message.
SpecProblem = tuple[tuple[str | int, ...], str]
SpecProblems = Iterator[SpecProblem]


class ProblemList:
    """A list of problems in one document; each problem is kept once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._problems: dict[tuple[KeyPath, str], Problem] = {}

    def __bool__(self) -> bool:
        return bool(self._problems)

    def note(self, path: KeyPath, message: str) -> None:
        """Add a problem at the keys `path`."""
        self._problems.setdefault((path, message), self._document.problem(path, message))

    def note_all(self, path: KeyPath, problems: SpecProblems) -> None:
        """Add problems of the part of the document at `path`."""
        for below, message in problems:
            self.note((*path, *below), message)

    def note_elsewhere(self, problem: Problem) -> None:
        """Add a problem in another file."""
        self._problems.setdefault(((problem.location.file,), str(problem)), problem)

    def has_below(self, path: KeyPath) -> bool:
        """Return True if there is a problem at a place below `path`."""
        return any(len(noted) > len(path) and noted[: len(path)] == path for noted, _ in self._problems)

    def error(self) -> InvalidScenario:
        """Return all problems as one error, those of the document first, in the order of its lines."""
        return InvalidScenario(sorted(self._problems.values(), key=self._place))

    def _place(self, problem: Problem) -> tuple[bool, int, int]:
        where = problem.location
        return where.file != self._document.file, where.line or 0, where.column or 0


# Text that needs no quotes in a YAML list.
_PLAIN: Final = re.compile(r"[A-Za-z_][\w./*-]*")
_BAD_KEY: Final = "[key]"
_BOUNDS = ("gt", "ge", "lt", "le")
_EXPECTED = {
    "model_type": "a map of keys",
    "model_attributes_type": "a map of keys",
    "dict_type": "a map of keys",
    "tuple_type": "a list",
    "string_type": "text",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "float_type": "a number",
    "is_instance_of": "a map of keys",
}

_SENTENCES = {
    "literal_error": "expected {expected}, found {found}",
    "greater_than": "must be greater than {gt}, found {found}",
    "greater_than_equal": "must be at least {ge}, found {found}",
    "less_than": "must be less than {lt}, found {found}",
    "less_than_equal": "must be at most {le}, found {found}",
    "string_pattern_mismatch": "expected text that matches {pattern}, found {found}",
    "too_long": "expected a list of {max_length}, found {found}",
    "too_short": "expected a list of at least {min_length}, found {found}",
    "string_too_short": "must have at least {min_length} characters, found {found}",
    "string_too_long": "must have at most {max_length} characters",
}


def spec_errors(
    model: type[BaseModel], data: object, error: ValidationError
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Yield each finding of pydantic about `data` as a sentence, with the path of its key."""
    hinted = FirstFew()
    for details in error.errors(include_url=False):
        # pydantic adds a step to the path of a bad key, which the file does not have.
        path = details["loc"][:-1] if details["loc"][-1:] == (_BAD_KEY,) else details["loc"]
        yield path, _sentence(model, details, _written(data, details), hinted)


def _written(data: Any, details: ErrorDetails) -> object:
    """Return the value as it is written in the file; pydantic knows only its SI value."""
    try:
        for step in details["loc"]:
            data = data[step]
    except (LookupError, TypeError):
        return details["input"]
    return data


def _sentence(model: type[BaseModel], details: ErrorDetails, value: object, hinted: FirstFew) -> str:
    kind = details["type"]
    key = details["loc"][-1] if details["loc"] else ""
    if kind == "missing":
        # pydantic reports missing entries of a list with a fixed length like missing keys.
        return f"entry {key + 1} of the list is missing" if isinstance(key, int) else f"the key '{key}' is missing"
    if kind == "extra_forbidden":
        hint = did_you_mean(str(key), _keys_at(model, details["loc"][:-1])) if hinted.one_more() else ""
        return f"unknown key{hint}"
    if details.get("ctx", {}).get("min_length") == 1:
        return "must not be empty"
    if kind in _SENTENCES:
        return _SENTENCES[kind].format(found=shown(value), **_context(model, details))
    if kind in _EXPECTED:
        # The key of an entry of a list has the type of the list.
        in_list = isinstance(key, int)
        hint = _hint(kind, value, _annotation_at(model, details["loc"]), in_list=in_list)
        return f"expected {_EXPECTED[kind]}, found {shown(value)}{hint}"
    return details["msg"].removeprefix("Value error, ")


def _context(model: type[BaseModel], details: ErrorDetails) -> dict[str, Any]:
    unit = _unit_at(model, details["loc"])
    named = details.get("ctx", {})
    return {key: bound_text(value, unit) if key in _BOUNDS else value for key, value in named.items()}


def _hint(kind: str, value: object, annotation: Any, *, in_list: bool) -> str:
    if kind == "string_type" and isinstance(value, (bool, int, float)):
        return "; put it in quotes"
    if kind != "tuple_type":
        return ""
    if isinstance(value, str) and _PLAIN.fullmatch(value) and not in_list and _takes_any_number(annotation):
        return f"; write [{value}]"
    return "; begin each entry of a list with '- '" if isinstance(value, dict) else ""


def _takes_any_number(annotation: Any) -> bool:
    return Ellipsis in get_args(annotation) or any(map(_takes_any_number, get_args(annotation)))


def _unit_at(model: type[BaseModel], path: tuple[str | int, ...]) -> str:
    last = list(_fields_along(model, path))[-1:]
    return unit_of(last[0].annotation, last[0].metadata) if last else ""


def _annotation_at(model: type[BaseModel], path: tuple[str | int, ...]) -> Any:
    last = list(_fields_along(model, path))[-1:]
    return last[0].annotation if last else model


def _keys_at(model: type[BaseModel], path: tuple[str | int, ...]) -> list[str]:
    return [field.alias or name for name, field in _fields(_annotation_at(model, path)).items()]


def _fields_along(model: type[BaseModel], path: tuple[str | int, ...]) -> Iterator[FieldInfo]:
    """Yield the fields of models along a path."""
    at: Any = model
    for step in path:
        fields = {field.alias or name: field for name, field in _fields(at).items()}
        if isinstance(step, str) and step in fields:
            at = fields[step].annotation
            yield fields[step]


def _fields(annotation: Any) -> dict[str, FieldInfo]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return dict(annotation.model_fields)
    return next((found for part in get_args(annotation) if (found := _fields(part))), {})

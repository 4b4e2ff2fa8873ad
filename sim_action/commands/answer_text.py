"""A line that a program answered -> a command. Strict: what would be guessed at is an error for the person."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from typing import Any, Final, NoReturn

from sim_action.command import Command, JointTargets
from sim_action.geometry import Twist
from sim_action.messages import did_you_mean, shown

_TARGETS: Final = ("position", "velocity", "effort", "max_effort")
_SPEEDS: Final = ("linear", "angular", "lateral")


class AnswerError(ValueError):
    """Why a line is no answer."""


def command_of(line: bytes) -> Command | None:
    """The command in an answer; None if it leaves the last one standing. Raises AnswerError."""
    answer = _object(_value(line), "the answer")
    if "twist" in answer:
        if targets := [key for key in _TARGETS if key in answer]:
            raise AnswerError(f"has both 'twist' and '{targets[0]}': an answer is one command")
        _check_keys(answer, ("twist",), "the answer")
        return _twist(answer["twist"])
    _check_keys(answer, ("twist", *_TARGETS), "the answer")
    position, velocity, effort, max_effort = (_numbers(answer.get(key, {}), key) for key in _TARGETS)
    return JointTargets(position, velocity, effort, max_effort) if answer else None


def is_acknowledgement(line: bytes) -> bool:
    """Whether an answer commands nothing. Raises AnswerError."""
    return command_of(line) is None


def _value(line: bytes) -> Any:
    try:
        return json.loads(line, object_pairs_hook=_without_duplicates, parse_constant=_refuse_constant)
    except UnicodeDecodeError:
        raise AnswerError("is not UTF-8 text") from None
    except json.JSONDecodeError as error:
        raise AnswerError(f"is not JSON: {error.msg} (column {error.colno})") from None
    except RecursionError:
        raise AnswerError("is nested too deep") from None
    except AnswerError:
        raise
    except ValueError as error:  # such as a whole number of thousands of digits
        raise AnswerError(f"cannot be read: {error}") from None


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise AnswerError(f"has the key {shown(name)} twice")
        found[name] = value
    return found


def _refuse_constant(name: str) -> NoReturn:
    raise AnswerError(f"has {name}, which is no number that a motor can be given (nor JSON)")


def _object(value: Any, where: str) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise AnswerError(f"{where} is {_found(value)}; expected an object, such as {{}}")
    return value


def _check_keys(found: Mapping[str, Any], allowed: Collection[str], where: str) -> None:
    for key in found:
        if key not in allowed:
            raise AnswerError(f"{where} has the unknown key {shown(key)}{did_you_mean(key, allowed)}")


def _twist(value: Any) -> Twist:
    speeds = _numbers(value, "twist")
    _check_keys(speeds, _SPEEDS, "'twist'")
    return Twist.planar(speeds.get("linear", 0.0), speeds.get("angular", 0.0), lateral=speeds.get("lateral", 0.0))


def _numbers(value: Any, where: str) -> dict[str, float]:
    if not isinstance(value, dict):
        raise AnswerError(f"'{where}' is {_found(value)}; expected an object of numbers by name")
    return {name: _number(number, f"'{where}.{name}'") for name, number in value.items()}


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise AnswerError(f"{where} is {_found(value)}; expected a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise AnswerError(f"{where} is too large a number")
    return number


def _found(value: Any) -> str:
    return "null" if value is None else "an object" if isinstance(value, dict) else shown(value)

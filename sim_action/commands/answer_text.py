"""A line that a program answered -> a command. Strict: what would be guessed at is an error for the person."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from typing import Any, Final, NoReturn

from sim_action.core.geometry import Twist
from sim_action.core.messages import did_you_mean, shown
from sim_action.state.command import Answer, Command, JointTargets

_TARGETS: Final = ("position", "velocity", "effort", "max_effort")
_SPEEDS: Final = ("linear", "angular", "lateral")


class AnswerError(ValueError):
    """Why a line is no answer; "it" is the line."""


def answer_of(line: bytes) -> Answer:
    """What an answer commands; None if it leaves the last command standing. Raises AnswerError."""
    found = _object(_value(line))
    _check_keys(found, ("twist", *_TARGETS), "it")
    commands: list[Command] = [_twist(found["twist"])] if "twist" in found else []
    if any(key in found for key in _TARGETS):
        position, velocity, effort, max_effort = (_numbers(found.get(key, {}), key) for key in _TARGETS)
        commands.append(JointTargets(position, velocity, effort, max_effort))
    return tuple(commands) if len(commands) > 1 else next(iter(commands), None)


def is_acknowledgement(line: bytes) -> bool:
    """Whether an answer commands nothing. Raises AnswerError."""
    return answer_of(line) is None


def _value(line: bytes) -> Any:
    try:
        return json.loads(line, object_pairs_hook=_without_duplicates, parse_constant=_refuse_constant)
    except UnicodeDecodeError:
        raise AnswerError("it is not UTF-8 text") from None
    except json.JSONDecodeError as error:
        raise AnswerError(f"it is not JSON: {error.msg} (column {error.colno})") from None
    except RecursionError:
        raise AnswerError("it is nested too deep") from None
    except AnswerError:
        raise
    except ValueError as error:  # such as a whole number of thousands of digits
        raise AnswerError(f"it cannot be read: {error}") from None


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise AnswerError(f"it has the key {shown(name)} twice")
        found[name] = value
    return found


def _refuse_constant(name: str) -> NoReturn:
    raise AnswerError(f"it has {name}, which is no number that a motor can be given (nor JSON)")


def _object(value: Any) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise AnswerError(f"it is {_found(value)}; expected an object, such as {{}}")
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

"""The examples of an assertion that the tests of all assertions take from its own test file.

`SPECS` there are examples; `LIMITS` and `GOALS` say how to tighten it. Many assertions have theirs in the tables of the
common tests instead.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Final

from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.state.trace import Trace

FAR: Final = 1e3  # a limit, in SI units, that no random trace comes near


@dataclass(frozen=True)
class Limit:
    """An assertion with a limit that is not exceeded."""

    of: Callable[[float], Assertion]  # returns the assertion with a limit
    loose: float = FAR  # a limit that holds on each random trace
    least: bool = False  # True if greater values are allowed


@dataclass(frozen=True)
class Extreme:
    """A goal with a limit, and the extreme of its quantity over a whole run, by other means than the monitor's."""

    of: Callable[[float], Assertion]  # returns the assertion with a limit
    extreme: Callable[[Trace], float]  # the value that decides, in SI units; infinite if there is none
    least: bool = False  # True if the goal is met by values that are at most its limit


def of_own_tests(name: str, known: Collection[str]) -> Mapping[str, list[Any]]:
    """Return the list `name` of tests/assertions/test_KEY.py for each assertion KEY that is not `known`."""
    keys = [key for key in ASSERTIONS if key not in known]
    return {key: getattr(import_module(f"tests.assertions.test_{key}"), name) for key in keys}


def further_specs(known: Collection[Assertion]) -> list[Assertion]:
    """Return the examples of all assertions without `known` ones; those that need a file are tested alone."""
    keys = {spec.key for spec in known}
    return [spec for specs in of_own_tests("SPECS", {*keys, "assertion", "matches"}).values() for spec in specs]

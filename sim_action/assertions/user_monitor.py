"""The fold around a class of the user's, which need not be one: it keeps the trace and asks about the whole of it."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal, Self, get_args

import numpy as np

from sim_action.assertions import State
from sim_action.assertions.history import History
from sim_action.core.errors import Location, ScriptError
from sim_action.core.messages import escaped_line, shown, with_article
from sim_action.core.user_scripts import run_file, script_error, told_at
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict

Kind = Literal["end", "invariant", "goal"]

_BEGINNING: Final = {"end": State.HOLDS, "invariant": State.HOLDS, "goal": State.PENDING}


@dataclass(frozen=True, slots=True, eq=False)
class Judge:
    """An object of the user's class; raises ScriptError where that does, or answers nonsense."""

    path: Path
    name: str
    kind: Kind
    made: Any

    @classmethod
    def load(cls, path: Path, name: str, settings: Mapping[str, Any]) -> Self:
        """Runs the file, and makes the object."""
        found = run_file(path, f"the file of {name}").get(name)
        where = Location(str(path))
        with told_at(path, name):
            judge = getattr(found, "judge", None)
            kind: Kind = getattr(found, "kind", "end")
        if not isinstance(found, type) or not callable(judge):
            raise ScriptError(f"{name} is no class with a method judge(self, trace)", where)
        if kind not in get_args(Kind):
            raise ScriptError(f"{name}.kind is {kind!r}; it is one of {', '.join(get_args(Kind))}", where)
        with told_at(path, f"{name}(...), made with its settings,"):
            made = found(**settings)
        return cls(path, name, kind, made)

    def verdict(self, trace: Trace) -> Verdict:
        """What it says of a trace."""
        with told_at(self.path, f"{self.name}.judge()"):
            answer = self.made.judge(trace)
        try:
            return _plain(answer)
        except TypeError as error:
            code = getattr(type(self.made).judge, "__code__", None)
            line = None if code is None or code.co_filename != str(self.path) else code.co_firstlineno
            message = escaped_line(f"{self.name}.judge() returned {error}")
            raise ScriptError(message, Location(str(self.path), line)) from None
        except Exception as error:  # noqa: BLE001 - numbers and texts of the user's own kinds may raise anything
            raise script_error(error, self.path, f"what {self.name}.judge() returned") from None


def _plain(answer: object) -> Verdict:
    """A verdict as reports take it: numpy's numbers are made Python's. Raises TypeError, which says what else it is."""
    if not isinstance(answer, Verdict):
        raise TypeError(f"{with_article(type(answer).__name__)}; it returns a sim_action.Verdict")
    if not isinstance(answer.passed, bool | np.bool_):
        raise TypeError(f"a Verdict whose 'passed' is {answer.passed!r}; it is True or False")
    if not isinstance(answer.unit, str) or not isinstance(answer.message, str):
        raise TypeError("a Verdict whose 'unit' or 'message' is no text")
    names = ("measured", "limit", "margin", "time")
    measured, limit, margin, time = (_number(name, getattr(answer, name)) for name in names)
    message = escaped_line(answer.message) or ("holds" if answer.passed else "does not hold")
    return Verdict(bool(answer.passed), measured, limit, margin, escaped_line(answer.unit), time, message)


def _number(name: str, value: object) -> float | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, numbers.Real) or not _is_finite(value):
        raise TypeError(f"a Verdict whose '{name}' is {shown(value)}; it is a finite number or None")
    return float(value)


def _is_finite(value: numbers.Real) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number that no float can hold
        return False


@dataclass(frozen=True, slots=True, eq=False)
class UserMonitor:
    """Keeps every step, and asks the judge about all of them; what it has once said of a goal that came true stands.

    Attributes:
        decided: the verdict by which a goal came true, or an invariant was broken.
    """

    judge: Judge
    seen: History | None = None
    decided: Verdict | None = None

    @classmethod
    def opened(cls, path: Path, name: str, settings: Mapping[str, Any]) -> Self:
        """The fold before the first moment. Raises ScriptError."""
        return cls(Judge.load(path, name, settings))

    @property
    def state(self) -> State:
        """See Monitor.state."""
        if self.decided is None:
            return _BEGINNING[self.judge.kind]
        return State.HOLDS if self.decided.passed else State.BROKEN

    @property
    def is_decided(self) -> bool:
        """See Decisive.is_decided."""
        return self.decided is not None

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if self.decided is not None or not len(trace):
            return self
        later = replace(self, seen=History.of(trace) if self.seen is None else self.seen.followed_by(trace))
        if self.judge.kind == "end":
            return later
        verdict = later.verdict()
        return replace(later, decided=verdict) if verdict.passed == (self.judge.kind == "goal") else later

    def verdict(self) -> Verdict:
        """See Monitor.verdict."""
        if self.decided is not None:
            return self.decided
        if self.seen is None:
            return Verdict(passed=False, message="no moment to measure")
        return self.judge.verdict(self.seen.whole())

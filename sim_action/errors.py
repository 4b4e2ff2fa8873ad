"""Every error that sim-action raises on purpose, and the exit code that goes with it.

    SimActionError                3    a fault of sim-action itself, unless a subclass says otherwise
    ├── UsageError                2    the command line asks for something that cannot be done
    ├── InvalidScenario           2    a scenario cannot be run as it is written
    ├── ModelError                2    a robot model cannot be read
    ├── NoScenarioFound           5    the paths given hold no scenario
    └── RunError                  1    a valid scenario ran into something that leaves it without a verdict
        ├── EngineError                the physics engine refused the world
        ├── SimulationUnstable         the simulated state is no longer physics
        └── ScriptError                the user's controller raised or answered nonsense

Exit code 0 is a run in which all scenarios passed, 130 one that was interrupted.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum


class ExitCode(IntEnum):
    """What the process says to its caller."""

    PASSED = 0
    FAILED = 1
    INVALID = 2
    INTERNAL = 3
    NO_SCENARIO = 5
    INTERRUPTED = 130


@dataclass(frozen=True, slots=True)
class Location:
    """A place in a file of the user's; line and column count from 1, None where only the file is known."""

    file: str
    line: int | None = None
    column: int | None = None

    def __str__(self) -> str:
        return ":".join(str(part) for part in (self.file, self.line, self.column) if part is not None)


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that its reader has to mend: where it is, what was found, what is allowed, what to do."""

    location: Location
    message: str

    def __str__(self) -> str:
        return f"{self.location}: {self.message}"


class SimActionError(Exception):
    """The root of the tree."""

    exit_code = ExitCode.INTERNAL


class UsageError(SimActionError):
    """The command line asks for something that cannot be done."""

    exit_code = ExitCode.INVALID


class InvalidScenario(SimActionError):
    """A scenario that cannot be run, with everything that is wrong with it."""

    exit_code = ExitCode.INVALID

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class ModelError(SimActionError):
    """A robot model that cannot be read; `location` is in the model's own file, where there is one."""

    exit_code = ExitCode.INVALID

    def __init__(self, message: str, location: Location | None = None) -> None:
        self.location = location
        super().__init__(f"{location}: {message}" if location else message)


class NoScenarioFound(SimActionError):
    """The paths given hold no scenario."""

    exit_code = ExitCode.NO_SCENARIO


class RunError(SimActionError):
    """A valid scenario ran into something that leaves it without a verdict."""

    exit_code = ExitCode.FAILED

    def __init__(self, message: str, location: Location | None = None) -> None:
        self.location = location
        super().__init__(message)


class EngineError(RunError):
    """The physics engine refused the world."""


class SimulationUnstable(RunError):
    """The simulated state is no longer physics."""


class ScriptError(RunError):
    """The user's controller raised, or answered something that is not a command."""


def one_line(text: str) -> str:
    """Text as a message may hold it: what would break the line or act on a terminal is escaped, and it ends."""
    safe = "".join(char if char.isprintable() else repr(char)[1:-1] for char in text[:_LONGEST_MESSAGE])
    return safe if len(text) <= _LONGEST_MESSAGE else f"{safe}..."


def shown(value: object) -> str:
    """A value of a user's file as a message quotes it."""
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return "a map of keys"
    if isinstance(value, (tuple, list)):
        return f"a list of {len(value)}"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 3]}..."


_LONGEST_MESSAGE = 2000
_LONGEST_VALUE = 60


def did_you_mean(found: str, allowed: Iterable[str]) -> str:
    """The end of an error message: the nearest allowed name, if one is near, then all of them."""
    names = sorted(allowed)
    near = difflib.get_close_matches(found, names, n=1)
    hint = f"; did you mean '{near[0]}'?" if near else ""
    return f"{hint} (allowed: {', '.join(names) or 'none'})"

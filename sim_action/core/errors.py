"""Every error that sim-action raises on purpose, and the exit code that goes with it.

    SimActionError                3    a fault of sim-action itself, unless a subclass says otherwise
    ├── Fault                          one that was met while one scenario was looked at
    ├── UsageError                2    the command line asks for something that cannot be done
    ├── InvalidScenario           2    a scenario cannot be run as it is written
    ├── ModelError                2    a robot model cannot be read
    │   └── RefusedModel               a model file with what has to change in it
    ├── SourceProblem             2    a command source cannot be opened as it is written
    │   └── RecordingError             a recorded log cannot be replayed
    └── RunError                  1    a valid scenario ran into something that leaves it without a verdict
        ├── EngineError                the physics engine refused the world
        ├── BadStart                   the robot cannot begin where the scenario puts it
        ├── BadSource             2    a command source cannot give what the scenario asks it for
        ├── SimulationUnstable         the simulated state is no longer physics
        ├── SourceOver                 nobody is left who would command the robot: the run is over, and is judged
        └── ScriptError                code of the user's raised or answered nonsense

Exit code 0 is a run in which all scenarios passed, 5 one that found none, 130 one that was interrupted.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from collections.abc import Iterable


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


class ExitCode(IntEnum):
    """What the process says to its caller."""

    PASSED = 0
    FAILED = 1
    INVALID = 2
    INTERNAL = 3
    NO_SCENARIO = 5
    INTERRUPTED = 130


class SimActionError(Exception):
    """The root of the tree."""

    exit_code = ExitCode.INTERNAL


class Fault(SimActionError):
    """A fault of sim-action that was met while one scenario was looked at; `details`: the way that led to it."""

    def __init__(self, message: str, details: str = "") -> None:
        self.details = details
        super().__init__(message)

    @classmethod
    def of(cls, error: Exception) -> Self:
        """What to say of an exception that nobody expected."""
        from traceback import format_exception

        what = f"an internal error of sim-action: {type(error).__name__}: {error}; please report it"
        return cls(what, "".join(format_exception(error)))


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


class RefusedModel(ModelError):
    """A model file that no engine should see, with everything that is wrong with it."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))
        self.location = self.problems[0].location


class SourceProblem(SimActionError):
    """A command source that cannot be opened as it is written; `key` is its own that asks for what is not there."""

    exit_code = ExitCode.INVALID

    def __init__(self, message: str, key: str) -> None:
        self.key = key
        super().__init__(message)


class RecordingError(SourceProblem):
    """A recorded log that cannot be replayed."""

    def __init__(self, message: str, key: str = "replay") -> None:
        super().__init__(message, key)


class RunError(SimActionError):
    """A valid scenario ran into something that leaves it without a verdict.

    Attributes:
        location: where in the user's own code it was.
        keys: those of the scenario that lead to what to change; None: nobody can tell.
    """

    exit_code = ExitCode.FAILED

    def __init__(
        self, message: str, location: Location | None = None, *, keys: tuple[str | int, ...] | None = None
    ) -> None:
        self.location = location
        self.keys = keys
        super().__init__(message)


class EngineError(RunError):
    """The physics engine refused the world."""


class BadStart(RunError):
    """The robot cannot begin where the scenario puts it; each problem has the keys that lead to what to change."""

    exit_code = ExitCode.INVALID

    def __init__(self, problems: Iterable[tuple[tuple[str | int, ...], str]]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(message for _, message in self.problems))


class BadSource(RunError):
    """A command source whose files are not what the scenario says, which nobody could know before it was opened.

    Attributes:
        index: its place among the scenario's commands.
        key: its own key to what has to change.
    """

    exit_code = ExitCode.INVALID

    def __init__(self, index: int, key: str, message: str) -> None:
        self.index = index
        self.key = key
        super().__init__(message)


class SimulationUnstable(RunError):
    """The simulated state is no longer physics."""


class ScriptError(RunError):
    """Code of the user's raised, or answered neither command nor verdict.

    Attributes:
        details: its last words, or the way through it that led to the error.
        source: which of the scenario's commands it is of, by its place; None: of none.
        time: when that was asked, in s of sim time; None: before the run.
    """

    def __init__(self, message: str, location: Location | None = None, details: str = "") -> None:
        self.details = details
        self.source: int | None = None
        self.time: float | None = None
        super().__init__(message, location)

    def __str__(self) -> str:
        when = "" if self.time is None else f"at {self.time:.6g} s of sim time, "
        return f"{when}{super().__str__()}"


class SourceOver(RunError):
    """Nobody is left who would command the robot: the run ends here, and what was simulated is judged."""

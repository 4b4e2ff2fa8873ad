"""All errors that sim-action raises on purpose, their exit codes, and the place in a file that a message names.

    SimActionError                3    an internal error of sim-action, unless a subclass says otherwise
    ├── InternalError                  an internal error while one scenario was handled
    │   ├── SystemRefusal         1    the system lacks open files, memory or space
    │   └── PackageFault          1    an assertion or a sensor of an installed package raised an exception
    ├── UsageError                2    the command line asks for something that is not possible
    ├── InvalidScenario           2    a scenario cannot be run as it is written
    │   └── MissingScenario            no file or folder has the name of the scenario
    ├── ModelError                2    a robot model cannot be read
    │   └── RefusedModel               a model file with problems that must be fixed first
    ├── FileProblem               2    a file that an expectation needs cannot be read
    ├── SourceProblem             2    a command source cannot be opened as it is written
    │   └── RecordingError             a recorded log cannot be replayed
    └── RunError                  1    a valid scenario ended without a verdict
        ├── EngineError                the physics engine refused the world
        ├── BadStart              2    the robot cannot start where the scenario puts it, or without a file
        ├── BadSource             2    the files of a command source do not fit the scenario
        ├── SimulationUnstable         the simulated state is no longer physically possible
        ├── MissedContact              a body passed through another between two physics steps
        ├── ControllersFinished        all controllers have finished: the run ends and is judged
        └── ScriptError                user code raised an exception, or returned an invalid value

Exit code 0: all scenarios passed; 5: no scenario was found; 130: the run was interrupted.
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import ClassVar, Final, Literal

from sim_action.core.records import dataclass
from sim_action.core.wording import system_reason


@dataclass(frozen=True, slots=True)
class Location:
    """A place in a file of the user; line and column count from 1, and are None where only the file is known."""

    file: str
    line: int | None = None
    column: int | None = None

    def __str__(self) -> str:
        return ":".join(str(part) for part in (self.file, self.line, self.column) if part is not None)


@dataclass(frozen=True, slots=True)
class Problem:
    """One problem to fix: its place, and a message that states the problem, the allowed values and the remedy."""

    location: Location
    message: str

    def __str__(self) -> str:
        return f"{self.location}: {self.message}"


class ExitCode(IntEnum):
    """The exit codes of the command line."""

    PASSED = 0
    FAILED = 1
    INVALID = 2
    INTERNAL = 3
    NO_SCENARIO = 5
    INTERRUPTED = 130

    @classmethod
    def of_command(
        cls,
        parts: Iterable[int] = (),
        *,
        is_interrupted: bool = False,
        has_scenarios: bool = True,
        has_failed: bool = False,
    ) -> ExitCode:
        """Decide the exit code of a command: the first of 130, 3, 2 and 1 that applies, else 0.

        Args:
            parts: the exit codes of its scenarios, files and reports.
            is_interrupted: the command was interrupted; its parts do not count.
            has_scenarios: False if it found none and has no parts: the code is 5.
            has_failed: the command fails for a reason that no part has.
        """
        if is_interrupted:
            return cls.INTERRUPTED
        codes = [*parts, *([cls.FAILED] if has_failed else [])]
        return cls(max(codes, default=cls.PASSED if has_scenarios else cls.NO_SCENARIO))


class SimActionError(Exception):
    """The base class of all errors."""

    exit_code = ExitCode.INTERNAL
    # what to fix, each with its place; empty if no file of the user is known to be at fault
    problems: tuple[Problem, ...] = ()

    def __reduce__(self) -> tuple[Callable[..., SimActionError], tuple[object, ...]]:
        """Pickle the error as it is: subclasses take other arguments than its message."""
        return _unpickled, (type(self), self.args, self.__dict__)


def _unpickled(kind: type[SimActionError], arguments: tuple[object, ...], state: dict[str, object]) -> SimActionError:
    error = kind.__new__(kind, *arguments)
    error.__dict__.update(state)
    return error


class InternalError(SimActionError):
    """An internal error while sim-action handled one scenario; `kind`, `title`: in reports; `details`: traceback."""

    kind: ClassVar[Literal["internal", "crash", "script"]] = "internal"
    title: ClassVar[str] = "internal error"

    def __init__(self, message: str, details: str = "") -> None:
        self.details = details
        super().__init__(message)

    @classmethod
    def of(cls, error: Exception) -> InternalError:
        """Return the error that reports an unexpected exception, by its cause: the system, a package, or us."""
        if is_refusal(error):
            return SystemRefusal(error)
        from traceback import format_exception  # only an error needs it

        from sim_action.core.registry import blame  # only an error needs it

        details = "".join(format_exception(error))
        if (fault := blame(error)) is not None:
            return PackageFault(fault.message, details, fault.name)
        return cls(f"an internal error of sim-action: {type(error).__name__}: {error}; please report it", details)


class PackageFault(InternalError):
    """An assertion or a sensor of an installed package raised an exception; `part`: its name in scenarios."""

    exit_code = ExitCode.FAILED
    kind = "script"
    title = "package error"

    def __init__(self, message: str, details: str, part: str) -> None:
        self.part = part
        super().__init__(message, details)


class SystemRefusal(InternalError):
    """The system lacks something that every program needs, such as open files or memory: sim-action is not at fault."""

    exit_code = ExitCode.FAILED
    kind = "crash"
    title = "system error"

    def __init__(self, error: Exception) -> None:
        place = f": {error.filename}" if isinstance(error, OSError) and error.filename is not None else ""
        reason = "out of memory" if isinstance(error, MemoryError) else system_reason(error)
        super().__init__(f"the system refused a request: {reason}{place}")


def is_refusal(error: Exception) -> bool:
    """Return True if the system lacks something that every program needs."""
    return isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno in _REFUSALS)


# Windows lacks some of these names.
_REFUSALS: Final = {
    getattr(errno, name, None)
    for name in ("EMFILE", "ENFILE", "ENOMEM", "ENOSPC", "EDQUOT", "EAGAIN", "EIO", "EROFS", "ENOBUFS")
} - {None}


class UsageError(SimActionError):
    """The command line asks for something that is not possible."""

    exit_code = ExitCode.INVALID


class InvalidScenario(SimActionError):
    """A scenario that cannot be run, with all of its problems."""

    exit_code = ExitCode.INVALID

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class InvalidPart(InvalidScenario, ValueError):
    """A part that a program has built with invalid values; a validator of pydantic may raise it as a ValueError."""


class MissingScenario(InvalidScenario):
    """The name of a scenario file or folder that does not exist; the place of its problem is where the name stands."""


class ModelError(SimActionError):
    """A robot model that cannot be read; `location` is a place in the file of the model, if one is known."""

    exit_code = ExitCode.INVALID

    def __init__(self, message: str, location: Location | None = None) -> None:
        self.location = location
        super().__init__(f"{location}: {message}" if location else message)


class RefusedModel(ModelError):
    """A model file that must not be simulated, with all of its problems."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))
        self.location = self.problems[0].location


class FileProblem(SimActionError):
    """A file that an expectation needs cannot be read, or is damaged; the message names it."""

    exit_code = ExitCode.INVALID


class SourceProblem(SimActionError):
    """A command source that cannot be opened; `key` is its key that names something missing or invalid."""

    exit_code = ExitCode.INVALID

    def __init__(self, message: str, key: str) -> None:
        self.key = key
        super().__init__(message)


class RecordingError(SourceProblem):
    """A recorded log that cannot be replayed."""

    def __init__(self, message: str, key: str = "replay") -> None:
        super().__init__(message, key)


class RunError(SimActionError):
    """A valid scenario without a verdict, with the place in user code, and the keys that lead to the cause."""

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
    """The scenario cannot start; `by_keys`: the keys and message of each cause; `elsewhere`: in other files."""

    exit_code = ExitCode.INVALID

    def __init__(
        self, problems: Iterable[tuple[tuple[str | int, ...], str]], elsewhere: Iterable[Problem] = ()
    ) -> None:
        self.by_keys = tuple(problems)
        self.elsewhere = tuple(elsewhere)
        messages = [*(message for _, message in self.by_keys), *(problem.message for problem in self.elsewhere)]
        super().__init__("\n".join(messages))


class BadSource(RunError):
    """A command source whose files do not fit the scenario, which is only known after the source is opened.

    Attributes:
        index: its index in the commands of its robot.
        key: its key that must be changed.
        actor: the index of its robot among `world.actors`; None: the robot under test.
    """

    exit_code = ExitCode.INVALID

    def __init__(self, index: int, key: str, message: str) -> None:
        self.index = index
        self.key = key
        self.actor: int | None = None
        super().__init__(message)


class SimulationUnstable(RunError):
    """The simulated state is no longer physically possible."""


class MissedContact(RunError):
    """A body passed through another within one physics step, so that the engine saw no contact."""


class ScriptError(RunError):
    """A script of the user raised an exception, or returned neither a command nor a verdict.

    Attributes:
        details: the last output, or the traceback.
        source: the index of its command among the commands of its robot; None: it is not a command source.
        actor: the index of its robot among `world.actors`; None: the robot under test.
        time: the sim time of the call in s; None: before the run.
    """

    def __init__(self, message: str, location: Location | None = None, details: str = "") -> None:
        self.details = details
        self.source: int | None = None
        self.actor: int | None = None
        self.time: float | None = None
        super().__init__(message, location)

    def __str__(self) -> str:
        when = "" if self.time is None else f"at {self.time:.6g} s of sim time, "
        return f"{when}{super().__str__()}"


class ControllersFinished(RunError):
    """All controllers have finished: the run ends, and the simulated part is judged."""

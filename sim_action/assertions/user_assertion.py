"""`assertion: checks/stays_level.py:StaysLevel`: a class of the user's."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal, Self, get_args

from pydantic import Field, model_validator

from sim_action.assertions import Assertion
from sim_action.assertions.monitors import Monitor, State
from sim_action.core.errors import Location, ScriptError
from sim_action.core.field_types import NamesFile
from sim_action.core.messages import did_you_mean, escaped_line, shown, with_article
from sim_action.core.user_scripts import ANYTHING, ScriptProblem, read_script, run_file, script_error, told_at
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.trace_channels import Channels
from sim_action.state.verdict import Signal, Verdict
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.trace import FloatArray, Trace


Kind = Literal["end", "invariant", "goal"]

_BEGINNING: Final = {"end": State.HOLDS, "invariant": State.HOLDS, "goal": State.PENDING}

# Of rows, more than what is there: whatever the length of a run, a row is copied once or twice.
_ROOM: Final = 2


class UserAssertion(Assertion):
    """A class of yours judges the run: `assertion: checks/stays_level.py:StaysLevel`.

    It is made with the settings below `with`. Its one method `judge(self, trace)` is given a `sim_action.Trace`
    of every physics step so far, as numpy columns (`time`, `base_position_xyz`, `speed`, `tilt`,
    `joint_position`, `contacts`, ...) that cannot be written to. It returns a `sim_action.Verdict(passed,
    measured, limit, margin, unit, time, message)`, of which all but `passed` may be left out. It may be called
    for any length of the same run, in any order: it must depend on the trace and the settings alone.

    The class attribute `kind` says when it is asked. "end", which it is when left out: once, when the run is
    over. "invariant": every half second of sim time, too, and the run ends when it has not passed. "goal": as
    often, and the run waits until it has passed. It is a script: refused where scripts are, and in a process of
    its own.
    """

    key: ClassVar[str] = "assertion"
    bare_value: ClassVar[str | None] = "class"
    runs_user_code: ClassVar[bool] = True

    path: Annotated[
        str,
        NamesFile(),
        Field(alias="class", pattern=r"^[^:].*:[^\W\d]\w*$", description="FILE.py:CLASS; may stand alone"),
    ]
    settings: Annotated[
        Mapping[str, Any], Field(alias="with", description="what the class is made with; numbers without units")
    ] = {}

    @model_validator(mode="before")
    @classmethod
    def _takes_path_alone(cls, data: Any) -> Any:
        if isinstance(data, str):
            data = {"class": data}
        path = data.get("class") if isinstance(data, dict) else None
        if isinstance(path, str) and not all(path.rpartition(":")[::2]):
            raise ValueError(
                f"expected a file and a class, such as checks/stays_level.py:StaysLevel, found {shown(path)}"
            )
        return data

    @property
    def file(self) -> str:
        """Path of the Python file, from the scenario."""
        return self.path.rpartition(":")[0]

    @property
    def python_file(self) -> str:
        """See Assertion.python_file."""
        return self.file

    @property
    def class_name(self) -> str:
        """The class in that file."""
        return self.path.rpartition(":")[2]

    @property
    def reads_file(self) -> bool:
        """See Assertion.reads_file."""
        return True

    @property
    def channels(self) -> Channels:
        """See Assertion.channels: what a stranger's class looks at cannot be known before it runs."""
        return Channels(contacts=True)

    @property
    def title(self) -> str:
        """See Assertion.title."""
        return f"{self.key} {self.class_name}"

    def file_problems(self, workspace: Workspace) -> SpecProblems:
        """A file that is not there, is no Python, or has no such class. Reads it; does not run it."""
        try:
            script = read_script(workspace.file(self.file))
        except PathError as error:
            yield (), str(error)
        except OSError as error:
            yield (), f"{self.file}: cannot be read: {error.strerror}"
        except ScriptProblem as error:
            yield (), f"{self.file}{error}"
        else:
            if self.class_name not in script.names and ANYTHING not in script.names:
                hint = did_you_mean(self.class_name, [found.name for found in script.classes] or script.names)
                yield (), f"{self.file} defines no class '{self.class_name}'{hint}"

    def signals(
        self, scene: Scene, start: Observation, trace: Trace, after: float = 0.0, before: float = math.inf
    ) -> tuple[Signal, ...]:
        """None: nobody knows what it looks at, and to ask would run it again."""
        return ()

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor. Raises ScriptError."""
        return UserMonitor.opened(scene.workspace.file(self.file), self.class_name, self.settings)


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
        """See DecidingMonitor.is_decided."""
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
    import numpy as np

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


@dataclass(slots=True, eq=False)
class _Rows:
    """Room for rows, the first `filled` of which are written, and never again."""

    rows: FloatArray
    filled: int

    def added(self, count: int, rows: FloatArray) -> _Rows:
        """These, with more behind the first `count`; others, if those behind them are another future's."""
        import numpy as np

        end = count + len(rows)
        store = self
        if self.filled != count or end > len(self.rows):
            store = _Rows(np.empty((_ROOM * end, self.rows.shape[1])), count)
            store.rows[:count] = self.rows[:count]
        store.rows[count:end] = rows
        store.filled = end
        return store


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """A trace so far. Its state is not copied; what stands beside it, such as contacts, is joined anew each time.

    Attributes:
        beside: a trace without moments.
    """

    _store: _Rows
    _count: int
    beside: Trace

    @classmethod
    def of(cls, trace: Trace) -> Self:
        """The history that begins with these moments."""
        import numpy as np

        store = _Rows(np.empty((0, trace.state.shape[1])), 0)
        return cls(store.added(0, trace.state), len(trace), trace.rows(slice(0)))

    def followed_by(self, trace: Trace) -> Self:
        """The history after the moments that follow; this one stays as it is."""
        from sim_action.state.trace import Trace

        beside = Trace.concatenate((self.beside, trace.rows(slice(0))))
        store = self._store.added(self._count, trace.state)
        return replace(self, _store=store, _count=self._count + len(trace), beside=beside)

    def whole(self) -> Trace:
        """All of it, whose state cannot be written to."""
        state = self._store.rows[: self._count]
        state.flags.writeable = False
        return replace(self.beside, state=state)

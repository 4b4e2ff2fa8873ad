"""`assertion: checks/stays_level.py:StaysLevel`: a Python class of the user judges the run."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal, Self, get_args

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Assertion, Reference
from sim_action.assertions.monitors import Monitor, State
from sim_action.core.errors import Location, ScriptError
from sim_action.core.field_types import NamesFile
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, delegated, replace
from sim_action.core.user_scripts import ANYTHING, ScriptProblem, read_script, run_file, script_error, script_errors_at
from sim_action.core.wording import did_you_mean, escaped_line, shown, with_article
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_document import SpecProblems, plain_data
from sim_action.robot.model.kinematics import LinkMotions
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels
from sim_action.state.verdict import Judged, Signal, Verdict, VerdictStatus
from sim_action.world.physics import GROUND
from sim_action.world.scene import Scene

Kind = Literal["end", "invariant", "goal"]
_BEGINNING: Final = {"end": State.HOLDS, "invariant": State.HOLDS, "goal": State.PENDING}
_GROWTH: Final = 2  # growth factor of the buffer: each row is copied once or twice


class UserAssertion(Assertion):
    """A Python class of yours judges the run: `assertion: checks/stays_level.py:StaysLevel`.

    The class is created with the settings below `with` as keyword arguments; `variations` can lead to them:
    `expect.0.assertion.with.limit: [1, 2]`. Its method `judge(self, trace)` receives a `sim_action.Trace` of every
    physics step so far, as read-only numpy columns (`time`, `base_position_xyz`, `speed`, `joint_position`, `contacts`,
    ...); the motion of a link is `trace.links["tool0"]`. It returns a `sim_action.Verdict(passed, measured, limit,
    margin, unit, time, message)`, of which only `passed` is required, or None while there is nothing to judge. It may
    be called for any length of the same run, in any order, so it must depend only on the trace and the settings.

    The class attribute `kind` sets when it is called. "end", the default: once, at the end. "invariant": also every 0.5
    s of sim time, and the run ends when the verdict has not passed. "goal": also every 0.5 s, and the run waits until
    the verdict has passed. The class is code, as a script is, and runs in a process of its own.
    """

    key: ClassVar[str] = "assertion"
    reference: ClassVar[Reference] = Reference(
        "logic",
        "as the attribute `kind` of the class says",
        "`judge` returned a verdict that has passed. The class decides if anything was checked.",
        "`judge` returned a verdict that has not passed.",
        "`judge` never returned a verdict, or it was never called because the run ended before `after`.",
    )
    bare_value: ClassVar[str | None] = "class"
    runs_user_code: ClassVar[bool] = True

    path: Annotated[
        str,
        NamesFile(),
        Field(
            alias="class",
            pattern=r"^[^:].*:[^\W\d]\w*$",
            description="FILE.py:CLASS; may be the whole value",
            json_schema_extra={"pattern": r"^[^:\n][^\n]*:[^0-9\n][^\n]*$"},
        ),
    ]
    settings: Annotated[
        Mapping[str, Any], Field(alias="with", description="keyword arguments of the class; numbers without units")
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

    is_over_time: ClassVar[bool] = False

    @property
    def file(self) -> str:
        """Path of the Python file, relative to the scenario."""
        return self.path.rpartition(":")[0]

    python_file: ClassVar[str | None] = delegated("file")

    @property
    def class_name(self) -> str:
        """Name of the class in that file."""
        return self.path.rpartition(":")[2]

    reads_file: ClassVar[bool] = True

    channels: ClassVar[Channels] = Channels(contacts=True)  # the class may read any of them

    @property
    @override
    def title(self) -> str:
        return f"{self.key} {self.class_name}"

    def file_problems(self, workspace: Workspace) -> SpecProblems:
        """Yield a missing file, invalid Python or a missing class. The file is read, not run."""
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
                hint = did_you_mean(self.class_name, [definition.name for definition in script.classes] or script.names)
                yield (), f"{self.file} defines no class '{self.class_name}'{hint}"
            definition = script.class_named(self.class_name)
            if definition is None or (parameters := definition.parameters) is None:
                return
            for name, text in parameters.problems(self.settings):
                remedy = "; add it to 'with'" if name is None else ""
                path = ("with", name) if name else ("with",) if self.settings else ()
                yield path, f"{self.file}:{parameters.line}: class '{self.class_name}' {text}{remedy}"

    def signals(
        self, scene: Scene, start: Observation, trace: Trace, after: float = 0.0, before: float = math.inf
    ) -> tuple[Signal, ...]:
        """Return no curves: the quantities are unknown, and finding them would run the class again."""
        return ()

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor. Raises ScriptError."""
        judge = Judge.load(scene.workspace.file(self.file), self.class_name, self.settings)
        return UserMonitor(judge, scene.model)


@dataclass(frozen=True, slots=True, eq=False)
class UserMonitor(Monitor):
    """The monitor that keeps every step and calls the class of the user with all of them."""

    judge: Judge
    model: RobotModel  # the robot, for the motion of its links
    seen: History | None = None
    decided: Verdict | None = None  # the verdict that met the goal or broke the invariant

    @property
    @override
    def state(self) -> State:
        if self.decided is None:
            return _BEGINNING[self.judge.kind]
        return State.HOLDS if self.decided.passed else State.BROKEN

    @property
    @override
    def is_decided(self) -> bool:
        return self.decided is not None

    @override
    def observe(self, trace: Trace) -> Self:
        if self.decided is not None or not len(trace):
            return self
        # Other expectations may ask for contacts with the ground.
        contacts = tuple(contact for contact in trace.contacts if contact.body != GROUND)
        trace = replace(trace, contacts=contacts)
        later = replace(self, seen=History.of(trace) if self.seen is None else self.seen.followed_by(trace))
        if self.judge.kind == "end":
            return later
        verdict = later.verdict()
        decisive: VerdictStatus = "passed" if self.judge.kind == "goal" else "failed"
        return replace(later, decided=verdict) if verdict.status == decisive else later

    @override
    def verdict(self) -> Verdict:
        if self.decided is not None:
            return self.decided
        if self.seen is None:
            return Verdict(passed=False, message="no physics step to measure")
        return self.judge.verdict(replace(self.seen.whole(), kinematics=partial(LinkMotions, self.model)))


@dataclass(frozen=True, slots=True, eq=False)
class Judge:
    """An instance of the user's class. Raises ScriptError if the class fails or returns an invalid verdict."""

    path: Path
    name: str
    kind: Kind
    made: Any

    @classmethod
    def load(cls, path: Path, name: str, settings: Mapping[str, Any]) -> Self:
        """Run the file and create the instance. Raises ScriptError."""
        user_class = run_file(path, f"the file of {name}").get(name)
        where = Location(str(path))
        with script_errors_at(path, name):
            judge = getattr(user_class, "judge", None)
            kind: Kind = getattr(user_class, "kind", "end")
        if not isinstance(user_class, type) or not callable(judge):
            raise ScriptError(f"{name} is not a class with a method judge(self, trace)", where)
        if kind not in get_args(Kind):
            raise ScriptError(f"{name}.kind is {kind!r}; allowed: {', '.join(get_args(Kind))}", where)
        with script_errors_at(path, f"{name}(...), called with its settings,"):
            made = user_class(**plain_data(settings))
        return cls(path, name, kind, made)

    def verdict(self, trace: Trace) -> Verdict:
        """Return the verdict of the class on a trace. Raises ScriptError."""
        with script_errors_at(self.path, f"{self.name}.judge()"):
            answer = self.made.judge(trace)
        if answer is None:
            silent = f"{self.name}.judge() returned None: it judged nothing; return a sim_action.Verdict"
            return Verdict(False, message=silent, judged=Judged())
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
    """Return the verdict with Python numbers instead of numpy's. Raises TypeError with the reason if it is invalid."""
    if not isinstance(answer, Verdict):
        raise TypeError(f"{with_article(type(answer).__name__)}; it returns a sim_action.Verdict or None")
    if not isinstance(answer.passed, bool | np.bool_):
        raise TypeError(f"a Verdict whose 'passed' is {answer.passed!r}; it is True or False")
    if not isinstance(answer.unit, str) or not isinstance(answer.message, str):
        raise TypeError("a Verdict whose 'unit' or 'message' is not a string")
    names = ("measured", "limit", "margin", "time")
    measured, limit, margin, time = (_number(name, getattr(answer, name)) for name in names)
    if answer.passed and margin is not None and margin < 0:
        raise TypeError(f"a Verdict that passed with the margin {margin:g}; a margin below 0 means that it failed")
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
    """A buffer of rows. The first `filled` rows are written once and never changed."""

    rows: FloatArray
    filled: int

    def added(self, count: int, rows: FloatArray) -> _Rows:
        """Return a buffer with `rows` after the first `count`; a copy if other rows are already there."""
        end = count + len(rows)
        store = self
        if self.filled != count or end > len(self.rows):
            store = _Rows(np.empty((_GROWTH * end, self.rows.shape[1])), count)
            store.rows[:count] = self.rows[:count]
        store.rows[count:end] = rows
        store.filled = end
        return store


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """A trace that grows without copying its state each time. The other records are joined at each call."""

    _store: _Rows
    _count: int
    beside: Trace  # the records other than the state, such as contacts, as a trace without steps

    @classmethod
    def of(cls, trace: Trace) -> Self:
        """Return a history that begins with these steps."""
        store = _Rows(np.empty((0, trace.state.shape[1])), 0)
        return cls(store.added(0, trace.state), len(trace), _beside(trace))

    def followed_by(self, trace: Trace) -> Self:
        """Return the history after more steps; this one does not change."""
        beside = Trace.concatenate((self.beside, _beside(trace)))
        store = self._store.added(self._count, trace.state)
        return replace(self, _store=store, _count=self._count + len(trace), beside=beside)

    def whole(self) -> Trace:
        """Return the whole trace; its state is read-only."""
        state = self._store.rows[: self._count]
        state.flags.writeable = False
        return replace(self.beside, state=state)


def _beside(trace: Trace) -> Trace:
    return replace(trace.rows(slice(0)), objects={}, link_contacts={})

"""Tests for the authors of packages with assertions, command sources and sensors, see `sim_action.extending`.

Example:
    def test_wobble():
        check_assertion(Wobble(at_most=0.1), passes="straight_line.sim.yml", fails="bumps.sim.yml")
"""

from __future__ import annotations

import math
import os
import pickle
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, ClassVar, Final, Self

from pydantic import PydanticUserError
from typing_extensions import override

from sim_action.app.library import load, run
from sim_action.app.library_results import Outcome
from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.assertions.monitors import Monitor, State
from sim_action.commands import COMMANDS, CommandSource
from sim_action.core.errors import SimActionError
from sim_action.core.permissions import Permissions
from sim_action.core.records import dataclass, field, replace
from sim_action.core.registry import PackageProblem, Table
from sim_action.core.wording import escaped_line
from sim_action.core.yaml_document import read_document
from sim_action.scenario.loading import build_scene, checked
from sim_action.scenario.model import Expectation, LoadedScenario
from sim_action.scenario.source import Refused
from sim_action.scenario.written import Scenario
from sim_action.sensors import SENSORS, Sensor
from sim_action.simulation.loop import simulate
from sim_action.simulation.recorder import RunRecorder
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels
from sim_action.state.verdict import Verdict
from sim_action.world.scene import Scene

__all__ = ["BrokenRules", "check_assertion", "check_command", "check_sensor"]
Part = Assertion | CommandSource | Sensor
OneScenario = str | os.PathLike[str] | Scenario

# Steps in one call of a monitor; they take turns.
_BLOCKS: Final = (1, 2, 7, 64, 240)
_MAX_TITLE: Final = 100
_CLOSE: Final = 1e-9


class BrokenRules(AssertionError):
    """A part breaks rules, without which it would give wrong verdicts somewhere; `problems`: all."""

    def __init__(self, key: str, problems: Sequence[str]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(f"{key}: {problem}" for problem in self.problems))


def check_assertion(spec: Assertion, *, passes: OneScenario, fails: OneScenario) -> None:
    """Check that an assertion of an installed package keeps the rules of assertions. Raise BrokenRules.

    `spec`: an example of the assertion; `passes`: a scenario in which it is expected, and holds; `fails`: a scenario in
    which it is expected, and does not hold.
    """
    problems = _Problems()
    _check_part(spec, ASSERTIONS, problems)
    with problems.of("title"):
        problems.add_if(_why_no_line(spec.title, _MAX_TITLE), "title ")
    if not problems.found:
        for scenario, status in ((passes, "passed"), (fails, "failed")):
            with problems.of(f"the scenario in which it should have {status}"):
                _check_run(spec, _one(scenario), status, problems)
    problems.raise_for(spec.key)


def check_sensor(spec: Sensor, *, scenario: OneScenario) -> None:
    """Check that a sensor of an installed package keeps the rules of sensors. Raise BrokenRules.

    `spec`: an example of the sensor; `scenario`: a scenario that has the sensor, with `trace: true`.
    """
    problems = _Problems()
    _check_part(spec, SENSORS, problems)
    if not problems.found:
        with problems.of("its scenario"):
            _check_readings(spec, _one(scenario), problems)
    problems.raise_for(spec.key)


def check_command(spec: CommandSource, *, scenario: OneScenario) -> None:
    """Check that a command source of an installed package keeps the rules of sources. Raise BrokenRules.

    `spec`: an example of the source; `scenario`: a scenario that it drives.
    """
    problems = _Problems()
    _check_part(spec, COMMANDS, problems)
    if not problems.found:
        with problems.of("its scenario"):
            _check_commands(spec, _one(scenario), problems)
    problems.raise_for(spec.key)


class _Problems:
    """The problems found so far."""

    def __init__(self) -> None:
        self.found: list[str] = []

    def add_if(self, problem: str | None, beginning: str = "") -> None:
        """Add a problem, if there is one; each is kept once."""
        if problem is not None and (message := f"{beginning}{problem}") not in self.found:
            self.found.append(message)

    @contextmanager
    def of(self, what: str) -> Iterator[None]:
        """Turn an exception in this context into a problem."""
        try:
            yield
        except Exception as error:  # noqa: BLE001 - the code of an author may raise anything
            self.add_if(f"{what} raised {type(error).__name__}: {error}")

    def raise_for(self, key: str) -> None:
        """Raise BrokenRules if there are problems."""
        if self.found:
            raise BrokenRules(key, self.found)


def _check_part(spec: Part, table: Table[Any], problems: _Problems) -> None:
    for name, problem in _RULES.items():
        with problems.of(name):
            problems.add_if(problem(spec, table))


def _why_not_installed(spec: Part, table: Table[Any]) -> str | None:
    name = spec.key
    if name in table:
        return f"sim-action has {table.kind} '{name}' itself; choose another key"
    if name not in table.installed():
        where = f'[project.entry-points."{table.group}"]'
        return f"no installed package has it; name the class below {where}, and install the package (pip install -e .)"
    try:
        installed = table.load(name)
    except PackageProblem as problem:
        return str(problem)
    return None if installed is type(spec) else f"{table.installed()[name]} is another class: {installed.__module__}"


def _why_not_frozen(spec: Part, _: Table[Any]) -> str | None:
    if type(spec).model_config.get("frozen"):
        return None
    return "is not frozen; a monitor could change it, so leave model_config as it is"


def _why_not_pickled(spec: Part, _: Table[Any]) -> str | None:
    copy = pickle.loads(pickle.dumps(spec))  # noqa: S301 - its own bytes
    return None if copy == spec else f"is {copy!r} after pickling, and was {spec!r}"


def _why_not_written(spec: Part, _: Table[Any]) -> str | None:
    if isinstance(spec, CommandSource):  # programs give them as maps
        return None
    text = Scenario(parts=[spec]).to_yaml()
    data: Any = read_document("example", text).data
    copy = type(spec).model_validate(data["parts"][0][spec.key])
    return None if copy == spec else f"is {copy!r} when it is read from YAML, and was {spec!r}"


def _why_no_schema(spec: Part, _: Table[Any]) -> str | None:
    try:
        schema = type(spec).model_json_schema()
    except (PydanticUserError, ValueError) as error:
        return f"has no JSON schema, so editors cannot complete its keys: {escaped_line(str(error))}"
    named = {field.alias or name for name, field in type(spec).model_fields.items()}
    return None if set(schema.get("properties", {})) == named else "has a JSON schema with other keys than its fields"


_RULES: Final[dict[str, Callable[[Part, Table[Any]], str | None]]] = {
    "its entry point": _why_not_installed,
    "its class": _why_not_frozen,
    "pickle": _why_not_pickled,
    "YAML": _why_not_written,
    "the JSON schema": _why_no_schema,
}


def _why_no_line(text: object, most: int) -> str | None:
    """Return the problem with a text that must be one line."""
    if not isinstance(text, str) or not text.strip():
        return f"is {text!r}; it must be a text"
    if escaped_line(text) != text:
        return f"has several lines, or signs that cannot be printed: {text!r}"
    return None if len(text) <= most else f"has {len(text)} characters; at most {most} are allowed"


def _one(scenario: OneScenario) -> Scenario:
    return scenario if isinstance(scenario, Scenario) else load(scenario, allow_outside=True)[0]


def _outcome(scenario: Scenario, repeat: int = 1) -> Outcome:
    """Run a scenario as users do. Raise SimActionError if it has no verdict."""
    outcome = run(scenario, report=False, repeat=repeat, allow_outside=True).runs[0]
    if outcome.status == "error":
        raise SimActionError(outcome.text)
    return outcome


def _check_run(spec: Assertion, scenario: Scenario, status: str, problems: _Problems) -> None:
    outcomes = [expected for expected in _outcome(scenario).expectations if expected.assertion == spec.key]
    if not outcomes:
        problems.add_if(f"'{scenario.name}' does not expect it")
        return
    states = [expected.verdict.status for expected in outcomes]
    is_right = status in states if status == "failed" else set(states) == {status}
    if not is_right:
        problems.add_if(f"should have {status} in '{scenario.name}', and {states[0]}: {outcomes[0].verdict.message}")
    for watched in _watched(spec, scenario):
        _check_monitor(watched, problems)


@dataclass(frozen=True, eq=False)
class _Watched:
    """The steps that a monitor of an assertion was shown in a run."""

    expected: Expectation
    scene: Scene
    start: Observation
    trace: Trace

    def opened(self) -> Monitor:
        """Return the monitor that has seen nothing."""
        return self.expected.assertion.opened(self.scene, self.start, self.expected.span)


def _watched(spec: Assertion, scenario: Scenario) -> list[_Watched]:
    """Return what each assertion of this kind would be shown, over the whole run. The run is in this process."""
    loaded = _loaded(scenario)
    kept = [expected for expected in loaded.scenario.expect if type(expected.assertion) is type(spec)]
    shown = [_Shown.model_construct(inner=expected.assertion, seen=_Seen()) for expected in kept]
    expect = tuple(
        replace(expected, assertion=spy, after=0.0, before=math.inf, span=None)
        for expected, spy in zip(kept, shown, strict=True)
    )
    silent = loaded.scenario.model_copy(update={"expect": expect})
    simulate(
        silent, build_scene(loaded), lambda _: None, RunRecorder(silent, filmed=False, recorded=False, compared=False)
    )
    return [
        _Watched(expected, spy.seen.scene, spy.seen.start, Trace.concatenate(spy.seen.traces))
        for expected, spy in zip(kept, shown, strict=True)
        if spy.seen.scene is not None and spy.seen.start is not None
    ]


def _loaded(scenario: Scenario) -> LoadedScenario:
    (source, *_) = scenario.sources(Permissions(outside=True))
    if isinstance(source, Refused):
        raise source.error
    return checked(source, Permissions(outside=True), evaluate=True)


@dataclass(slots=True, eq=False)
class _Seen:
    """The arguments of a monitor's calls."""

    scene: Scene | None = None
    start: Observation | None = None
    traces: tuple[Trace, ...] = ()


class _Shown(Assertion):
    """Keeps what the monitor of another assertion would be shown."""

    key: ClassVar[str] = "shown"

    inner: Any
    seen: Any

    @property
    @override
    def channels(self) -> Channels:
        channels: Channels = self.inner.channels
        return channels

    @property
    @override
    def title(self) -> str:
        return self.key

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        self.seen.scene, self.seen.start = scene, start
        return _Keeper(self.seen)


@dataclass(frozen=True, eq=False)
class _Keeper(Monitor):
    """The monitor that keeps the steps, and never ends a run."""

    seen: _Seen
    traces: tuple[Trace, ...] = field(default_factory=tuple)

    state = State.HOLDS

    @override
    def observe(self, trace: Trace) -> Self:
        return replace(self, traces=(*self.traces, trace))

    @override
    def verdict(self) -> Verdict:
        self.seen.traces = self.traces
        return Verdict(passed=True)


def _check_monitor(watched: _Watched, problems: _Problems) -> None:
    """Check a monitor with the steps of a run."""
    spec, trace = watched.expected.assertion, watched.trace
    began = watched.opened().state
    if began is not (expected := State.PENDING if spec.is_goal else State.HOLDS):
        problems.add_if(
            f"its monitor begins as {began.name}; with is_goal {spec.is_goal}, it begins as {expected.name}"
        )
    with problems.of("verdict() before the first step"):
        problems.add_if(_why_no_verdict(watched.opened().verdict()))
    whole = watched.opened().begin(trace.first(0)).observe(trace)
    problems.add_if(_why_no_verdict(whole.verdict()))
    _check_blocks(watched, whole, problems)
    with problems.of("signals()"):
        for signal in spec.signals(watched.scene, watched.start, trace):
            if signal.time.ndim != 1 or signal.values.shape != signal.time.shape:
                shapes = f"time {signal.time.shape} and values {signal.values.shape}"
                problems.add_if(f"its signal '{signal.name}' has {shapes}; both must have the same length")
    if spec.has_truth:
        with problems.of("truth()"):
            problems.add_if(_why_no_truth(spec.started(watched.scene, watched.start), trace))


def _check_blocks(watched: _Watched, whole: Monitor, problems: _Problems) -> None:
    """Check the verdicts on a trace in blocks: all equal the verdicts on the trace in one piece."""
    monitor = watched.opened()
    at, turn = 0, 0
    decided: tuple[State, bool] | None = None
    while at < len(watched.trace):
        end = min(len(watched.trace), at + _BLOCKS[turn % len(_BLOCKS)])
        before, verdict = monitor, monitor.verdict()
        monitor = monitor.begin(watched.trace.first(0)).observe(watched.trace.rows(slice(at, end)))
        if not _is_same(before.verdict(), verdict):
            problems.add_if("observe() changes the monitor that it is called on; return a new one")
        if decided is not None and (monitor.state is not decided[0] or monitor.verdict().passed != decided[1]):
            problems.add_if(f"it was decided as {decided[0].name}, and later steps change that")
        if decided is None and monitor.is_decided:
            decided = (monitor.state, monitor.verdict().passed)
        at, turn = end, turn + 1
    if monitor.state is not whole.state or not _is_same(monitor.verdict(), whole.verdict()):
        texts = f"{_in_words(monitor.verdict())}, and for all steps at once {_in_words(whole.verdict())}"
        problems.add_if(f"its verdict depends on the blocks in which steps are observed: in small blocks {texts}")


def _in_words(verdict: Verdict) -> str:
    return f"{'passed' if verdict.passed else 'failed'} ({verdict.message})"


def _is_same(first: Verdict, second: Verdict) -> bool:
    numbers = [(getattr(first, name), getattr(second, name)) for name in _NUMBERS]
    texts = first.passed == second.passed and first.message == second.message and first.unit == second.unit
    return texts and all(_is_close(*pair) for pair in numbers)


def _is_close(first: float | None, second: float | None) -> bool:
    if first is None or second is None:
        return first is second
    return math.isclose(first, second, rel_tol=_CLOSE, abs_tol=_CLOSE)


_NUMBERS: Final = ("measured", "limit", "margin", "time")


def _why_no_verdict(verdict: object) -> str | None:
    """Return the problem with a verdict."""
    if not isinstance(verdict, Verdict):
        return f"verdict() returned {verdict!r}; it must be a Verdict"
    if type(verdict.passed) is not bool:
        return f"its verdict has passed = {verdict.passed!r}, which is no bool of Python; write bool(...)"
    for name in _NUMBERS:
        value = getattr(verdict, name)
        if value is not None and (not isinstance(value, int | float) or not math.isfinite(value)):
            return f"its verdict has {name} = {value!r}; it must be a finite number of Python, or None"
    if verdict.passed and verdict.margin is not None and verdict.margin < 0:
        return f"its verdict passed with the margin {verdict.margin:g}; a margin below 0 means that it failed"
    return _why_no_line(verdict.message, 1000) and f"the message of its verdict {_why_no_line(verdict.message, 1000)}"


def _why_no_truth(monitor: Monitor, trace: Trace) -> str | None:
    """Return the problem with the truth of a condition."""
    try:
        truth = monitor.truth(trace)
    except NotImplementedError:
        return "has_truth is True, and its monitor has no truth()"
    if truth.holds.dtype != bool or truth.holds.shape != truth.time.shape:
        return f"truth() must give a bool for each time, found {truth.holds.dtype} of shape {truth.holds.shape}"
    if not monitor.is_sampled and len(truth.time) != len(trace):
        return f"truth() has {len(truth.time)} moments for {len(trace)} steps"
    return None


def _check_commands(spec: CommandSource, scenario: Scenario, problems: _Problems) -> None:
    if not any(type(source) is type(spec) for source in _loaded(scenario).scenario.commands):
        problems.add_if(f"'{scenario.name}' does not name it")
    elif _outcome(scenario, repeat=2).status == "flaky":
        problems.add_if("two runs with the same seed differ; give the same commands in each run")


def _check_readings(spec: Sensor, scenario: Scenario, problems: _Problems) -> None:
    outcome = _outcome(scenario, repeat=2)
    if outcome.status == "flaky":
        problems.add_if("two runs with the same seed differ; draw random numbers from mount.random only")
        return
    records = [record for record in outcome.trace.sensors.values() if record.kind == spec.key]
    if not records:
        problems.add_if(f"the trace of '{scenario.name}' has no readings of it; give it 'trace: true'")
    for record in records:
        for name, values in record.columns.items():
            column = spec.columns[name]
            shape = (len(record), len(column.axes)) if column.axes else (len(record),)
            if not column.many and values.shape != shape:
                problems.add_if(f"its column '{name}' has the shape {values.shape}; its class states {shape}")

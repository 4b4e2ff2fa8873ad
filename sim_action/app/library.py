"""The use cases for programs: `sim_action.run`, `sim_action.load` and `sim_action.validate`.

They do what the command line does, without its text on the terminal, its settings in `pyproject.toml` and its
environment variables.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from inspect import signature
from numbers import Integral
from pathlib import Path
from typing import Final, TypeVar, get_args

from sim_action.app.library_results import Results, RunFolder
from sim_action.app.margins import MARGINS_FOLDER, MarginsRequest, find_margins
from sim_action.app.run import FinishedRun, RunRequest, refuse_invalid, run_scenarios
from sim_action.core.errors import InvalidScenario, Location, UsageError
from sim_action.core.permissions import AllowScripts, Permissions, checked_names, package_folders, scripts_refused
from sim_action.core.process import Interruption, usable_cores
from sim_action.core.records import replace
from sim_action.core.wording import escaped_line
from sim_action.core.workspace import current_folder
from sim_action.engines import ENGINES, EngineName, EngineOrAll
from sim_action.recording.export import wanted_formats
from sim_action.reports import ReportRequest
from sim_action.results.factor_margins import ScenarioMargins
from sim_action.results.journal import Event, Listener
from sim_action.runner.margin_search import FactorRequest
from sim_action.runner.run_plan import PlanRequest
from sim_action.scenario.loading import load_all
from sim_action.scenario.model import ConfidenceKind, Unexercised
from sim_action.scenario.selection import Selection, Suite, find_suite
from sim_action.scenario.source import Refused
from sim_action.scenario.written import Scenario

_PLURALS: Final = {"--exclude-tag": "exclude_tags", "--factor": "factors", "--package": "packages", "--tag": "tags"}
"""Options that are repeated -> the argument that takes all of their values; others have one name but for dashes."""

_OPTION: Final = re.compile(r"(?<![\w-])--[a-z]+(?:-[a-z]+)*(?![\w-])")


@contextmanager
def naming_arguments() -> Iterator[None]:
    """Name arguments in the UsageError or the InvalidScenario that the block raises."""
    try:
        yield
    except InvalidScenario as error:
        error.problems = tuple(replace(problem, message=_renamed(problem.message)) for problem in error.problems)
        error.args = ("\n".join(map(str, error.problems)),)
        raise
    except UsageError as error:
        error.args = (_renamed(str(error)),)
        raise


def _renamed(message: str) -> str:
    arguments = {*signature(run).parameters, *signature(margins).parameters}

    def named(option: re.Match[str]) -> str:
        name = _PLURALS.get(option[0], option[0][2:].replace("-", "_"))
        return name if name in arguments else option[0]

    return _OPTION.sub(named, message)


OneScenario = str | os.PathLike[str] | Scenario
Scenarios = OneScenario | Iterable[OneScenario]
"""Paths as on the command line (files, also as "push.sim.yml::1-15", folders, globs), scenarios, or several of both."""

Backend = EngineOrAll

_CALL: Final = Location("sim_action")
"""The place of a problem with a path, such as a file that does not exist: the call."""

_MAX_REPEATS: Final = 1000
_Answer = TypeVar("_Answer")

_SILENCED: Final = frozenset({"terminal", "annotations", "summary", "outputs"})
"""Reports that are for the command line only."""


@naming_arguments()
def load(
    scenarios: Scenarios = ".",
    *,
    only: Iterable[str] = (),
    exclude: Iterable[str] = (),
    tags: Iterable[str] = (),
    exclude_tags: Iterable[str] = (),
    seed: int | None = None,
    allow_outside: bool = False,
) -> tuple[Scenario, ...]:
    """Return the scenarios of files, each variation as one, in order.

    Args:
        scenarios: the files.
        only: patterns of names to select.
        exclude: patterns of names to leave out.
        tags: tags to select.
        exclude_tags: tags to leave out.
        seed: draws the variations; None takes the seed of each scenario.
        allow_outside: True if files may be outside the workspace.

    Raises InvalidScenario for a file that cannot be read, UsageError if no scenario is found. `validate` checks the
    keys.
    """
    seed = _whole("seed", seed)
    suite = _suite(scenarios, _selection(only, exclude, tags, exclude_tags), outside=allow_outside)
    contents = suite.read(Permissions(outside=allow_outside), seed)
    if contents.unmatched:
        raise UsageError("\n".join(map(str, contents.unmatched)))
    sources = suite.numbered_in(contents)
    refuse_invalid([scenario for scenario in sources if isinstance(scenario, Refused)])
    return tuple(Scenario.of(scenario) for scenario in sources if not isinstance(scenario, Refused))


@naming_arguments()
def validate(
    scenarios: Scenarios = ".", *, packages: Mapping[str, str] | None = None, allow_outside: bool = False
) -> tuple[str, ...]:
    """Check scenarios without running them, and return the warnings.

    Args:
        scenarios: paths and scenarios.
        packages: name of a ROS package -> its folder.
        allow_outside: True if files may be outside the workspace.

    Raises InvalidScenario with all problems, UsageError if no scenario is found.
    """
    working_folder = current_folder()
    suite = _suite(scenarios, outside=allow_outside)
    permissions = Permissions(
        allow_outside,
        imports_refused=scripts_refused("auto", os.environ, _folders_of(working_folder, suite)),
        packages=package_folders(packages or {}),
    )
    loaded = load_all(suite.scenarios(permissions), permissions)
    refuse_invalid([scenario for scenario in loaded if isinstance(scenario, Refused)])
    valid = [scenario for scenario in loaded if not isinstance(scenario, Refused)]
    warnings = [f"{scenario.file}: not checked: {remark}" for scenario in valid for remark in scenario.unchecked]
    warnings += [f"{warning.location}: {warning}" for scenario in valid for warning in scenario.warnings]
    return tuple(dict.fromkeys(warnings))


@naming_arguments()
def run(
    scenarios: Scenarios = ".",
    *,
    backend: Backend | None = None,
    jobs: int | None = None,
    cluster: str | None = None,
    seed: int | None = None,
    repeat: int = 1,
    only: Iterable[str] = (),
    exclude: Iterable[str] = (),
    tags: Iterable[str] = (),
    exclude_tags: Iterable[str] = (),
    fail_fast: bool = False,
    unexercised: Unexercised | None = None,
    confidence: ConfidenceKind | None = None,
    strict: bool = False,
    record: Iterable[str] = (),
    report: bool = True,
    output_dir: str | os.PathLike[str] | None = None,
    on_event: Callable[[Event], None] | None = None,
    allow_scripts: AllowScripts = "auto",
    allow_outside: bool = False,
    pass_env: Iterable[str] = (),
    packages: Mapping[str, str] | None = None,
) -> Results:
    """Run scenarios and return their results. The scenarios run in processes of their own.

    Args:
        scenarios: paths and scenarios; nothing runs unless all of them are valid.
        backend: the physics engine for all of them; "all" compares both; None: as each scenario says.
        jobs: how many scenarios run at the same time; None: one for each core.
        cluster: the Dask scheduler of a cluster that runs the scenarios, such as "tcp://10.0.0.5:8786", or "local:N";
            None: this machine runs them. `jobs` does not count on a cluster.
        seed: the random seed for all of them; None: as each scenario says.
        repeat: how often each scenario runs; it is flaky if its runs are not equal bit for bit.
        only: patterns of names to select.
        exclude: patterns of names to leave out.
        tags: tags to select.
        exclude_tags: tags to leave out.
        fail_fast: True to start no more scenarios after one did not pass.
        unexercised: "warn" if an expectation that is never judged is only reported.
        confidence: "numerical" or "full" to repeat each run with half the step, another start and the other engine if
            the scenario names it; a verdict that these could change is inconclusive.
        strict: True if each warning of the audit of claims makes its scenario fail.
        record: formats to record each run in: "mcap", "csv", "tum", "gif", "mp4".
        report: True to write replays and `report.html`.
        output_dir: the folder for results, traces and reports; None: a temporary one, which exists as long as the
            results.
        on_event: receives `Started`, `Progressed`, `RunEnded` and `Finished`, see `sim_action.results.journal`. An
            exception in it ends the run.
        allow_scripts: "false" refuses code of the repository; "auto" and "true": as on the command line.
        allow_outside: True if files may be outside the workspace.
        pass_env: environment variables that code of the repository may see.
        packages: name of a ROS package -> its folder.

    Raises InvalidScenario with all problems, UsageError for options that cannot be followed, KeyboardInterrupt after
    Ctrl-C.
    """
    for argument, value, allowed in (
        ("backend", backend, (None, *get_args(Backend))),
        ("unexercised", unexercised, (None, *get_args(Unexercised))),
        ("confidence", confidence, (None, *get_args(ConfidenceKind))),
        ("allow_scripts", allow_scripts, get_args(AllowScripts)),
    ):
        _refuse_others(argument, value, allowed)
    seed = _whole("seed", seed)
    jobs = _jobs(jobs)
    repeat = _whole("repeat", repeat) or 0
    if not 1 <= repeat <= _MAX_REPEATS:
        raise UsageError(f"repeat: a scenario runs 1 to {_MAX_REPEATS} times, found {repeat}")
    if confidence is not None and repeat > 1:
        raise UsageError("confidence: cannot be combined with repeat")
    working_folder = current_folder()
    selection = _selection(only, exclude, tags, exclude_tags)
    suite = _suite(scenarios, selection, outside=allow_outside)
    names = checked_names(_texts(pass_env))
    refused = scripts_refused(allow_scripts, os.environ, _folders_of(working_folder, suite))
    permissions = Permissions(
        allow_outside, scripts_refused=refused, pass_env=names, packages=package_folders(packages or {})
    )
    folder = RunFolder(output_dir)
    reports = ReportRequest(
        folder=folder.path,
        junit=None,
        junit_strict=False,
        verbosity="quiet",
        silenced=_SILENCED if report else _SILENCED | {"report"},
    )
    request = RunRequest(
        PlanRequest(suite, permissions, None, backend, seed, unexercised, strict, confidence),
        reports,
        jobs,
        fail_fast,
        wanted_formats(_texts(record)),
        repeat,
        valid_only=True,
        cluster=cluster,
    )
    finished = _beside(_run_here, request, on_event or _ignore)
    return Results(finished.results, finished.exit_code, folder)


@naming_arguments()
def margins(
    scenarios: Scenarios = ".",
    *,
    factors: Iterable[str] = (),
    at_least: Iterable[str] = (),
    runs: int = 20,
    backend: EngineName | None = None,
    jobs: int | None = None,
    seed: int | None = None,
    output_dir: str | os.PathLike[str] | None = None,
    allow_scripts: AllowScripts = "auto",
    allow_outside: bool = False,
    packages: Mapping[str, str] | None = None,
) -> tuple[ScenarioMargins, ...]:
    """Find how far each factor of scenarios can move before they fail, and return their margins.

    Args:
        scenarios: paths and scenarios; one that is not valid has no margins, and the reason.
        factors: factors to vary, such as "friction", "latency=0 s:2 s"; empty: factors of `at_least`, else all.
        at_least: the distances that must be left, such as "friction=20%"; see `ScenarioMargins.is_kept`.
        runs: the largest number of runs for each factor.
        backend: the physics engine for all of them; None: as each scenario says.
        jobs: how many runs there are at the same time; None: one for each core.
        seed: the random seed for all of them; None: as each scenario says.
        output_dir: the folder below which `margins` has the reports; None: they do not stay.
        allow_scripts: as of `run`.
        allow_outside: True if files may be outside the workspace.
        packages: name of a ROS package -> its folder.

    Raises UsageError for arguments that cannot be followed, KeyboardInterrupt after Ctrl-C.
    """
    _refuse_others("backend", backend, (None, *ENGINES))
    _refuse_others("allow_scripts", allow_scripts, get_args(AllowScripts))
    suite = _suite(scenarios, outside=allow_outside)
    refused = scripts_refused(allow_scripts, os.environ, _folders_of(current_folder(), suite))
    permissions = Permissions(allow_outside, scripts_refused=refused, packages=package_folders(packages or {}))
    folder = RunFolder(output_dir)
    request = MarginsRequest(
        PlanRequest(suite, permissions, None, backend, _whole("seed", seed)),
        ReportRequest(
            folder.path / MARGINS_FOLDER, junit=None, junit_strict=False, verbosity="quiet", silenced=_SILENCED
        ),
        _jobs(jobs),
        FactorRequest.parsed(_texts(factors), _texts(at_least)),
        _whole("runs", runs) or 0,
    )
    return _beside(_margins_here, request, _ignore)


def _margins_here(request: MarginsRequest, *, emit: Callable[[Event], None]) -> tuple[ScenarioMargins, ...]:
    del emit
    with Interruption() as interruption:
        found_margins, _ = find_margins(request, interruption)
    if interruption.happened:
        raise KeyboardInterrupt
    return found_margins.scenarios


def _beside(function: Callable[..., _Answer], request: RunRequest | MarginsRequest, listen: Listener) -> _Answer:
    """Run scenarios in a process that may fork: this one may have threads, and settings of its own."""
    if sys.platform == "linux":
        from sim_action.runner.warm_process import call_beside  # this module has no such function elsewhere

        answer: _Answer = call_beside(function, (request,), listen)
        return answer
    return function(request, emit=listen)


def _run_here(request: RunRequest, *, emit: Callable[[Event], None]) -> FinishedRun:
    with Interruption() as interruption:
        finished = run_scenarios(request, interruption, emit)
    if interruption.happened:
        raise KeyboardInterrupt
    return finished


def _suite(scenarios: Scenarios, selection: Selection | None = None, *, outside: bool) -> Suite:
    """Return the scenarios of a call. Raise UsageError for a path without any."""
    several = [scenarios] if isinstance(scenarios, str | os.PathLike | Scenario) else list(scenarios)
    paths = [os.fspath(scenario) for scenario in several if not isinstance(scenario, Scenario)]
    for path in paths:
        if "\0" in path:
            raise UsageError(f"a path has no null character, found {path!r}")
    suite = find_suite(paths, selection or Selection(), outside=outside, named_at=_CALL)
    written = [scenario for scenario in several if isinstance(scenario, Scenario)]
    if suite.empty or not several:
        lines = [f"no scenario found at '{pattern}'" for pattern in suite.empty]
        raise UsageError("\n".join(map(escaped_line, lines)) or "there is no scenario in the list")
    return replace(suite, written=written)


def _folders_of(working_folder: Path, suite: Suite) -> tuple[Path, ...]:
    return (working_folder, *{path.parent: None for path in suite.files})


def _selection(
    only: Iterable[str], exclude: Iterable[str], tags: Iterable[str], exclude_tags: Iterable[str]
) -> Selection:
    return Selection(*map(_texts, (only, exclude, tags, exclude_tags)))


def _refuse_others(argument: str, value: object, allowed: Sequence[object]) -> None:
    if value not in allowed:
        raise UsageError(f"{argument}: expected {' or '.join(map(repr, allowed))}, found {value!r}")


def _jobs(value: int | None) -> int:
    jobs = _whole("jobs", value)
    if jobs is not None and jobs < 1:
        raise UsageError(f"jobs: at least one scenario runs at a time, found {jobs}")
    return jobs or usable_cores()


def _whole(argument: str, value: object) -> int | None:
    """Return a whole number, also of a type of numpy, as an int. Raise UsageError for another value."""
    if isinstance(value, Integral) and not isinstance(value, bool):
        return int(value)
    if value is None:
        return None
    raise UsageError(f"{argument}: expected a whole number, found {value!r}")


def _texts(texts: Iterable[str]) -> tuple[str, ...]:
    return (texts,) if isinstance(texts, str) else tuple(texts)


def _ignore(_: Event) -> None:
    """Take an event and do nothing."""

"""A plugin of pytest: each scenario, variation and gate in a `*.sim.yml` file is a test."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Generator, Iterator
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pytest
from _pytest._code.code import ExceptionChainRepr, ExceptionRepr, ReprEntryNative, ReprFileLocation, ReprTraceback

if TYPE_CHECKING:
    import sim_action

_SUFFIXES: Final = (".sim.yml", ".sim.yaml")
_BACKENDS: Final = ("pybullet", "mujoco", "all")
_SECTION: Final = "sim-action"

SimRun = Callable[..., "sim_action.Results"]
"""The type of the fixture `sim_run`."""


class SimActionWarning(pytest.PytestWarning):
    """A scenario checks less than it seems to check."""


class ScenarioError(Exception):
    """A scenario has no verdict; the message is its part of the report of `sim-action run`.

    One that has failed is an AssertionError, as other plugins expect it of a test.
    """


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the plugin."""
    group = parser.getgroup("sim-action", "simulation scenarios (*.sim.yml)")
    group.addoption(
        "--sim-backend",
        choices=_BACKENDS,
        help="physics engine for all scenarios; all: compare both; default: as each says",
    )
    group.addoption("--sim-seed", type=int, metavar="N", help="random seed for all scenarios; default: as each says")
    group.addoption(
        "--sim-strict",
        action="store_true",
        help="fail on each warning of the audit of claims, such as a check that saw nothing",
    )
    group.addoption(
        "--sim-output",
        metavar="FOLDER",
        help="folder for results, traces and reports, one folder for each test; default: they are not kept",
    )


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Take the files of scenarios."""
    return ScenarioFile.from_parent(parent, path=file_path) if file_path.name.endswith(_SUFFIXES) else None


class ScenarioFile(pytest.File):
    """A file of scenarios."""

    def collect(self) -> Iterator[pytest.Item]:
        """Yield a test for each scenario and each of its variations; the runs of a gate are one test."""
        import sim_action

        scenarios = sim_action.load(_shown(self.path), seed=self.config.getoption("--sim-seed"))
        sim_action.validate(scenarios)
        for _, several in groupby(enumerate(scenarios), lambda each: each[1].gate or each[0]):
            together = tuple(scenario for _, scenario in several)
            yield ScenarioItem.from_parent(self, name=together[0].gate or together[0].name, scenarios=together)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the problems of the file without a traceback."""
        return _told(excinfo) or super().repr_failure(excinfo)


class ScenarioItem(pytest.Item):
    """A scenario, or all runs of a gate, as a test."""

    def __init__(self, *, scenarios: tuple[sim_action.Scenario, ...], **named: Any) -> None:
        super().__init__(**named)
        self._scenarios = scenarios
        for tag in scenarios[0].tags:
            # With --strict-markers, a mark has to be known.
            self.config.addinivalue_line("markers", f"{tag}: a tag of scenarios")
            self.keywords[tag] = True

    def iter_markers_with_node(self, name: str | None = None) -> Iterator[tuple[Any, pytest.Mark]]:
        """Yield the marks; tags are among them for `-m` only, which asks for all.

        A plugin asks for its mark by name, and would act on a tag that is called `skip`, `xfail` or `timeout`.
        """
        yield from super().iter_markers_with_node(name)
        if name is None:
            yield from ((self, pytest.Mark(tag, (), {}, _ispytest=True)) for tag in self._scenarios[0].tags)

    def runtest(self) -> None:
        """Run the scenario, or the gate. Raise AssertionError if it failed, ScenarioError if it has no verdict."""
        results = _run(self, *self._scenarios)
        properties = {f"digest of {each.name}": each.digest for each in results if each.digest is not None}
        for gate in results.gates:
            properties[f"passed runs of {gate.name}"] = f"{gate.statistics.passed} of {gate.statistics.runs}"
        # The same item may run several times.
        self.user_properties[:] = [each for each in self.user_properties if each[0] not in properties]
        self.user_properties += properties.items()
        warnings = (warning for run in results.runs for warning in run.record.warnings)
        for text in dict.fromkeys(f"{warning.location}: {warning}" for warning in warnings):
            self.warn(SimActionWarning(text))
        if not results.passed:
            self.stash[_CAUSE] = _cause(results)
            raise (ScenarioError if any(each.errors for each in results) else AssertionError)(results.text)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the report of a scenario that did not pass, with its cause for the summary; another error as usual."""
        text = str(excinfo.value).rstrip("\n") if isinstance(excinfo.value, AssertionError) else _told(excinfo)
        if text is None or _CAUSE not in self.stash:
            return text or super().repr_failure(excinfo, style)
        path, line, _ = self.reportinfo()
        place = ReprFileLocation(str(path), (line or 0) + 1, self.stash[_CAUSE])
        return ExceptionChainRepr(
            [(ReprTraceback([ReprEntryNative([f"{text}\n"])], None, style="native"), place, None)]
        )

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Return the file, the line from 0, and the name."""
        return self.path, (self._scenarios[0].line or 1) - 1, self.name


@pytest.fixture
def sim_run(request: pytest.FixtureRequest) -> SimRun:
    """Run a scenario: `sim_run(path_or_scenario, **{"robot.pose.yaw": 0.5})` returns `sim_action.Results`.

    A path starts in the folder of the test. Named arguments are keys of the scenario, or paths of keys as in
    `variations`, with their new values. The report of scenarios that did not pass is shown if the test fails. A test
    that does not look at the verdict of such a scenario fails.
    """
    import sim_action
    import sim_action.errors

    # The same test may run several times.
    seen = request.node.stash[_RESULTS] = []

    def run(scenario: str | os.PathLike[str] | sim_action.Scenario, **overrides: Any) -> sim_action.Results:
        __tracebackhide__ = True
        try:
            return results_of(scenario, overrides)
        except sim_action.errors.SimActionError as error:
            if isinstance(error, sim_action.errors.InternalError):
                raise
            # The message is for the author of the test, who sees the line of the call.
            raise error.with_traceback(None) from None

    def results_of(
        scenario: str | os.PathLike[str] | sim_action.Scenario, overrides: dict[str, Any]
    ) -> sim_action.Results:
        if isinstance(scenario, sim_action.Scenario):
            several: tuple[sim_action.Scenario, ...] = (scenario,)
        else:
            path = _shown(request.path.parent / scenario)
            several = sim_action.load(path, seed=request.config.getoption("--sim-seed"))
        results = _run(request.node, *(each.changed(overrides) for each in several))
        if any(each.is_ignored_failure for each in results):
            request.node.add_report_section("call", _SECTION, results.text)
        seen.append(results)
        return results

    return run


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Fail a test that has not looked at the verdict of a scenario that did not pass."""
    yield
    ignored = [each for results in item.stash.get(_RESULTS, []) for each in results if each.is_ignored_failure]
    if ignored:
        names = ", ".join(f"'{each.name}'" for each in ignored)
        pytest.fail(f"{names} did not pass, and the test looked at no verdict: assert results.passed", pytrace=False)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Begin the summary of a failed `assert results.passed` with the cause, where pytest has "assert False".

    It stays as it is if the test asserts something else, such as a value of a scenario that should fail.
    """
    report = yield
    crash = report.longrepr.reprcrash if isinstance(report.longrepr, ExceptionRepr) else None
    asserted = "" if crash is None else crash.message
    bad = (each for results in item.stash.get(_RESULTS, []) for each in results if each.record.reasons)
    if crash is not None and (first := next(bad, None)) is not None and _ON_VERDICT.search(asserted):
        crash.message = f"{first.record.reasons[0]}\n{asserted}"
    return report


def _cause(results: sim_action.Results) -> str:
    """Return the most important reason why results did not pass."""
    return next((reason for each in results for reason in each.record.reasons), "did not pass")


_ON_VERDICT: Final = re.compile(
    r"\A(?:AssertionError: )?assert (?:False\b|(?:Results|(?:Gate)?Outcome)\(|'\w+' == 'passed')"
)
"""What pytest says of `assert results.passed`, `assert results`, and `assert results[0].status == "passed"`."""

_CAUSE: Final = pytest.StashKey[str]()
"""The reason why a scenario did not pass."""

_RESULTS: Final = pytest.StashKey["list[sim_action.Results]"]()
"""The results of all calls of `sim_run` in a test."""


def _run(node: pytest.Item, *scenarios: sim_action.Scenario) -> sim_action.Results:
    import sim_action

    output = node.config.getoption("--sim-output")
    folder = None if output is None else node.config.invocation_params.dir / output / _folder_name(node)
    return sim_action.run(
        scenarios,
        backend=node.config.getoption("--sim-backend"),
        seed=node.config.getoption("--sim-seed"),
        jobs=_cores() if any(each.gate for each in scenarios) else 1,
        strict=node.config.getoption("--sim-strict"),
        report=folder is not None,
        output_dir=folder,
    )


def _cores() -> int:
    """Return the number of cores for one test: pytest-xdist runs several tests at the same time."""
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    return max(1, (os.cpu_count() or 1) // workers)


_MAX_NAME_CHARS: Final = 50  # names of files have at most 255 bytes, and a character up to 4
_HASH_CHARS: Final = 8
_CALLS: Final = pytest.StashKey[int]()
"""How often a test has run scenarios."""


def _folder_name(node: pytest.Item) -> str:
    """Return a name for the results of a call, which no other call of this session has."""
    number = node.stash[_CALLS] = node.stash.get(_CALLS, 0) + 1
    name = re.sub(r"[^\w.=,+-]+", "-", node.nodeid).strip("-.")[:_MAX_NAME_CHARS]
    # Tests with the names "a b" and "a-b" have a folder each; the same one in each session.
    return f"{name}-{hashlib.sha256(node.nodeid.encode()).hexdigest()[:_HASH_CHARS]}-{number}"


def _shown(path: Path) -> Path:
    """Return a path as messages name it: from the current folder, if it is below."""
    here, path = Path.cwd(), Path(os.path.normpath(path))
    return path.relative_to(here) if path.is_relative_to(here) else path


def _told(excinfo: pytest.ExceptionInfo[BaseException]) -> str | None:
    """Return the message of an error that needs no traceback; None for others."""
    from sim_action.errors import InternalError, SimActionError

    error = excinfo.value
    is_plain = isinstance(error, ScenarioError | SimActionError) and not isinstance(error, InternalError)
    return str(error).rstrip("\n") if is_plain else None

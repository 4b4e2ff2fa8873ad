"""Stand-ins for what others make of JUnit XML: they must find a file of it, and be able to read all that they find."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from junitparser import Error, Failure, JUnitXml, JUnitXmlError, TestCase, TestSuite

from tests.integration.github.errors import StepFailed, UnsupportedFeature
from tests.integration.github.globs import find, lines
from tests.integration.github.machine import Machine, Report
from tests.integration.github.permissions import allows
from tests.integration.github.stand_in import StandIn, boolean

_JUNIT: Final = frozenset({"java-junit", "jest-junit", "python-xunit"})


@dataclass(frozen=True, slots=True)
class _Reporter:
    """What tells one reporter from the others.

    Attributes:
        paths: the patterns that its inputs name.
        writes: what its token must be allowed to write.
        fails: whether its step fails when a test did.
        asks_git: for the files that it tracks, so that there must be a checkout.
    """

    name: str
    paths: Callable[[Mapping[str, str]], list[str]]
    writes: Callable[[Mapping[str, str], Machine], list[str]]
    fails: Callable[[Mapping[str, str]], bool]
    asks_git: bool = False

    def report(self, machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
        if self.asks_git and not machine.is_checked_out:
            raise StepFailed(f"{self.name}: fatal: not a git repository")
        for scope in self.writes(inputs, machine):
            if not allows(machine.permissions, scope, "write"):
                raise StepFailed(f"{self.name}: Resource not accessible by integration, it needs '{scope}: write'")
        report = self._read(inputs, find(self.paths(inputs), machine.workspace, descend=False).files)
        machine.record.reports.append(report)
        if self.fails(inputs) and report.failures + report.errors:
            raise StepFailed(f"{self.name}: {report.failures + report.errors} of {report.tests} tests failed")
        return {}

    def _read(self, inputs: Mapping[str, str], files: tuple[Path, ...]) -> Report:
        if not files:
            raise StepFailed(f"{self.name}: no test report files were found for {self.paths(inputs)}")
        cases = [case for file in files for case in _cases(file)]
        return Report(
            reporter=self.name,
            inputs=inputs,
            files=files,
            tests=len(cases),
            failures=sum(any(isinstance(result, Failure) for result in case.result) for case in cases),
            errors=sum(any(isinstance(result, Error) for result in case.result) for case in cases),
        )


def _cases(file: Path) -> list[TestCase]:
    try:
        suites = [suite for suite in JUnitXml.fromfile(str(file)) if isinstance(suite, TestSuite)]
    except (ET.ParseError, JUnitXmlError) as error:
        raise StepFailed(f"{file} is no JUnit XML: {error}") from error
    return [case for suite in suites for case in suite if isinstance(case, TestCase)]


def _dorny_paths(inputs: Mapping[str, str]) -> list[str]:
    if inputs["reporter"] not in _JUNIT:
        raise UnsupportedFeature(f"reporter: {inputs['reporter']}")
    folder = Path(inputs["working-directory"])
    return [str(folder / path.strip()) for path in inputs["path"].split(",")]


def _enricomi_writes(inputs: Mapping[str, str], machine: Machine) -> list[str]:
    # It sees that it runs for a fork, and does without what it may not write.
    if machine.is_for_fork:
        return []
    comments = machine.github["event_name"] == "pull_request" and inputs["comment_mode"] != "off"
    return ["checks"] * boolean(inputs["check_run"]) + ["pull-requests"] * comments


_DORNY: Final = _Reporter(
    "dorny/test-reporter",
    paths=_dorny_paths,
    writes=lambda inputs, _: [] if boolean(inputs["use-actions-summary"]) else ["checks"],
    fails=lambda inputs: boolean(inputs["fail-on-error"]),
    asks_git=True,
)
_MIKEPENZ: Final = _Reporter(
    "mikepenz/action-junit-report",
    paths=lambda inputs: lines(inputs["report_paths"]),
    writes=lambda inputs, _: [] if boolean(inputs["annotate_only"]) else ["checks"],
    fails=lambda inputs: boolean(inputs["fail_on_failure"]),
)
_ENRICOMI: Final = _Reporter(
    "EnricoMi/publish-unit-test-result-action",
    paths=lambda inputs: lines(inputs["files"]),
    writes=_enricomi_writes,
    fails=lambda inputs: boolean(inputs["action_fail"]),
)

DORNY: Final = StandIn(
    _DORNY.report,
    required=("name", "path", "reporter"),
    defaults={
        "fail-on-error": "true",
        "fail-on-empty": "true",
        "list-suites": "all",
        "list-tests": "all",
        "max-annotations": "10",
        "only-summary": "false",
        "use-actions-summary": "true",
        "working-directory": "",
    },
)
MIKEPENZ: Final = StandIn(
    _MIKEPENZ.report,
    defaults={
        "annotate_only": "false",
        "check_name": "JUnit Test Report",
        "comment": "false",
        "detailed_summary": "false",
        "fail_on_failure": "false",
        "include_passed": "false",
        "job_summary": "true",
        "report_paths": "**/junit-reports/TEST-*.xml",
        "require_tests": "false",
    },
)
ENRICOMI: Final = StandIn(
    _ENRICOMI.report,
    required=("files",),
    defaults={
        "action_fail": "false",
        "check_name": "Test Results",
        "check_run": "true",
        "comment_mode": "always",
        "fail_on": "test failures",
        "job_summary": "true",
        "report_individual_runs": "false",
    },
)

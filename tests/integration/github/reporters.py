"""Stand-ins for what others make of JUnit XML: they must find the file, and be able to read it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from junitparser import Error, Failure, JUnitXml, JUnitXmlError, TestCase, TestSuite

from tests.integration.github.errors import StepFailed, UnsupportedFeature
from tests.integration.github.machine import Machine, Report
from tests.integration.github.permissions import allows
from tests.integration.github.stand_in import NO_OUTPUTS, StandIn, boolean, one_path


@dataclass(frozen=True, slots=True)
class _Reporter:
    """What tells one reporter from the others."""

    name: str
    path: str  # the input that says where the file is
    writes: Callable[[Mapping[str, str], Machine], list[str]]  # what its token must be allowed to write
    fails: bool = False  # its step fails when a test did
    asks_git: bool = False  # for the files that it tracks, so that there must be a checkout

    def report(self, machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
        if self.asks_git and not (machine.workspace / ".git").exists():
            raise StepFailed(f"{self.name}: fatal: not a git repository")
        for scope in self.writes(inputs, machine):
            if not allows(machine.permissions, scope, "write"):
                raise StepFailed(f"{self.name}: Resource not accessible by integration, it needs '{scope}: write'")
        report = self._read(inputs, one_path(machine, inputs[self.path]))
        machine.record.reports.append(report)
        if self.fails and report.failures + report.errors:
            raise StepFailed(f"{self.name}: {report.failures + report.errors} of {report.tests} tests failed")
        return NO_OUTPUTS

    def _read(self, inputs: Mapping[str, str], file: Path) -> Report:
        if not file.is_file():
            raise StepFailed(f"{self.name}: no test report files were found for {inputs[self.path]}")
        cases = _cases(file)
        return Report(
            reporter=self.name,
            inputs=inputs,
            files=(file,),
            tests=len(cases),
            failures=sum(any(isinstance(result, Failure) for result in case.result) for case in cases),
            errors=sum(any(isinstance(result, Error) for result in case.result) for case in cases),
        )


def _cases(file: Path) -> list[TestCase]:
    try:
        suites = [suite for suite in JUnitXml.fromfile(str(file)) if isinstance(suite, TestSuite)]
    except (SyntaxError, JUnitXmlError) as error:  # from the parser of the standard library, or from lxml
        raise StepFailed(f"{file} is no JUnit XML: {error}") from error
    return [case for suite in suites for case in suite if isinstance(case, TestCase)]


def _dorny_writes(inputs: Mapping[str, str], machine: Machine) -> list[str]:
    if inputs["reporter"] != "java-junit":
        raise UnsupportedFeature(f"reporter: {inputs['reporter']}")
    return [] if boolean(inputs["use-actions-summary"]) else ["checks"]


def _mikepenz_writes(inputs: Mapping[str, str], machine: Machine) -> list[str]:
    return [] if boolean(inputs["annotate_only"]) else ["checks"]


def _enricomi_writes(inputs: Mapping[str, str], machine: Machine) -> list[str]:
    # It sees that it runs for a fork, and does without what it may not write.
    if machine.is_for_fork:
        return []
    return ["checks", *(["pull-requests"] if machine.github["event_name"] == "pull_request" else [])]


DORNY: Final = StandIn(
    _Reporter("dorny/test-reporter", "path", _dorny_writes, fails=True, asks_git=True).report,
    required=("name", "path", "reporter"),
    defaults={"use-actions-summary": "true"},
)
MIKEPENZ: Final = StandIn(
    _Reporter("mikepenz/action-junit-report", "report_paths", _mikepenz_writes).report,
    defaults={
        "annotate_only": "false",
        "check_name": "JUnit Test Report",
        "detailed_summary": "false",
        "include_passed": "false",
        "report_paths": "**/junit-reports/TEST-*.xml",
    },
)
ENRICOMI: Final = StandIn(
    _Reporter("EnricoMi/publish-unit-test-result-action", "files", _enricomi_writes).report,
    required=("files",),
    defaults={"check_name": "Test Results"},
)

"""What stands in for others' reporters of JUnit XML."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import pytest

from tests.integration.github import UnsupportedFeature, WorkflowResult
from tests.integration.github.conftest import CHECKOUT, Perform, uses

Step: TypeAlias = Callable[..., str]

DORNY = "dorny/test-reporter@a43b3a5f7366b97d083190328d2c652e1a8b6aa2"
MIKEPENZ = "mikepenz/action-junit-report@d9f48fc87bc235f7e214acf696ca5abc0a986f16"
ENRICOMI = "EnricoMi/publish-unit-test-result-action@d0a4676d0e0b938bc201470d88276b7c74c712b3"
JUNIT = """<?xml version="1.0"?>
<testsuites><testsuite name="s" tests="9">
  <testcase name="a"/><testcase name="b"><failure message="m"/></testcase><testcase name="c"><error/></testcase>
</testsuite></testsuites>
"""
PASSED = "<testsuite><testcase name='a'/></testsuite>"
FORK = {"pull_request": {"head": {"repo": {"full_name": "somebody/robots"}}}}


def dorny(**more: str) -> str:
    inputs = {name.replace("_", "-"): value for name, value in more.items()}
    given = {"name": "n", "path": "out/junit.xml", "reporter": "java-junit"}
    return uses(DORNY, {**given, **inputs})


def mikepenz(**more: str) -> str:
    return uses(MIKEPENZ, {"report_paths": "out/junit.xml", **more})


def enricomi(**more: str) -> str:
    return uses(ENRICOMI, {"files": "out/junit.xml", **more})


def reported(perform: Perform, step: str, *, may: str = "checks: write", **options: Any) -> WorkflowResult:
    head = f"on: [push, pull_request]\npermissions: {{contents: read, {may}}}\n"
    steps = f"    steps:\n{uses(CHECKOUT, identity='code')}{step}"
    return perform(f"{head}jobs:\n  a:\n    runs-on: ubuntu-latest\n{steps}", **options)


@pytest.fixture(autouse=True)
def junit(repository: Path) -> Path:
    file = repository / "out/junit.xml"
    file.parent.mkdir()
    file.write_text(JUNIT, encoding="utf-8")
    return file


every_reporter = pytest.mark.parametrize("reporter", [dorny, mikepenz, enricomi])


@every_reporter
def test_a_report_is_recorded(perform: Perform, reporter: Step) -> None:
    result = reported(perform, reporter())
    [report] = result.reports
    assert result.conclusion == ("failure" if reporter is dorny else "success")
    assert (report.tests, report.failures, report.errors) == (3, 1, 1)
    assert [file.name for file in report.files] == ["junit.xml"]
    assert "out/junit.xml" in report.inputs.values()


@every_reporter
def test_a_report_must_be_found(perform: Perform, reporter: Step, junit: Path) -> None:
    junit.unlink()
    result = reported(perform, reporter())
    assert (result.conclusion, result.reports) == ("failure", ())


@every_reporter
@pytest.mark.parametrize("content", ["", "{}", "<results/>", "<testsuites>", JUNIT.replace("name", "\x0bname")])
def test_a_report_must_be_junit(perform: Perform, reporter: Step, junit: Path, content: str) -> None:
    junit.write_text(content, encoding="utf-8")
    result = reported(perform, reporter())
    assert (result.conclusion, result.reports) == ("failure", ())


def test_dorny_fails_where_a_test_did(perform: Perform, junit: Path) -> None:
    assert "2 of 3 tests failed" in reported(perform, dorny()).runs[0].annotations[0].message
    junit.write_text(PASSED, encoding="utf-8")
    assert reported(perform, dorny()).conclusion == "success"


@pytest.mark.parametrize(
    ("step", "is_needed"),
    [
        (dorny(use_actions_summary="false"), True),
        (dorny(use_actions_summary="true"), False),
        (mikepenz(), True),
        (mikepenz(annotate_only="true"), False),
        (enricomi(), True),
    ],
)
def test_check_runs_need_permission(perform: Perform, step: str, is_needed: bool, junit: Path) -> None:
    junit.write_text(PASSED, encoding="utf-8")
    result = reported(perform, step, may="checks: read")
    messages = [annotation.message for annotation in result.runs[0].annotations]
    assert result.conclusion == ("failure" if is_needed else "success")
    assert any("'checks: write'" in message for message in messages) == is_needed


@pytest.mark.parametrize(
    ("may", "conclusion"), [("checks: write", "failure"), ("checks: write, pull-requests: write", "success")]
)
def test_comments_need_permission(perform: Perform, may: str, conclusion: str) -> None:
    assert reported(perform, enricomi(), may=may, event_name="pull_request").conclusion == conclusion


@pytest.mark.parametrize(
    ("step", "conclusion"),
    [
        (mikepenz(), "failure"),
        (mikepenz(annotate_only="true"), "success"),
        (dorny(use_actions_summary="false"), "failure"),
        (dorny(use_actions_summary="true"), "success"),
        (enricomi(), "success"),
    ],
)
def test_pull_requests_of_forks_may_not_write(perform: Perform, step: str, conclusion: str, junit: Path) -> None:
    junit.write_text(PASSED, encoding="utf-8")
    assert reported(perform, step, event_name="pull_request", event=FORK).conclusion == conclusion


def test_dorny_asks_git(perform: Perform) -> None:
    result = perform(f"on: push\njobs:\n  a:\n    runs-on: ubuntu-latest\n    steps:\n{dorny()}")
    assert result.conclusion == "failure"
    assert "not a git repository" in result.runs[0].annotations[0].message


@pytest.mark.parametrize(
    "step",
    [
        dorny(reporter="dotnet-trx"),
        dorny(artifact="x"),
        dorny(path="a.xml, b.xml"),
        mikepenz(token="x"),
        mikepenz(report_paths="**/*.xml"),
        enricomi(trx="x"),
    ],
)
def test_what_is_not_known_is_refused(perform: Perform, step: str) -> None:
    with pytest.raises(UnsupportedFeature):
        reported(perform, step)

"""The checks of injected faults find what is wrong; here with runs that are written by hand."""

from __future__ import annotations

import errno
import json
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.integration.faults.checks import Undisturbed, broken_promises, kept
from tests.integration.faults.injection import Fault, Run

OUTCOMES: dict[str, Any] = {
    "a": {"name": "a", "status": "passed", "digest": "1", "trace": "traces/a.npz"},
    "b": {"name": "b", "status": "failed", "digest": "2"},
}
USUAL = Undisturbed(1, OUTCOMES, Path("cache"))
ERROR = {"title": "not started", "message": "no process: Too many open files"}
JUNIT = """\
<testsuites><testsuite name="a"><testcase name="x"/></testsuite>
<testsuite name="b" failures="1"><testcase name="x"><failure/></testcase></testsuite></testsuites>
"""
FULL = Fault("EMFILE", "once", "open", error=errno.EMFILE)
KILL = Fault("SIGKILL", "once", "open", signal=signal.SIGKILL, target="parent")

Change = Callable[[Run], Run | None]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """A run in which everything is as usual."""
    found = Run(tmp_path, 1, "", "[1/2] passed  a  1 s\n[2/2] failed  b  1 s\n", reached=3, fired=1, left=())
    (found.output / "traces").mkdir(parents=True)
    found.tmp.mkdir()
    (found.output / "traces/a.npz").touch()
    (found.output / "report.html").touch()
    (found.output / "junit.xml").write_text(JUNIT)
    write(found, OUTCOMES)
    return found


def write(run: Run, outcomes: dict[str, Any]) -> None:
    (run.output / "results.json").write_text(json.dumps({"outcomes": list(outcomes.values())}))


def with_outcome(name: str, **values: object) -> Change:
    return lambda run: write(run, OUTCOMES | {name: OUTCOMES[name] | values})


def without(name: str) -> Change:
    def change(run: Run) -> Run | None:
        (run.output / name).unlink()
        return None

    return change


def with_file(name: str) -> Change:
    def change(run: Run) -> Run | None:
        (run.folder / name).touch()
        return None

    return change


def test_a_run_as_usual_breaks_no_promise(run: Run) -> None:
    assert list(broken_promises(run, FULL, USUAL)) == []
    assert kept(run, USUAL) == 2


@pytest.mark.parametrize(
    ("change", "promise"),
    [
        (lambda run: replace(run, errors="Traceback (most recent call last):"), "a traceback"),
        (lambda run: replace(run, code=3), "the exit code is 3"),
        (lambda run: replace(run, code=0), "but the exit code is 0 and not 1"),
        (lambda run: replace(run, left=(7,)), "processes are left: (7,)"),
        (
            lambda run: replace(run, errors="[1/1] failed  a  1 s\n"),
            "reported as finished, and lost later: [('a', 'fai",
        ),
        (with_file("tmp/sim-action-x"), "temporary files are left: ['sim-action-x']"),
        (with_file("suite/sim-results/.0123456789abcdef.xml"), "unfinished files are left"),
        (without("junit.xml"), "the verdicts are not on standard output"),
        (without("traces/a.npz"), "'a' names a trace that does not exist"),
        (lambda run: write(run, {"a": OUTCOMES["a"]}), "not accounted for: ['b']"),
        (with_outcome("a", digest="3"), "'a' has another digest than usual"),
        (with_outcome("b", status="passed"), "'b' has another status than usual"),
        (with_outcome("b", status="passed"), "'b' failed in JUnit, and passed in the results"),
        (with_outcome("a", trace=None), "'a' has no trace, and no note about it"),
        (with_outcome("a", status="error", failures=[ERROR]), "without a verdict: ['a']"),
        (with_outcome("a", status="error", failures=[ERROR | {"message": "?"}]), "does not name the cause"),
    ],
)
def test_each_broken_promise_is_found(run: Run, change: Change, promise: str) -> None:
    changed = change(run) or run
    assert promise in "; ".join(broken_promises(changed, FULL, USUAL))


def test_a_scenario_may_be_lost_where_the_fault_allows_it(run: Run) -> None:
    write(run, OUTCOMES | {"a": {"name": "a", "status": "error", "failures": [ERROR]}})
    (run.output / "junit.xml").write_text(JUNIT.replace('name="a"', 'name="a" errors="1"'))
    changed = replace(run, errors="")
    assert list(broken_promises(changed, replace(FULL, most_lost=1), USUAL)) == []
    assert list(broken_promises(changed, replace(FULL, exempt=("a",)), USUAL)) == []
    assert list(broken_promises(changed, replace(FULL, exempt=("b",)), USUAL)) == ["without a verdict: ['a']"]


def test_a_command_that_was_killed_must_have_all_it_reported_in_its_journal(run: Run) -> None:
    killed = replace(run, code=-signal.SIGKILL)
    (promise,) = broken_promises(killed, KILL, USUAL)
    assert promise == "reported as finished, and not in the journal: [('a', 'passed'), ('b', 'failed')]"

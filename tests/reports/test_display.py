"""Every status has its place in every report and table."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal, get_args

import pytest
import yaml

from sim_action.core.errors import ExitCode, Location
from sim_action.reports import ReportOptions, display
from sim_action.reports.comparison import rows
from sim_action.reports.display import INFORMATION, STATUS_DISPLAYS
from sim_action.reports.formatting import counts_text, judged_text
from sim_action.reports.github.step_outputs import outputs
from sim_action.reports.html import notebook
from sim_action.results.comparison import compare_outcomes
from sim_action.results.outcome import (
    WORST_FIRST,
    DisplayStatus,
    ExpectationOutcome,
    ExpectationStatus,
    Failure,
    Outcome,
    Status,
)
from sim_action.state.verdict import Judged, Verdict
from tests.outcomes import like, results

ROOT = Path(__file__).parents[2]
VIEWER = ROOT / "sim_action/reports/viewer"
STATUSES: tuple[Status, ...] = get_args(Status)
EXPECTATION_STATUSES: tuple[ExpectationStatus, ...] = get_args(ExpectationStatus)


def expectation(status: ExpectationStatus) -> ExpectationOutcome:
    judged = Judged() if status == "not_exercised" else Judged(3, 0.0, 1.0)
    inconclusive: Literal["statistical"] | None = "statistical" if status == "inconclusive" else None
    return ExpectationOutcome(
        name="travel",
        assertion="travel",
        severity="warning" if status == "warned" else "error",
        location=Location("a.sim.yml", 3),
        verdict=Verdict(status == "passed", message="told", judged=judged, inconclusive=inconclusive),
    )


def outcome(status: Status) -> Outcome:
    """An outcome of this status, as the runner makes them."""
    made = Outcome(name="a", file="a.sim.yml", status=status)
    match status:
        case "error" | "flaky":
            kind = "crash" if status == "error" else "flaky"
            return like(made, failures=(Failure.model_validate({"kind": kind, "title": "a", "message": "told"}),))
        case "skipped":
            return made
        case _:
            return like(made, expectations=(expectation(status),))


def test_the_table_of_statuses() -> None:
    # The table has every status the worst first.
    assert tuple(STATUS_DISPLAYS) == WORST_FIRST
    assert {*STATUSES, *EXPECTATION_STATUSES} <= {*WORST_FIRST}
    # Every style is known to terminals and notebooks.
    styles = {display.style for display in (*STATUS_DISPLAYS.values(), INFORMATION)}
    assert styles <= set(display._CODES)
    assert styles <= set(notebook._STYLES)


@pytest.mark.parametrize("status", WORST_FIRST)
def test_a_status_has_a_symbol_and_words(status: DisplayStatus) -> None:
    display = STATUS_DISPLAYS[status]
    assert len(display.symbol) == len(display.ascii_symbol) == 1
    assert display.ascii_symbol.isascii()
    assert all((display.word, display.headline, display.meaning, display.icon, display.style))


@pytest.mark.parametrize("of", ["inconclusive", "not_exercised"])
def test_a_verdict_that_is_open_looks_like_no_other_status(of: DisplayStatus) -> None:
    own = STATUS_DISPLAYS[of]
    others = [display for status, display in STATUS_DISPLAYS.items() if status != of]
    for name in ("word", "headline", "symbol", "ascii_symbol", "icon", "style"):
        assert getattr(own, name) not in [getattr(display, name) for display in others], name


@pytest.mark.parametrize("status", STATUSES)
def test_all_before_passed_fails_the_process_and_is_an_error_in_reports(status: Status) -> None:
    made, display = outcome(status), STATUS_DISPLAYS[status]
    assert (made.exit_code is ExitCode.PASSED) == (status == "passed")
    if status != "skipped":
        assert (display.level == "error") == (display.junit in ("error", "failure")) == (status != "passed")


@pytest.mark.parametrize("status", STATUSES)
def test_each_status_is_counted_and_has_an_output_of_the_action(status: Status, options: ReportOptions) -> None:
    counts = "2 passed" if status == "passed" else f"1 passed, 1 {STATUS_DISPLAYS[status].word}"
    assert counts_text(results(outcome(status), outcome("passed"))) == counts
    name = {"error": "errors"}.get(status, status.replace("_", "-"))
    assert outputs(results(outcome(status)), options)[name] == "1"
    assert outputs(results(), options)[name] == "0"
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    assert name in action["outputs"]


@pytest.mark.parametrize("status", [status for status in WORST_FIRST if status not in ("skipped", "warned")])
def test_the_style_sheet_has_each_status(status: DisplayStatus) -> None:
    css = (VIEWER / "page.css").read_text(encoding="utf-8")
    for selector in ("mark", "status"):
        assert re.search(rf"\.{selector}(?:\.{status}\b|  *\{{)", css), selector


@pytest.mark.parametrize("status", EXPECTATION_STATUSES)
def test_the_types_of_the_viewer_have_each_status(status: ExpectationStatus) -> None:
    types = (ROOT / "tools/viewer/src/page.d.ts").read_text(encoding="utf-8")
    unions = re.findall(r'^  status: (.*"failed");$', types, re.MULTILINE)
    assert len(unions) == 2
    assert all(f'"{status}"' in union for union in unions)


@pytest.mark.parametrize("new", STATUSES)
@pytest.mark.parametrize("old", STATUSES)
def test_a_change_of_status_fails_unless_it_was_bad_before(old: Status, new: Status) -> None:
    compared = compare_outcomes([outcome(old)], [outcome(new)])
    bad = ("error", "failed", "flaky", "inconclusive", "not_exercised")
    assert (compared.failures == 1) == (new == "flaky" or (new in bad and old not in bad))
    assert (compared.count("fixed") == 1) == (new == "passed" and old in bad and old != "flaky")
    for each in rows(compared):
        assert "not_exercised" not in each.kind + each.message


@pytest.mark.parametrize(
    ("judged", "text"),
    [
        (None, ""),
        (Judged(), "judged at no moment"),
        (Judged(1, 0.5, 0.5), "judged at 1 moment, 0.50 s"),
        (Judged(240, 0.0, 1.0), "judged at 240 moments, 0.00 s to 1.00 s"),
        (Judged(-3, 0.0, 1.0), "judged at no moment"),
    ],
)
def test_moments_in_words(judged: Judged | None, text: str) -> None:
    assert judged_text(Verdict(True, judged=judged)) == text

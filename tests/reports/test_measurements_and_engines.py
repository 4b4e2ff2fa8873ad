"""What every report has to show: the engine of each outcome, and measurements that are no passes."""

from __future__ import annotations

import io
import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from sim_action.core.version import PACKAGE_FOLDER
from sim_action.reports import ReportOptions
from sim_action.reports.display import INFORMATION, STATUS_DISPLAYS
from sim_action.reports.formatting import counts_text
from sim_action.reports.github.job_summary import summary
from sim_action.reports.html.report import page
from sim_action.reports.junit import write_junit
from sim_action.reports.terminal import print_results
from sim_action.results.comparison import compare_outcomes
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from tests.outcomes import like
from tests.reports.samples import APART, SAMPLES

ENGINE = "mujoco 4.0.1"


def terminal(results: Results, options: ReportOptions) -> str:
    stream = io.StringIO()
    print_results(results, options, stream)
    return stream.getvalue()


def junit(results: Results, options: ReportOptions) -> str:
    write_junit(results, options)
    return options.junit.read_text(encoding="utf-8")


def strict_junit(results: Results, options: ReportOptions) -> str:
    return junit(results, replace(options, junit_strict=True))


def results_json(results: Results, options: ReportOptions) -> str:
    options.folder.mkdir(exist_ok=True)
    return results.write(options.folder).read_text(encoding="utf-8")


def html(results: Results, options: ReportOptions) -> str:
    return page(results, options).text()


REPORTS: tuple[Callable[[Results, ReportOptions], str], ...] = (
    terminal,
    junit,
    strict_junit,
    summary,
    results_json,
    html,
)
each_report = pytest.mark.parametrize("report", REPORTS, ids=lambda report: report.__name__)


@pytest.fixture
def own(options: ReportOptions, tmp_path: Path) -> ReportOptions:
    return replace(options, folder=tmp_path / "out", junit=tmp_path / "junit.xml")


@each_report
@pytest.mark.parametrize(
    "kind", ["passed", "failed", "flaky", "crash", "warning", "not-exercised", "interrupted", "invalid", "varied"]
)
def test_every_report_names_the_engine_of_an_outcome(
    kind: str, report: Callable[[Results, ReportOptions], str], own: ReportOptions
) -> None:
    outcomes = tuple(like(made, engine=ENGINE) for made in SAMPLES[kind].outcomes)
    assert ENGINE in report(like(SAMPLES[kind], outcomes=outcomes), own)
    without = tuple(like(made, engine=None) for made in outcomes)
    assert ENGINE not in report(like(SAMPLES[kind], outcomes=without), own)


@each_report
def test_every_report_names_all_engines_of_a_scenario(
    report: Callable[[Results, ReportOptions], str], own: ReportOptions
) -> None:
    outcomes = [
        like(made, engine=ENGINE if index % 2 else "pybullet 3.2.7")
        for index, made in enumerate(SAMPLES["varied"].outcomes)
    ]
    text = report(like(SAMPLES["varied"], outcomes=tuple(outcomes)), own)
    assert ENGINE in text
    assert "pybullet 3.2.7" in text


def measured() -> tuple[Outcome, Outcome]:
    """An outcome without and with a measurement."""
    plain = SAMPLES["passed"].outcomes[0]
    return plain, like(plain, measurements=(APART,))


@each_report
def test_every_report_shows_a_measurement(report: Callable[[Results, ReportOptions], str], own: ReportOptions) -> None:
    _, outcome = measured()
    shown = report(like(SAMPLES["passed"], outcomes=(outcome,)), own)
    assert APART.message in shown


def test_the_look_and_the_changes_of_a_measurement() -> None:
    # A measurement has a look of its own.
    for display in STATUS_DISPLAYS.values():
        for name in ("word", "headline", "symbol", "ascii_symbol", "icon"):
            assert getattr(INFORMATION, name) != getattr(display, name)
    assert (INFORMATION.junit, INFORMATION.level) == (None, None)
    # A measurement that appears or goes is no change.
    plain, outcome = measured()
    for old, new in ((plain, outcome), (outcome, plain)):
        (change,) = compare_outcomes([old], [new]).changes
        assert (change.kind, change.warnings, change.weaker) == ("still passes", 0, ())


def test_measurements_are_no_verdicts(own: ReportOptions) -> None:
    # A measurement has no tick.
    _, outcome = measured()
    results = like(SAMPLES["passed"], outcomes=(outcome,))
    for text, passed in ((terminal(results, own), "✓"), (summary(results, own), "✅"), (html(results, own), "✓")):
        (line,) = [line for line in text.splitlines() if APART.message in line]
        before = line[: line.index(APART.message)]
        assert INFORMATION.symbol in before
        assert before.rfind(passed) < before.rfind(INFORMATION.symbol)
    # A measurement is no testcase and counts nowhere.
    plain, outcome = measured()
    results = like(SAMPLES["passed"], outcomes=(outcome,))
    suites = ET.fromstring(junit(results, own))
    assert len(suites.findall(".//testcase")) == len(plain.expectations) == int(suites.attrib["tests"])
    told = {each.get("name"): each.get("value") for each in suites.findall("testsuite/properties/property")}
    assert told["information: distance to pybullet 3.2.7"] == "0.00212 m"
    assert counts_text(results) == counts_text(SAMPLES["passed"])
    assert (outcome.status, outcome.display_status, outcome.causes) == ("passed", "passed", ())


def test_measurements_in_a_quiet_report_and_in_results(own: ReportOptions) -> None:
    # Quiet shows no measurement.
    outcome = like(SAMPLES["failed"].outcomes[0], measurements=(APART,))
    results = like(SAMPLES["failed"], outcomes=(outcome,))
    assert APART.message not in terminal(results, replace(own, verbosity="quiet"))
    # Results json has the numbers.
    _, outcome = measured()
    written = json.loads(results_json(like(SAMPLES["passed"], outcomes=(outcome,)), own))
    (found,) = written["outcomes"][0]["measurements"]
    assert (found["measured"], found["unit"], found["time"]) == (0.00212, "m", 0.52)


def test_measurements_on_a_page(own: ReportOptions) -> None:
    # No part of a page has a class that the player hides.
    # A list of the class `measured` was there and invisible: the player's line of that class is hidden until used.
    style = (PACKAGE_FOLDER / "reports/viewer/page.css").read_text(encoding="utf-8")
    hidden = set(re.findall(r"^\.([\w-]+) \{[^}]*(?:visibility: hidden|display: none)", style, re.MULTILINE))
    assert hidden
    _, outcome = measured()
    for results in (*SAMPLES.values(), like(SAMPLES["passed"], outcomes=(outcome,))):
        used = {name for names in re.findall(r' class="?([\w -]+)', html(results, own)) for name in names.split()}
        assert used & hidden == set()
    # The margins of a factor are bars below a heading of their own.
    of_factor = like(APART, left=(None, 0.25))
    plain, bars = (
        html(like(SAMPLES["passed"], outcomes=(like(measured()[0], measurements=(one,)),)), own)
        for one in (APART, of_factor)
    )
    assert (">Margins<" in plain, INFORMATION.headline in plain) == (False, True)
    assert (">Margins<" in bars, INFORMATION.headline in bars) == (True, False)
    assert 'width="25.0"' in bars

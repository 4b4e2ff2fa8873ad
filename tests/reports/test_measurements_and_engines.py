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


REPORTS = (terminal, junit, strict_junit, summary, results_json, html)
Report = Callable[[Results, ReportOptions], str]
each_report = pytest.mark.parametrize("report", REPORTS, ids=lambda report: report.__name__)


@pytest.fixture
def own(options: ReportOptions, tmp_path: Path) -> ReportOptions:
    return replace(options, folder=tmp_path / "out", junit=tmp_path / "junit.xml")


@each_report
@pytest.mark.parametrize(
    "kind", ["passed", "failed", "flaky", "crash", "warning", "not-exercised", "interrupted", "invalid", "varied"]
)
def test_every_report_names_the_engine_of_an_outcome(kind: str, report: Report, own: ReportOptions) -> None:
    outcomes = tuple(like(made, engine=ENGINE) for made in SAMPLES[kind].outcomes)
    assert ENGINE in report(like(SAMPLES[kind], outcomes=outcomes), own)
    without = tuple(like(made, engine=None) for made in outcomes)
    assert ENGINE not in report(like(SAMPLES[kind], outcomes=without), own)


@each_report
def test_every_report_names_all_engines_of_a_scenario_and_shows_a_measurement(
    report: Report, own: ReportOptions
) -> None:
    outcomes = [
        like(made, engine=ENGINE if index % 2 else "pybullet 3.2.7")
        for index, made in enumerate(SAMPLES["varied"].outcomes)
    ]
    text = report(like(SAMPLES["varied"], outcomes=tuple(outcomes)), own)
    assert ENGINE in text
    assert "pybullet 3.2.7" in text
    assert APART.message in report(MEASURED, own)


PLAIN = SAMPLES["passed"].outcomes[0]
WITH_ONE = like(PLAIN, measurements=(APART,))
MEASURED = like(SAMPLES["passed"], outcomes=(WITH_ONE,))


def test_the_look_and_the_changes_of_a_measurement() -> None:
    # A measurement has a look of its own.
    for display in STATUS_DISPLAYS.values():
        for name in ("word", "headline", "symbol", "ascii_symbol", "icon"):
            assert getattr(INFORMATION, name) != getattr(display, name)
    assert (INFORMATION.junit, INFORMATION.level) == (None, None)
    # A measurement that appears or goes is no change.
    for old, new in ((PLAIN, WITH_ONE), (WITH_ONE, PLAIN)):
        (change,) = compare_outcomes([old], [new]).changes
        assert (change.kind, change.warnings, change.weaker) == ("still passes", 0, ())


def test_measurements_are_no_verdicts(own: ReportOptions) -> None:
    # A measurement has no tick.
    for text, passed in ((terminal(MEASURED, own), "✓"), (summary(MEASURED, own), "✅"), (html(MEASURED, own), "✓")):
        (line,) = [line for line in text.splitlines() if APART.message in line]
        before = line[: line.index(APART.message)]
        assert INFORMATION.symbol in before
        assert before.rfind(passed) < before.rfind(INFORMATION.symbol)
    # A measurement is no testcase and counts nowhere.
    suites = ET.fromstring(junit(MEASURED, own))
    assert len(suites.findall(".//testcase")) == len(PLAIN.expectations) == int(suites.attrib["tests"])
    values = {each.get("name"): each.get("value") for each in suites.findall("testsuite/properties/property")}
    assert values["information: distance to pybullet 3.2.7"] == "0.00212 m"
    assert counts_text(MEASURED) == counts_text(SAMPLES["passed"])
    assert (WITH_ONE.status, WITH_ONE.display_status, WITH_ONE.causes) == ("passed", "passed", ())


def test_measurements_in_a_quiet_report_and_in_results(own: ReportOptions) -> None:
    # Quiet shows no measurement.
    outcome = like(SAMPLES["failed"].outcomes[0], measurements=(APART,))
    results = like(SAMPLES["failed"], outcomes=(outcome,))
    assert APART.message not in terminal(results, replace(own, verbosity="quiet"))
    # Results json has the numbers.
    written = json.loads(results_json(MEASURED, own))
    (apart,) = written["outcomes"][0]["measurements"]
    assert (apart["measured"], apart["unit"], apart["time"]) == (0.00212, "m", 0.52)


def test_measurements_on_a_page(own: ReportOptions) -> None:
    # No part of a page has a class that the player hides.
    # A list of the class `measured` was there and invisible: the player's line of that class is hidden until used.
    style = (PACKAGE_FOLDER / "reports/viewer/page.css").read_text(encoding="utf-8")
    hidden = set(re.findall(r"^\.([\w-]+) \{[^}]*(?:visibility: hidden|display: none)", style, re.MULTILINE))
    assert hidden
    for results in (*SAMPLES.values(), MEASURED):
        used = {name for names in re.findall(r' class="?([\w -]+)', html(results, own)) for name in names.split()}
        assert used & hidden == set()
    # The margins of a factor are bars below a heading of their own.
    of_factor = like(APART, left=(None, 0.25))
    plain, bars = html(MEASURED, own), html(like(MEASURED, outcomes=(like(PLAIN, measurements=(of_factor,)),)), own)
    assert (">Margins<" in plain, INFORMATION.headline in plain) == (False, True)
    assert (">Margins<" in bars, INFORMATION.headline in bars) == (True, False)
    assert 'width="25.0"' in bars

"""The titles that three reporters on GitHub make of the JUnit XML, after their source, and that they are unique.

Each function follows the code of one version, with the settings of our templates, which are its defaults here.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace

import pytest

from sim_action.core.errors import Location
from sim_action.reports import ReportOptions
from sim_action.reports.junit import write_junit
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from tests.outcomes import like
from tests.reports.samples import SAMPLES, results_of


def mikepenz(root: ET.Element) -> list[str]:
    """mikepenz/action-junit-report v6.4.2, src/testParser.ts: createTestCaseAnnotation, without a title template."""
    titles = []
    for suite in root.iter("testsuite"):
        for case in suite.iter("testcase"):
            name, classname = case.attrib["name"], case.get("classname") or case.attrib["name"]
            file = case.get("file") or suite.get("file") or classname.split(".")[-1]
            titles.append(name if file == name else f"{file}.{name}")
    return titles


def enricomi(root: ET.Element) -> list[str]:
    """EnricoMi/publish-unit-test-result-action v2.24.0, python/publish/__init__.py: get_case_annotation."""
    cases = [(case.attrib["name"], case.get("classname")) for case in root.iter("testcase")]
    return [f"{name} ({classname})" if classname else name for name, classname in cases]


def dorny(root: ET.Element) -> list[str]:
    """dorny/test-reporter v3.0.0, src/parsers/java-junit/java-junit-parser.ts and src/report/get-annotations.ts."""
    titles = []
    for suite in root.iter("testsuite"):
        name = suite.attrib["name"].strip()
        for case in suite.iter("testcase"):
            group = "" if case.get("classname") == suite.get("name") else case.get("classname")
            test = case.attrib["name"].strip()
            titles.append(f"{name} \u25ba {group} \u25ba {test}" if group else f"{name} \u25ba {test}")
    return titles


REPORTERS = [mikepenz, enricomi, dorny]


def alike(name: str, line: int, file: str = "scenarios/two.sim.yml") -> Outcome:
    """Return a scenario with the same expectations as each other one."""
    outcome = SAMPLES["failed"].outcomes[2]
    expected = [like(each, location=Location(file, line, 5)) for each in outcome.expectations]
    return like(outcome, name=name, file=file, line=line, expectations=tuple(expected))


Reporter = Callable[[ET.Element], list[str]]


def titles_of(reporter: Reporter, results: Results, options: ReportOptions) -> list[str]:
    write_junit(results, options)
    return reporter(ET.parse(options.junit).getroot())


@pytest.mark.parametrize("strict", [False, True])
@pytest.mark.parametrize("reporter", REPORTERS)
def test_scenarios_of_one_file_have_different_titles(reporter: Reporter, strict: bool, options: ReportOptions) -> None:
    results = results_of(alike("drives", 3), alike("turns", 20))
    first, second = titles_of(reporter, results, replace(options, junit_strict=strict))
    assert first != second
    assert "drives" in first
    assert "turns" in second
    assert all("travel at least 1.5 m" in title and "scenarios/two" in title for title in (first, second))


@pytest.mark.parametrize("reporter", REPORTERS)
def test_titles_are_unique_in_every_report(reporter: Reporter, kind: str, options: ReportOptions) -> None:
    titles = titles_of(reporter, SAMPLES[kind], options)
    assert len(set(titles)) == len(titles)


def test_titles_as_a_reviewer_sees_them(options: ReportOptions) -> None:
    results = results_of(alike("drives", 3))
    assert [titles_of(reporter, results, options) for reporter in REPORTERS] == [
        ["scenarios/two.sim.yml.drives: travel at least 1.5 m"],
        ["drives: travel at least 1.5 m (scenarios/two)"],
        ["drives \u25ba scenarios/two \u25ba drives: travel at least 1.5 m"],
    ]

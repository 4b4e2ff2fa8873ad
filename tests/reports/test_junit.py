from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from junitparser import Failure, JUnitXml, TestSuite

from sim_action.core.errors import Location
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import plain_text
from sim_action.reports.junit import PackedParts, write_junit
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.results.results_json import Results
from tests.outcomes import like
from tests.reports.samples import PROVENANCE, SAMPLES, results_of
from tests.soak import examples

Golden = Callable[[str, str], None]


def written(results: Results, options: ReportOptions) -> ET.Element:
    write_junit(results, options)
    return ET.parse(options.junit).getroot()


def test_golden(kind: str, options: ReportOptions, golden: Golden) -> None:
    write_junit(SAMPLES[kind], options)
    golden(f"{kind}.xml", options.junit.read_text(encoding="utf-8") + "\n")


@pytest.mark.parametrize("strict", [False, True])
def test_totals_are_counts_of_testcases(kind: str, strict: bool, options: ReportOptions) -> None:
    root = written(SAMPLES[kind], replace(options, junit_strict=strict))
    for parent in (root, *root.iter("testsuite")):
        assert int(parent.attrib["tests"]) == len(list(parent.iter("testcase")))
        assert int(parent.attrib["failures"]) == len(list(parent.iter("failure")))
        assert int(parent.attrib["errors"]) == len(list(parent.iter("error")))


def test_events_and_actors_are_properties_of_the_suite(options: ReportOptions) -> None:
    outcome = like(SAMPLES["passed"].outcomes[0], events={"it passes": (1.5,)}, actors={"cart": "cart.urdf"})
    properties = written(results_of(outcome), options).iter("property")
    values = {each.attrib["name"]: each.attrib["value"] for each in properties}
    assert (values["event: it passes"], values["actor: cart"]) == ("1.500 s", "cart.urdf")


def test_junitparser_reads_it(options: ReportOptions) -> None:
    write_junit(SAMPLES["failed"], options)
    report = JUnitXml.fromfile(str(options.junit))
    suites = [suite for suite in report if isinstance(suite, TestSuite)]
    assert (report.tests, report.failures, report.errors) == (6, 3, 0)
    assert [suite.name for suite in suites] == [outcome.name for outcome in SAMPLES["failed"].outcomes]
    failure = next(iter(suites[2])).result[0]
    assert isinstance(failure, Failure)
    assert failure.type == "travel"
    assert failure.message == "travelled 1.12 m of 1.5 m in 30.0 s"


@pytest.mark.parametrize(
    ("file", "frame"),
    [
        ("a/my robot/x.sim.yml", "at my robot.Scenario(x.sim.yml:8)"),
        *((f"{folder}x.sim.yml", None) for folder in ("", "v1.2/", "Robot/", "2nd/")),
    ],
)
def test_place_as_a_java_frame_where_there_can_be_one(file: str, frame: str | None, options: ReportOptions) -> None:
    outcome = SAMPLES["failed"].outcomes[2]
    (expected,) = outcome.expectations
    moved = like(expected, location=Location(file, 8, 5))
    failure = written(results_of(like(outcome, expectations=(moved,))), options).find(".//failure")
    assert failure is not None
    frames = [line for line in (failure.text or "").splitlines() if ".Scenario(" in line]
    assert frames == ([frame] if frame else [])


def test_names_are_unique_and_times_add_up(kind: str, options: ReportOptions) -> None:
    # Names are unique.
    cases = written(SAMPLES[kind], options).iter("testcase")
    assert all(count == 1 for count in Counter((case.get("classname"), case.get("name")) for case in cases).values())
    # Times of testcases add up.
    for suite in written(SAMPLES[kind], options).iter("testsuite"):
        times = [case.attrib["time"] for case in suite.iter("testcase")]
        assert all(re.fullmatch(r"\d+\.\d{3}", time) for time in times)
        assert sum(map(float, times)) == pytest.approx(float(suite.attrib["time"]))


def test_folders_are_made_and_nothing_else_is_left(options: ReportOptions, tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "junit.xml"
    path.parent.mkdir(parents=True)
    path.write_text("before")
    write_junit(SAMPLES["passed"], replace(options, junit=path))
    assert list(path.parent.iterdir()) == [path]
    assert ET.parse(path).getroot().tag == "testsuites"
    # No suite is empty.
    outcome = Outcome(name="a", file="a.sim.yml", status="error")
    assert written(results_of(outcome), options).get("errors") == "1"


# The rules of Jenkins' junit-10.xsd: attributes and children by element; properties have no children but property.
ATTRIBUTES = {
    "testsuites": {"name", "time", "tests", "failures", "errors"},
    "testsuite": {
        *("name", "tests", "failures", "errors", "group", "time", "skipped", "timestamp", "hostname", "id"),
        *("package", "file", "log", "url"),
    },
    "testcase": {"name", "time", "classname", "group"},
    "properties": set(),
    "property": {"name", "value"},
    "failure": {"type", "message"},
    "error": {"type", "message"},
    "skipped": {"type", "message"},
    "system-out": set(),
    "system-err": set(),
}
CHILDREN = {
    "testsuites": {"testsuite"},
    "testsuite": {"testsuite", "properties", "testcase", "system-out", "system-err"},
    "testcase": {"skipped", "error", "failure", "system-out", "system-err"},
    "properties": {"property"},
}
REQUIRED = {"testsuite": {"name", "tests", "failures", "errors"}, "testcase": {"name"}, "property": {"name", "value"}}
SUREFIRE_TIME = re.compile(r"(([0-9]{0,3},)*[0-9]{3}|[0-9]{0,3})*(\.[0-9]*)?")


def test_strict_mode(kind: str, options: ReportOptions) -> None:
    # Strict mode keeps the schema.
    for element in written(SAMPLES[kind], replace(options, junit_strict=True)).iter():
        assert set(element.attrib) <= ATTRIBUTES[element.tag]
        assert set(element.attrib) >= REQUIRED.get(element.tag, set())
        assert {child.tag for child in element} <= CHILDREN.get(element.tag, set())
        assert SUREFIRE_TIME.fullmatch(element.get("time", ""))
    # Strict mode drops nothing else.
    full = written(SAMPLES[kind], options)
    strict = written(SAMPLES[kind], replace(options, junit_strict=True))
    for case in full.iter("testcase"):
        for name in ("file", "line"):
            case.attrib.pop(name, None)
        for properties in case.findall("properties"):
            case.remove(properties)
    ET.indent(full)
    ET.indent(strict)
    assert ET.tostring(full) == ET.tostring(strict)


def test_a_suite_says_when_the_call_started_and_where(options: ReportOptions) -> None:
    started = datetime(2026, 11, 6, 8, 30, tzinfo=UTC)
    for strict in (False, True):
        outcomes = [like(each, provenance=like(PROVENANCE, host="runner-1\x01")) for each in SAMPLES["failed"].outcomes]
        results = results_of(*outcomes).model_copy(update={"started_at": started})
        suites = written(results, replace(options, junit_strict=strict)).findall("testsuite")
        said = {(suite.get("timestamp"), suite.get("hostname")) for suite in suites}
        assert said == {("2026-11-06T08:30:00+00:00", "runner-1")}


@settings(examples(50), suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(text=st.text())
def test_any_text_survives_as_text(text: str, options: ReportOptions) -> None:
    outcome = SAMPLES["failed"].outcomes[2]
    (expected,) = outcome.expectations
    verdict = replace(expected.verdict, message=text)
    hostile: ExpectationOutcome = like(expected, name=text, verdict=verdict)
    changed = {"name": text, "file": f"{text}.yml", "expectations": (hostile,), "output": text}
    failure = written(results_of(like(outcome, **changed)), options).find(".//failure")
    assert failure is not None
    assert failure.get("message") == plain_text(text)


def test_what_was_added_comes_back_in_its_order() -> None:
    parts, added = PackedParts(), [str(number).encode() * 50_000 for number in range(30)]
    assert not b"".join(parts)
    for part in added:
        parts.add(part)
    assert b"".join(parts) == b"".join(parts) == b"".join(added)

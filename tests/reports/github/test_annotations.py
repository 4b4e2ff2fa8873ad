from __future__ import annotations

import contextlib
import io
import re
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim_action.core.errors import Location
from sim_action.reports import ReportOptions
from sim_action.reports.github.annotations import complaint, write_annotations
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from tests.outcomes import like
from tests.reports.samples import SAMPLES, results_of

ON_GITHUB = {"GITHUB_ACTIONS": "true"}
COMMAND = re.compile(r"::(error|warning) (?:[a-z]+=[^:,\r\n]*,)*title=[^:,\r\n]*::[^\r\n]*")


def lines(results: Results, options: ReportOptions) -> list[str]:
    with contextlib.redirect_stdout(io.StringIO()) as stream:
        write_annotations(results, replace(options, environment=ON_GITHUB))
    text = stream.getvalue()
    assert text == "" or text.endswith("\n")
    return text.split("\n")[:-1]


def test_a_failure_stands_on_the_line_of_its_assertion(options: ReportOptions) -> None:
    error, warning = lines(SAMPLES["failed"], options)[-2:]
    assert error == (
        "::error file=scenarios/straight.sim.yml,line=8,col=5,title=burger drives straight%3A travel at least 1.5 m"
        "::travelled 1.12 m of 1.5 m in 30.0 s"
    )
    assert warning == (
        "::warning file=scenarios/wall.sim.yml,line=14,col=5,title=burger stops before the wall%3A stays up"
        "::tilted 30 deg at 1.25 s, more than 20 deg"
    )


def test_what_was_never_judged_is_an_error_on_its_line(options: ReportOptions) -> None:
    found = lines(SAMPLES["not-exercised"], options)
    place = "file=scenarios/wall.sim.yml,line=17,col=5"
    assert (
        f"::error {place},title=burger watches the wall%3A range stays above 0.2 m"
        "::never checked: sensor 'lidar' had no reading; lower its rate or run for longer"
    ) in found
    (varied,) = (line for line in found if "title=push" in line)
    assert varied.startswith(f"::error {place},title=push%3A range stays above 0.2 m::2 of 3 variations; the worst, ")
    (warning,) = (line for line in found if line.startswith("::warning"))
    assert warning == (
        f"::warning {place},title=burger may miss readings%3A range stays above 0.2 m"
        "::never checked: sensor 'lidar' had no reading; lower its rate or run for longer"
    )


def test_what_ended_a_run_comes_before_what_that_cut_off(options: ReportOptions) -> None:
    cause, cut_off = lines(SAMPLES["cut"], options)
    assert "title=burger hits the wall%3A no_collision::base_link touched wall" in cause
    assert cut_off.endswith("when the run ended")


def test_each_problem_of_an_invalid_scenario(options: ReportOptions) -> None:
    found = lines(SAMPLES["invalid"], options)
    assert [line.split(",")[1] for line in found] == ["line=9", "line=7"]


def test_what_happened_to_several_variations_is_told_once(options: ReportOptions) -> None:
    (line,) = lines(SAMPLES["varied"], options)
    assert line == (
        "::error file=scenarios/straight.sim.yml,line=8,col=5,title=push%3A travel at least 1.5 m"
        "::2 of 4 variations; the worst, [friction=0.1,yaw=2.78deg]: travelled 0.75 m of 1.5 m in 30.0 s"
    )


def test_what_was_not_run_is_no_annotation(options: ReportOptions) -> None:
    assert [re.findall(r"title=([^,:]*)", line)[0] for line in lines(SAMPLES["skipped"], options)] == [
        "burger drives straight%3A travel at least 1.5 m",
        "push%3A travel at least 1.5 m",
    ]


def test_a_warning_of_the_audit_stands_on_its_line_once_for_all_variations(options: ReportOptions) -> None:
    found = [line for line in lines(SAMPLES["audited"], options) if line.startswith("::warning")]
    place = "file=scenarios/straight.sim.yml,line=9,col=5"
    assert [line for line in found if place in line] == [
        (
            f"::warning {place},title=push%3A nothing-to-touch::2 of 2 variations; the worst, [friction=0.8,yaw=0deg]: "
            "the world has no objects, so the robot can touch nothing; add objects, or remove no_collision"
        ),
        (
            f"::warning {place},title=burger drives straight%3A nothing-to-touch::the world has no objects, "
            "so the robot can touch nothing; add objects, or remove no_collision"
        ),
    ]


def test_without_a_place_it_is_the_file(options: ReportOptions) -> None:
    (line,) = lines(SAMPLES["crash"], options)
    assert line.startswith("::error file=scenarios/wall.sim.yml,title=burger falls apart%3A SIGSEGV::the process")


def test_nothing_outside_of_github(options: ReportOptions, capsys: pytest.CaptureFixture[str]) -> None:
    write_annotations(SAMPLES["failed"], options)
    assert capsys.readouterr().out == ""


def test_nothing_of_what_passed(options: ReportOptions) -> None:
    assert lines(SAMPLES["passed"], options) == []


@pytest.mark.parametrize(("count", "shown", "last"), [(10, 10, None), (11, 10, "2 more"), (40, 10, "31 more")])
def test_at_most_ten_of_each(*, count: int, shown: int, last: str | None, options: ReportOptions) -> None:
    failed, warned = SAMPLES["failed"].outcomes[2], SAMPLES["warning"].outcomes[0]
    found = lines(results_of(*[warned] * count, *[failed] * count), options)
    for level in ("error", "warning"):
        chosen = [line for line in found if line.startswith(f"::{level} ")]
        assert len(chosen) == shown
        if last:
            assert chosen[-1] == f"::{level} title=sim-action::{last} {level}s: see the job summary"
        else:
            assert "more" not in chosen[-1].rsplit("::", 1)[0]


def test_at_most_4096_characters(options: ReportOptions) -> None:
    (failure,) = SAMPLES["crash"].outcomes[0].failures
    long = like(failure, message="%" * 5000)
    crashed = like(SAMPLES["crash"].outcomes[0], failures=(long,))
    (line,) = lines(results_of(crashed), options)
    assert 4090 < len(line) <= 4096
    assert re.search(r"(%25)+…$", line)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(name=st.text(), message=st.text(), file=st.text())
def test_one_line_and_one_command_each(*, name: str, message: str, file: str, options: ReportOptions) -> None:
    (failure,) = SAMPLES["crash"].outcomes[0].failures
    hostile = like(failure, title=name, message=message, location=Location(file, 1))
    outcome = Outcome(name=name, file=file, status="error", failures=(hostile,))
    (line,) = lines(results_of(outcome), options)
    assert COMMAND.fullmatch(line)
    assert len(line.splitlines()) == 1


def test_a_complaint_is_one_line_and_on_github_an_annotation() -> None:
    message = "no scenario in 'a\n::error::b ##[error]c'"
    assert complaint(message, {}) == "sim-action: no scenario in 'a\\n::error::b # #[error]c'"
    on_github = complaint(message, {"GITHUB_ACTIONS": "true"})
    assert on_github == "::error title=sim-action::no scenario in 'a%0A::error::b # #[error]c'"


def test_it_says_where_in_the_report_that_is(options: ReportOptions) -> None:
    outcome = like(SAMPLES["cut"].outcomes[0], replay="replays/a.json.gz")
    cause, _ = lines(results_of(outcome), options)
    assert cause.endswith("with 4.1 N (replay at 3.20 s: report.html#scenario=burger%2520hits%2520the%2520wall&t=3.2)")


def test_a_crash_leads_to_what_there_is_of_the_run(options: ReportOptions) -> None:
    outcome = like(SAMPLES["crash"].outcomes[0], replay="replays/a.json.gz")
    (line,) = lines(results_of(outcome), options)
    assert line.endswith("(replay: report.html#scenario=burger%2520falls%2520apart)")

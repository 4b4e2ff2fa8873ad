from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Callable
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


def test_golden(kind: str, options: ReportOptions, golden: Callable[[str, str], None]) -> None:
    golden(f"{kind}-annotations.txt", "".join(f"{line}\n" for line in lines(SAMPLES[kind], options)))


def test_nothing_outside_of_github(options: ReportOptions, capsys: pytest.CaptureFixture[str]) -> None:
    write_annotations(SAMPLES["failed"], options)
    assert capsys.readouterr().out == ""


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


@settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
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


def test_links_to_the_report(options: ReportOptions) -> None:
    # It says where in the report that is.
    outcome = like(SAMPLES["cut"].outcomes[0], replay="replays/a.json.gz")
    (cause,) = lines(results_of(outcome), options)
    assert cause.endswith("with 4.1 N (replay at 3.20 s: report.html#scenario=burger%2520hits%2520the%2520wall&t=3.2)")
    # A crash leads to what there is of the run.
    outcome = like(SAMPLES["crash"].outcomes[0], replay="replays/a.json.gz")
    (line,) = lines(results_of(outcome), options)
    assert line.endswith("(replay: report.html#scenario=burger%2520falls%2520apart)")

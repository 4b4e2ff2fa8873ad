"""The article of one scenario in report.html."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sim_action.recording.replay.sightings import SightingData
from sim_action.reports import ReportOptions
from sim_action.reports.html.scenario_article import run_reasons
from sim_action.results.outcome import Failure, Outcome
from tests.outcomes import like, outcome


@pytest.mark.parametrize(("count", "shown", "left"), [(20, 20, ""), (23, 20, "3 more errors are in results.json.")])
def test_the_first_twenty_errors_are_shown(count: int, shown: int, left: str, options: ReportOptions) -> None:
    failures = tuple(Failure(kind="invalid", title="invalid", message=f"problem-{index};") for index in range(count))
    html = str(run_reasons(Outcome(name="a", file="a.sim.yml", status="error", failures=failures), options, {}))
    assert [index for index in range(count) if f"problem-{index};" in html] == list(range(shown))
    assert ("more errors" in html) == bool(left)
    assert left in html


@pytest.mark.parametrize(
    ("body", "words"), [("pallet", "first seen by skirt (lidar) at 1.40 s"), ("wall", ""), ("", "")]
)
def test_a_failure_names_the_sensor_that_saw_its_body_first(body: str, words: str, options: ReportOptions) -> None:
    made = outcome("a.sim.yml", holds=False)
    [expected] = made.expectations
    hit = like(expected, verdict=replace(expected.verdict, body=body))
    seen = {"pallet": SightingData(sensor="skirt", kind="lidar", time=1.4)}
    html = run_reasons(like(made, expectations=(hit,)), options, seen)
    assert ("first seen" in html) == bool(words)
    assert words in html

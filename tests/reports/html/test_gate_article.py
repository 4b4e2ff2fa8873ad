"""The articles of gates and of variations."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest

from sim_action.reports import ReportOptions
from sim_action.reports.html.gate_article import GroupPlace, gate_article, rate_figure, variations_article
from sim_action.reports.scenario_groups import grouped_scenarios
from sim_action.results.outcome import GateStatistics
from sim_action.results.results_json import Results
from tests.reports.html.gates import GATES, failed_gate, run


def written(results: Results, options: ReportOptions, replayed: frozenset[str] = frozenset({"s1"})) -> str:
    (group,) = grouped_scenarios(results.outcomes, results.gates)
    ids = {id(outcome): f"s{number}" for number, outcome in enumerate(group.worst_first(), start=1)}
    place = GroupPlace("s0", ids, replayed, is_plotted=True)
    assert group.gate is not None
    return gate_article(group, group.gate, place, options)


@pytest.mark.parametrize("kind", GATES)
def test_golden(kind: str, options: ReportOptions, golden: Callable[[str, str], None]) -> None:
    golden(f"gate-article-{kind}.html", f"{written(GATES[kind](), options)}\n")


def test_runs_that_the_page_leaves_out_are_counted(options: ReportOptions) -> None:
    results = failed_gate()
    (group,) = grouped_scenarios(results.outcomes)
    place = GroupPlace("s0", {id(group.outcomes[3]): "s1"}, frozenset(), is_plotted=False)
    assert group.gate is not None
    text = gate_article(group, group.gate, place, options)
    assert "29 more runs in results.json." in text
    assert "<details" not in text
    assert 'class="claim"' not in text


def test_variations_have_their_parameters_as_columns(options: ReportOptions) -> None:
    runs = [run(number, 0.1, gate=None) for number in range(4)]
    (group,) = grouped_scenarios(runs)
    place = GroupPlace("s0", {id(each): f"s{number}" for number, each in enumerate(runs, 1)}, frozenset(), True)
    text = variations_article(group, place, options)
    assert re.findall(r'<th scope="col">(.*?)</th>', text) == [
        "Run",
        "friction",
        "yaw",
        "floor",
        "Nearest limit",
        "Margin",
        "Replay",
    ]
    assert "Variations: 4 of 4 passed" in text
    assert '<td data-title="yaw">-10 deg</td>' in text


@pytest.mark.parametrize(("lower", "upper"), [(0.0, 1.0), (0.95, 1.0), (0.0, 0.01), (0.5, 0.5)])
def test_the_drawing_of_a_rate_stays_in_its_frame(lower: float, upper: float) -> None:
    statistics = GateStatistics(
        planned=9,
        runs=9,
        passed=5,
        failed=4,
        errors=0,
        not_exercised=0,
        rate=upper,
        confidence=0.9,
        lower=lower,
        upper=upper,
    )
    text = rate_figure(statistics, None, "passed")
    assert all(0 <= float(x) <= 360 for x in re.findall(r' (?:x|x1|x2|cx)="(.*?)"', text))
    assert "NaN" not in text

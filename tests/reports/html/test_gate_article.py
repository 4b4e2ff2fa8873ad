"""The articles of gates and of variations."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from sim_action.reports import ReportOptions
from sim_action.reports.html.gate_article import (
    GroupPlace,
    gate_article,
    has_plot,
    parameters,
    rate_figure,
    sweep,
    variations_article,
)
from sim_action.reports.scenario_groups import grouped_scenarios
from sim_action.results.outcome import GateStatistics, Outcome
from sim_action.results.results_json import Results
from sim_action.scenario.source import Varied
from tests.outcomes import like
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
    heads = re.findall(r'<th scope="col">(.*?)</th>', text)
    assert heads == ["Run", "friction", "yaw", "floor", "Nearest limit", "Margin", "Replay"]
    assert "Variations: 4 of 4 passed" in text
    assert '<td data-title="yaw">-10 deg</td>' in text


@pytest.mark.parametrize(("lower", "upper"), [(0.0, 1.0), (0.95, 1.0), (0.0, 0.01), (0.5, 0.5)])
def test_the_drawing_of_a_rate_stays_in_its_frame(lower: float, upper: float) -> None:
    counts: dict[str, Any] = {"planned": 9, "runs": 9, "passed": 5, "failed": 4, "errors": 0, "not_exercised": 0}
    statistics = GateStatistics(**counts, rate=upper, confidence=0.9, lower=lower, upper=upper)
    text = rate_figure(statistics, None, "passed")
    assert all(0 <= float(x) <= 360 for x in re.findall(r' (?:x|x1|x2|cx)="(.*?)"', text))
    assert "NaN" not in text


def varied(*values: Any, key: str = "world.ground.friction") -> list[Outcome]:
    return [run(number, 0.1, variation=(Varied(key, value),)) for number, value in enumerate(values)]


def test_numbers_are_in_si_and_texts_are_for_people() -> None:
    friction, yaw, floor = parameters([run(0, 0.1), run(10, 0.1)])
    assert (friction.label, friction.unit, friction.texts) == ("friction", "", ("0.1", "0.2"))
    assert (yaw.label, yaw.unit, yaw.texts) == ("yaw", "rad", ("-10 deg", "0 deg"))
    assert list(yaw.numbers) == pytest.approx([-math.pi / 18, 0.0])
    assert (floor.numbers, floor.categories, floor.is_plotted) == ((), ["wet"], False)


@pytest.mark.parametrize("value", ["wet", True, None, [1, 2], {"a": 1}, "3 parsec", 10**400])
def test_a_parameter_with_another_value_has_categories(value: Any) -> None:
    (parameter,) = parameters(varied(1, value, 1))
    assert parameter.numbers == ()
    assert parameter.packed()["values"] == [0.0, 1.0, 0.0]


def test_values_of_parameters() -> None:
    # Values of different units are categories.
    (parameter,) = parameters(varied("1 m", "1 s", 3))
    assert parameter.categories == ["1 m", "1 s", "3"]
    # A number without a unit is in si.
    (parameter,) = parameters(varied("10 cm", 0.2, 0))
    assert (parameter.unit, parameter.numbers) == ("m", (0.1, 0.2, 0.0))
    # A run that lacks a key has no value.
    lacks = run(9, 0.1, variation=())
    (parameter,) = parameters([*varied(1, 2), lacks])
    assert parameter.packed()["values"] == [1.0, 2.0, None]


def test_plots_of_what_runs_measured() -> None:
    # What runs measured is packed with the articles.
    runs = [run(0, 0.15), run(1, -0.3), run(2, None)]
    data = sweep(runs, {id(runs[0]): "s4"}, 0.9)
    assert data is not None
    series = {each["name"]: each["values"] for each in json.loads(json.dumps(data))["series"]}
    assert series == {
        "smallest margin": [10.0, -20.0, None],
        "margin: travel at least 1.5 m": [0.15, -0.3, None],
        "measured: travel at least 1.5 m": [1.65, 1.2, None],
    }
    assert data["statuses"] == ["passed", "failed", "error"]
    assert data["entries"] == ["s4", None, None]
    assert data["claim"] == 0.9

    # A goal that came true has no margin.
    def met(number: int, margin: float) -> Outcome:
        made = run(number, margin)
        [expected] = made.expectations
        goal = like(expected, verdict=replace(expected.verdict, goal=True))
        return like(made, expectations=(goal,))

    data = sweep([met(0, 0.15), met(1, -0.3), met(2, 0.001)], {}, None)
    assert data is not None
    assert json.loads(json.dumps(data))["series"][0]["values"] == [0.0, -20.0, 0.0]
    # Values that no browser reads are left out.
    runs = [run(0, math.inf), run(1, math.nan), run(2, 0.1)]
    data = sweep(runs, {}, None)
    json.dumps(data, allow_nan=False)


@pytest.mark.parametrize("values", [(1, 2), (1, 1, 1), ("a", "b", "c"), (), (None, None, None)])
def test_without_numbers_that_vary_there_is_no_plot(values: tuple[Any, ...]) -> None:
    runs = varied(*values)
    assert not has_plot(runs)
    assert sweep(runs, {}, None) is None

"""Which articles a page has, and the list of them."""

from __future__ import annotations

import re

from sim_action.reports.html.navigation import PagePlan, planned_page, scenario_list
from sim_action.reports.scenario_groups import grouped_scenarios
from sim_action.results.outcome import Outcome
from tests.outcomes import outcome
from tests.reports.html.gates import failed_gate, passed_gate, run


def planned(*outcomes: Outcome, most: int = 2000) -> PagePlan:
    return planned_page(grouped_scenarios(outcomes), most)


def test_a_gate_is_followed_by_its_runs_the_worst_first() -> None:
    results = passed_gate()
    entries = planned(*results.outcomes).entries
    assert [entry.kind for entry in entries] == ["gate", *["sample"] * 61]
    assert entries[1].outcome is results.outcomes[61]
    assert entries[2].outcome is results.outcomes[1]


def test_variations_with_numbers_have_an_article_together() -> None:
    runs = [run(number, 0.1, gate=None) for number in range(3)]
    first, second, *_ = planned(*runs).entries
    assert (first.kind, first.name) == ("variations", "push")
    assert (second.kind, second.name) == ("scenario", "push[friction=0.1,yaw=-10deg]")
    assert [entry.kind for entry in planned(*runs[:2]).entries] == ["scenario", "scenario"]


def test_failures_have_the_first_right_to_a_replay_and_those_that_count_before_samples() -> None:
    gate = failed_gate()
    alone, lost = outcome("a.sim.yml"), outcome("b.sim.yml", holds=False)
    plan = planned(*gate.outcomes, alone, lost)
    assert plan.runs[0] is lost
    assert [each.status for each in plan.runs[1:16]] == ["failed"] * 15
    assert plan.runs[16] is alone
    short = planned(*gate.outcomes, alone, lost, most=3)
    assert (len(short.runs), short.left) == (3, 29)
    assert [entry.kind for entry in short.entries] == ["gate", "sample", "sample", "scenario"]


def test_the_entries_of_gates() -> None:
    # A gate and a scenario of one name have different addresses.
    gate = failed_gate()
    plan = planned(*gate.outcomes, outcome("push.sim.yml"))
    assert [entry.number for entry in plan.entries if entry.name == "push"] == [1, 2]
    # A gate is one entry with its runs in neutral marks below.
    results = failed_gate()
    text = scenario_list(planned(*results.outcomes), results)
    assert "<summary>1 gate</summary>" in text
    assert re.findall(r'<span class="mark (\w+)"', text) == ["failed"]
    assert "gate: 15 of 30 runs passed (50 %)" in text
    assert text.count('<span class="mark" ') == 30

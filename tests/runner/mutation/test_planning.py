"""The plan of a proof: which scenarios, which mutants, what they cost, and which fit into a budget."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario, UsageError
from sim_action.core.records import replace
from sim_action.runner.mutation.planning import cost, first_runs, planned, refuse_unknown, refuse_unmatched, within
from sim_action.scenario.source import Refused
from tests.runner.mutation.runs import original
from tests.scenarios import LEAST, load


def test_the_first_variation_on_the_first_engine_is_proven(tmp_path: Path) -> None:
    plain = load(tmp_path, LEAST)
    varied = replace(plain.source, group="burger")
    several = [replace(plain, source=replace(varied, number=number), compared=True) for number in (1, 2)]
    refused = Refused("b.sim.yml", "b", None, InvalidScenario([]))
    found = list(first_runs([(plain,), (several[0], plain), (several[1],), refused]))
    assert [each if isinstance(each, Refused) else (each.source.number, each.compared) for each in found] == [
        *((1, False), (1, False)),
        refused,
    ]


def test_the_command_line_chooses_kinds_and_single_mutants(tmp_path: Path) -> None:
    run = original(tmp_path)
    (plan,) = planned([run], ("removed:crate", "motor-off"))
    assert [mutant.name for mutant in plan.chosen] == [
        "motor-off:wheel_left_joint",
        "removed:crate",
    ]
    assert plan.left_out == 12
    assert within([plan], 0.5, 1)[0].left_out == 14
    assert len(planned([run])[0].chosen) == 14
    refuse_unknown(["wall", "removed:any name"])
    with pytest.raises(UsageError, match="did you mean 'wall'") as refused:
        refuse_unknown(["wal"])
    assert str(refused.value).count("silenced") == 1


def test_a_single_mutant_that_no_run_has_is_refused(tmp_path: Path) -> None:
    plans = planned([original(tmp_path)])
    refuse_unmatched(plans, ["motor-off:wheel_left_joint", "dropped"])
    refuse_unmatched([], ["motor-off:wheel"])
    for name, hint in (("motor-off:wheel_lft_joint", "did you mean 'motor-off:wheel_left_joint'"), ("noisy:x", "none")):
        with pytest.raises(UsageError, match=hint) as refused:
            refuse_unmatched(plans, ["silenced", name])
        assert "removed:crate" not in str(refused.value)


def test_a_budget_takes_the_first_of_each_kind_first_and_scenarios_in_turns(tmp_path: Path) -> None:
    quick, slow = original(tmp_path), original(tmp_path, wall_time=2.0)
    plans = planned([quick, slow])
    assert cost(plans, 2) == (14 + 28) / 2
    some = within(plans, 4.5, 2)
    assert [[mutant.kind for mutant in plan.chosen] for plan in some] == [["silenced", "swapped", "wall"]] * 2
    assert [plan.left_out for plan in some] == [11, 11]
    (first,) = within(plans[:1], 12.0, 1)
    assert [mutant.name for mutant in plans[0].chosen if mutant not in first.chosen] == [
        "removed:far crate",
        "moved:far crate",
    ]
    assert within(plans, 1000.0, 1) == plans

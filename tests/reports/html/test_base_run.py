"""What changed in each scenario, in a kind and in words."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sim_action.reports.html.base_run import ScenarioChange, scenario_changes
from sim_action.results.comparison import compare_outcomes
from sim_action.results.outcome import Outcome
from tests.outcomes import like, outcome


def change(old: Outcome, new: Outcome) -> ScenarioChange:
    return scenario_changes(compare_outcomes([old], [new]))[id(new)]


def test_changes_of_verdicts() -> None:
    # Another verdict is the change.
    found = change(outcome("a.sim.yml"), outcome("a.sim.yml", holds=False))
    assert found.kind == "newly fails"
    assert found.words == "newly fails"
    assert change(outcome("a.sim.yml", holds=False), outcome("a.sim.yml")).kind == "fixed"
    assert change(outcome("a.sim.yml"), outcome("a.sim.yml")) == ScenarioChange("unchanged", "it still passes")


def limited(limit: float, measured: float = 1.5) -> Outcome:
    made = outcome("a.sim.yml", holds=limit <= measured)
    [expected] = made.expectations
    verdict = type(expected.verdict)(limit <= measured, measured, limit, measured - limit, "m", 2.0, "travelled 1.5 m")
    named = like(expected, verdict=verdict, name=f"travel {limit} m")
    return like(made, expectations=(named,))


def test_a_stricter_limit_is_named_as_the_reason_of_a_failure() -> None:
    found = change(limited(1.0), limited(1.6))
    assert found.gist == "newly fails; limit 1.6 m, was 1 m"
    assert found.words == (
        "newly fails; before (travel 1.0 m): measured 1.5 m, limit 1 m, margin 0.5 m, "
        "at 2.00 s; stricter limit: travel 1.6 m; was: travel 1.0 m; limit 1.6 m, was 1 m"
    )
    assert change(limited(1.0), limited(1.4)).gist == ""


def with_margin(margin: float) -> Outcome:
    return limited(1.5, 1.5 + margin)


def test_a_limit_that_is_not_the_reason_of_a_failure_is_not_in_the_table() -> None:
    # It fails with the former limit, too.
    assert change(limited(1.0), limited(1.6, measured=0.9)).gist == "newly fails"
    old, new = limited(1.0), limited(1.6)
    [before], [late] = old.expectations, new.expectations
    # Another expectation failed, and ended the run.
    hit = like(before, name="no_collision", assertion="no_collision")
    missed = replace(before.verdict, passed=False, measured=1.0, limit=0.0, margin=-1.0, unit="contacts")
    cut = like(late, verdict=replace(late.verdict, cut_off=True))
    both = like(old, expectations=(hit, before))
    ended = like(new, expectations=(like(hit, verdict=missed), cut))
    found = change(both, ended)
    assert found.gist == "newly fails"
    assert "stricter limit" in found.words
    alone = like(new, expectations=(cut,))
    assert change(old, alone).gist == "newly fails"


def test_changes_of_passed_runs() -> None:
    # A slower run is a change.
    fast, slow = (like(outcome("a.sim.yml"), real_time_factor=factor, sim_time=10.0) for factor in (40.0, 2.0))
    assert change(fast, slow).gist == "slower"
    # A margin that shrinks.
    found = change(with_margin(1.0), with_margin(0.1))
    assert found.kind == "less margin"
    assert "margin shrinks" in found.words
    # An expectation that is gone.
    new = with_margin(1.0)
    [expected] = new.expectations
    old = like(new, expectations=(expected, like(expected, name="stays up")))
    assert change(old, new).kind == "weaker"


@pytest.mark.parametrize(("digest", "kind"), [("a", "unchanged"), ("b", "moves differently")])
def test_another_motion(digest: str, kind: str) -> None:
    old, new = (like(outcome("a.sim.yml"), digest=each, engine="PyBullet 3", seed=1) for each in ("a", digest))
    assert change(old, new).kind == kind
    # A scenario that is gone has no change.
    assert scenario_changes(compare_outcomes([outcome("a.sim.yml")], [])) == {}

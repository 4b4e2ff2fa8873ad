from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from sim_action.core.permissions import Permissions
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.runner.mutation.planning import TABLE
from sim_action.runner.mutation.suggestions import Candidates, Search, candidates, entry_text
from sim_action.scenario.loading import Libraries
from sim_action.scenario.mutation import Mutation
from sim_action.state.trace import Trace
from tests.outcomes import outcome
from tests.runner.mutation.runs import curve, original
from tests.traces import trace

TIME = [step / 10 for step in range(11)]


def found(folder: Path, way: Trace | None = None) -> Candidates:
    offer = candidates(original(folder, way), Permissions(), Libraries())
    assert offer is not None
    return offer


def keys(offer: Candidates) -> list[str]:
    return [expected.assertion.key for expected in offer.loaded.scenario.expect[offer.own :]]


def run_of(*passed: bool) -> Outcome:
    """A run in which expectations passed or not; the first one is the scenario's own."""
    (expected,) = outcome("a.sim.yml").expectations
    several = tuple(_judged(expected, holds) for holds in (True, *passed))
    return outcome("a.sim.yml").model_copy(update={"expectations": several})


def _judged(expected: ExpectationOutcome, holds: bool) -> ExpectationOutcome:
    verdict = outcome("a.sim.yml", holds=holds).expectations[0].verdict
    return expected.model_copy(update={"verdict": verdict})


def test_candidates_in_the_scenario_and_in_a_mutant(tmp_path: Path) -> None:
    # Candidates are valid in the scenario.
    offer = found(tmp_path, curve())
    assert len(offer.entries) == len(keys(offer))
    assert {"no_collision", "stay_within", "final_pose", "clearance", "follow_path", "reach", "max_speed"} <= set(
        keys(offer)
    )
    assert offer.loaded.mutation == Mutation()
    assert offer.loaded.scenario.name == "burger drives"
    # A mutant gets the same candidates and keeps its fault.
    run, offer = original(tmp_path), found(tmp_path)
    (silenced,) = TABLE[0].mutants(run)
    added = offer.added_to(silenced.loaded)
    assert added.mutation == silenced.loaded.mutation
    assert len(added.scenario.expect) == 1 + len(offer.entries)


def test_candidates_that_pass_and_notice_the_mutant(tmp_path: Path) -> None:
    offer = found(tmp_path)
    count = len(offer.entries)
    before = run_of(False, *[True] * (count - 1))
    nothing = run_of(*[True] * count)
    assert offer.noticing(before, run_of(False, True, False, *[True] * (count - 4), False)) == [2, count - 1]
    assert offer.noticing(before, nothing) == []
    crashed = Outcome(name="a", file="a.sim.yml", status="error")
    assert offer.noticing(before, crashed) == offer.noticing(crashed, nothing) == []


def test_a_candidate_is_suggested_once_it_notices_the_mutant_alone(tmp_path: Path) -> None:
    offer = found(tmp_path)
    search = Search(offer, offer.loaded, [1, 2, 3])
    original, mutant = search.pair
    assert len(original.scenario.expect) == len(mutant.scenario.expect) == offer.own + 1
    assert original.scenario.expect[offer.own] == offer.loaded.scenario.expect[offer.own + 1]
    # Alone, it passes in the run of the mutant, too.
    search.decide(run_of(True), run_of(True))
    assert (search.suggestion, search.places) == ("", [2, 3])
    search.decide(run_of(True), run_of(False))
    assert (search.suggestion, search.places) == (offer.text(2), [])


def test_suggestions_are_yaml(tmp_path: Path) -> None:
    offer = found(tmp_path, curve())
    for place, entry in enumerate(offer.entries):
        (read,) = yaml.safe_load(offer.text(place))
        assert (read if isinstance(read, str) else list(read)) == (entry if isinstance(entry, str) else list(entry))


@pytest.mark.parametrize("name", ["left, knee", "it's: a", "a: b", "1", "no", "[x]", "- y", "knee 2", "é #1", ""])
def test_names_of_any_kind_are_read_back(name: str) -> None:
    entry = {"joint": {"name": name, "position": {name: (-0.1, 3.0)}}, "before": 1.25}
    text = entry_text(entry)
    assert yaml.safe_load(text) == [{"joint": {"name": name, "position": {name: [-0.1, 3]}}, "before": 1.25}]
    assert text.isprintable() or text.count("\n") == 1


def test_an_arm_gets_its_joints(tmp_path: Path) -> None:
    bent = trace(TIME, position=[now * 1.5 for now in TIME])
    offer = found(tmp_path, bent)
    within, joint = (entry for entry in offer.entries[1:3] if not isinstance(entry, str))
    assert within == {"joint_within": {"position": {"wheel_left_joint": (-0.1, 1.6)}}}
    assert joint["joint"] == {"name": "wheel_left_joint", "near": 1.5, "tolerance": 0.087}
    assert joint["before"] == 1.25


def test_a_joint_that_moved_only_in_a_mutant_or_faster_gets_limits(tmp_path: Path) -> None:
    bent = trace(TIME, position=[now * 1.5 for now in TIME], velocity=[1.5] * 11)
    offer = candidates(original(tmp_path, bent), Permissions(), Libraries(), ["wheel_right_joint"])
    assert offer is not None
    for limits in (
        {"position": {"wheel_right_joint": (-0.1, 0.1)}},
        {"velocity": {"wheel_left_joint": (-1.9, 1.9)}},
        {"velocity": {"wheel_right_joint": (-0.1, 0.1)}},
    ):
        assert {"joint_within": limits} in offer.entries


def test_a_robot_that_turns_on_the_spot_gets_its_turn(tmp_path: Path) -> None:
    offer = found(tmp_path, trace(TIME, yaw=[2 * now for now in TIME], turn_rate=[2.0] * 11))
    assert {"max_speed": {"angular": 2.41}} in offer.entries
    assert {"reach": {"x": 0.0, "y": 0.0, "yaw": "57 deg", "tolerance": 0.1}, "before": 0.75} in offer.entries
    assert "joint" not in keys(offer)

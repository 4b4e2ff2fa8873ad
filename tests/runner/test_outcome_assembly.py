"""Outcomes that become final in the order in which runs end; real calls are in tests/integration."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sim_action.core.errors import InternalError
from sim_action.results.journal import Event, Finished, Progressed, RunEnded, Started
from sim_action.results.outcome import Outcome
from sim_action.runner.child_outcome import interrupted, unjudged
from sim_action.runner.outcome_assembly import OutcomeAssembly, planned_outcomes
from sim_action.runner.run_plan import Plan
from sim_action.scenario.model import Agreement, LoadedScenario
from tests.outcomes import outcome
from tests.scenarios import LEAST, load

PATTERN = Outcome.of_nothing("none")


@pytest.fixture
def loaded(tmp_path: Path) -> LoadedScenario:
    return load(tmp_path, LEAST)


class Call:
    """A call with an assembly, and what it reports."""

    def __init__(self, plans: list[Plan], folder: Path, repeat: int = 1) -> None:
        self.events: list[Event] = []
        self.assembly = OutcomeAssembly(plans, repeat, folder, None, self.events.append)

    def ends(self, place: int, turn: int = 1, digest: str = "a") -> list[int]:
        """Return the places that are final after the end of a run."""
        before = len(self.events)
        self.assembly(RunEnded(place, turn, ran(digest)))
        return [event.place for event in self.events[before:] if isinstance(event, Finished)]

    @property
    def final(self) -> dict[int, Outcome]:
        return {event.place: event.outcome for event in self.events if isinstance(event, Finished)}


def ran(digest: str = "a") -> Outcome:
    return outcome("s.sim.yml").model_copy(update={"digest": digest})


def several_engines(loaded: LoadedScenario) -> tuple[LoadedScenario, ...]:
    scenario = loaded.scenario.model_copy(update={"agreement": Agreement(position=0.01)})
    return tuple(
        replace(loaded, scenario=scenario.model_copy(update={"name": name})) for name in ("s [pybullet]", "s [mujoco]")
    )


def test_an_outcome_is_final_when_its_run_has_ended(loaded: LoadedScenario, tmp_path: Path) -> None:
    call = Call([(loaded,), (loaded,)], tmp_path)
    call.assembly(Started(1, 1, "s"))
    call.assembly(Progressed(1, 1, "s", 0.5, 1.0))
    assert call.ends(1) == [1]
    assert call.ends(0) == [0]
    # It is in the journal before the terminal reports its run: SIGKILL may come in between.
    assert call.events[2:4] == [Finished(1, ran()), RunEnded(1, 1, ran())]
    assert call.final == {0: ran(), 1: ran()}


def test_scenarios_that_cannot_run_have_places_between_the_others(loaded: LoadedScenario, tmp_path: Path) -> None:
    refused = loaded.source.refused(InternalError("at fault"))
    plans: list[Plan] = [(loaded,), refused, several_engines(loaded), refused]
    call = Call(plans, tmp_path)
    call.assembly.begin([PATTERN])
    assert call.assembly.places == [0, 2, 3]
    assert call.final.keys() == {1, 4, 5}
    assert call.final[5] == PATTERN
    planned = planned_outcomes(plans, [PATTERN])
    names = [each.name for each in planned]
    assert names == [loaded.scenario.name, refused.name, "s [pybullet]", "s [mujoco]", refused.name, "none"]
    assert {place: planned[place].name for place in call.final} == {
        place: found.name for place, found in call.final.items()
    }


def test_repetitions_and_engines_end_with_the_last_run(loaded: LoadedScenario, tmp_path: Path) -> None:
    # Repetitions are merged after the last one.
    call = Call([(loaded,), (loaded,)], tmp_path, repeat=2)
    assert [call.ends(0, 1), call.ends(1, 1), call.ends(1, 2, "b"), call.ends(0, 2)] == [[], [], [1], [0]]
    assert [call.final[place].status for place in (0, 1)] == ["passed", "flaky"]
    assert all(event.is_one_of_several for event in call.events if isinstance(event, RunEnded))
    # Engines are compared after the last one.
    call = Call([several_engines(loaded)], tmp_path)
    assert [call.ends(1), call.ends(0)] == [[], [0, 1]]
    assert [each.assertion for each in call.final[1].expectations] == ["travel", "agreement", "agreement"]


def test_runs_that_did_not_take_place_end_with_the_call(loaded: LoadedScenario, tmp_path: Path) -> None:
    call = Call([(loaded,), (loaded,)], tmp_path, repeat=2)
    call.ends(0, 1)
    call.ends(0, 2)
    call.ends(1, 1)
    left = interrupted(loaded)
    call.assembly.end([ran(), ran(), ran(), left])
    assert call.final[0].status == "passed"
    assert call.final[1].failures == left.failures


def test_a_planned_outcome_has_the_place_of_its_scenario(loaded: LoadedScenario) -> None:
    (planned,) = planned_outcomes([(loaded,)], [])
    assert planned.unfinished("x").model_copy(update={"failures": ()}) == unjudged(loaded)

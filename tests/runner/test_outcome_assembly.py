"""Outcomes that become final in the order in which runs end, also of repetitions; tests/integration has real calls."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sim_action.core.errors import InternalError
from sim_action.results.journal import Event, Finished, Progressed, RunEnded, Started
from sim_action.results.outcome import Failure, Outcome, Repeats
from sim_action.runner.child_outcome import TOO_SLOW, interrupted, skipped, unjudged
from sim_action.runner.outcome_assembly import OutcomeAssembly, merge_repeats, planned_outcomes
from sim_action.runner.run_plan import Plan
from sim_action.scenario.model import Agreement, LoadedScenario
from sim_action.state.trace_storage import save_trace
from sim_action.state.verdict import Judged, Verdict
from tests.outcomes import outcome
from tests.scenarios import LEAST, load
from tests.traces import trace

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


def ran(digest: str | None = "a", **changed: Any) -> Outcome:
    return outcome("s.sim.yml").model_copy(update={"digest": digest, **changed})


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


def failed(kind: str, message: str = "at 0.5 s") -> Outcome:
    failure = Failure.model_validate({"kind": kind, "title": f"{kind} error", "message": message})
    return ran(None, status="error", expectations=(), failures=(failure,))


def test_runs_that_agree(loaded: LoadedScenario, tmp_path: Path) -> None:
    assert merge_repeats(loaded, [ran()], tmp_path) == ran()
    # Runs that are the same are one that took as long.
    told = merge_repeats(loaded, [ran(wall_time=1.0), ran(wall_time=2.0)], tmp_path)
    assert told.repeats
    assert (told.status, told.wall_time, told.repeats.count, told.simulated) == ("passed", 3.0, 2, 0.0)


def test_traces_may_be_equal_where_messages_of_nodes_differ(loaded: LoadedScenario, tmp_path: Path) -> None:
    (tmp_path / "traces").mkdir()
    for number in (1, 2):
        save_trace(trace([0.0, 0.25], x=[0.0, 1.0]), tmp_path / f"traces/{number}.npz")
    runs = [ran("a", trace="traces/1.npz"), ran("b", trace="traces/2.npz")]
    message = merge_repeats(loaded, runs, tmp_path).failures[0].message
    assert "run 2 differs from run 1 in messages that nodes sent, or between two moments of its trace" in message


def test_the_most_that_agree_are_held_against_the_first_that_does_not(loaded: LoadedScenario, tmp_path: Path) -> None:
    (tmp_path / "traces").mkdir()
    runs = []
    for number, digest in enumerate("abbcb", start=1):
        save_trace(trace([0.0, 0.25], x=[0.0, float("abc".index(digest))]), tmp_path / f"traces/{number}.npz")
        runs.append(ran(digest, trace=f"traces/{number}.npz", replay=f"replays/{number}.json.gz"))
    told = merge_repeats(loaded, runs, tmp_path)
    assert told.repeats == Repeats(count=5, agreed=3, digests=3, replay="replays/1.json.gz")
    message = told.failures[0].message
    assert message.startswith(
        "3 of 5 runs agree; run 1 differs from run 2 at 0.25 s, in x of base_position_xyz: 0.0 and not 1.0;"
    )
    assert told.failures[0].time == 0.25
    assert told.trace == "traces/2.npz"
    assert sorted(path.name for path in (tmp_path / "traces").iterdir()) == ["1.npz", "2.npz"]
    assert told.notes == ("the trace of run 2 is stored here, the trace of run 1 in traces/1.npz",)


def test_where_no_code_of_the_users_runs_it_is_for_us_to_mend(loaded: LoadedScenario, tmp_path: Path) -> None:
    message = merge_repeats(loaded, [ran("a"), ran("b")], tmp_path).failures[0].message
    assert message.startswith("none of 2 runs agree")
    assert merge_repeats(loaded, [ran("a"), ran("b")], tmp_path).failures[0].time is None
    assert "please report it" in message


@pytest.mark.parametrize("kind", ["script", "crash", "wall limit", "unstable"])
def test_errors_are_the_same_whatever_time_they_tell(kind: str, loaded: LoadedScenario, tmp_path: Path) -> None:
    told = merge_repeats(loaded, [failed(kind), failed(kind, "at 0.6 s, in <object at 0x7f>")], tmp_path)
    assert told.repeats
    assert (told.status, told.repeats.agreed, told.repeats.digests) == ("error", 2, 0)


def test_runs_that_were_slow_or_ended_in_errors(loaded: LoadedScenario, tmp_path: Path) -> None:
    # A run that is too slow is not flaky unless the others differ.
    slow = failed("wall limit")
    slow = slow.model_copy(update={"failures": (slow.failures[0].model_copy(update={"title": TOO_SLOW}),)})
    assert merge_repeats(loaded, [ran(), slow, ran()], tmp_path) == slow
    assert merge_repeats(loaded, [slow, slow], tmp_path).status == "error"
    assert merge_repeats(loaded, [ran(), slow, ran("b")], tmp_path).status == "flaky"
    assert merge_repeats(loaded, [ran(), failed("wall limit")], tmp_path).status == "flaky"
    # An error among passes is flaky and told.
    told = merge_repeats(loaded, [ran(), failed("crash"), ran()], tmp_path)
    assert told.status == "flaky"
    assert "run 1 passed, run 2 ended in an error (crash error: at 0.5 s)" in told.failures[0].message
    # An interruption and a fault of ours come first.
    fault = ran(None, status="error", expectations=(), failures=(Failure.of_fault(InternalError("oh")),))
    for end in (interrupted(loaded), fault):
        assert merge_repeats(loaded, [ran(), end, ran("b")], tmp_path) == end
    # What was not run as often is not green.
    told = merge_repeats(loaded, [ran(), skipped(loaded)], tmp_path)
    assert (told.status, told.expectations) == ("skipped", ())
    assert merge_repeats(loaded, [skipped(loaded), skipped(loaded)], tmp_path) == skipped(loaded)


def test_a_run_that_never_judged_an_expectation_differs(loaded: LoadedScenario, tmp_path: Path) -> None:
    unread = ran().expectations[0].model_copy(update={"verdict": Verdict(False, message="no reading", judged=Judged())})
    unjudged = ran("b", status="not_exercised", expectations=(unread,))
    told = merge_repeats(loaded, [ran(), unjudged], tmp_path)
    assert told.status == "flaky"
    assert "run 1 passed, run 2 not exercised (no reading)" in told.failures[0].message
    equal = ran("b", expectations=(unread.model_copy(update={"unexercised": "warn"}),))
    told = merge_repeats(loaded, [ran("b"), equal], tmp_path)
    assert "run 1 passed: travelled 1.5 m (measured 1.5 m), run 2 not exercised: no reading" in told.failures[0].message
    assert merge_repeats(loaded, [unjudged, unjudged], tmp_path).status == "not_exercised"


def test_files_that_lie_elsewhere_are_left_alone(loaded: LoadedScenario, tmp_path: Path) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "mine.npz").write_text("mine")
    merge_repeats(loaded, [ran(), ran(trace="../mine.npz")], tmp_path / "results")
    assert (tmp_path / "mine.npz").read_text() == "mine"

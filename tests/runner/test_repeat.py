"""What several runs of one scenario come to; real ones are in tests/integration/test_repeats.py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sim_action.core.errors import InternalError
from sim_action.results.outcome import Failure, Outcome, Repeats
from sim_action.runner.child_outcome import TOO_SLOW, interrupted, skipped
from sim_action.runner.outcome_assembly import merge_repeats
from sim_action.scenario.model import LoadedScenario
from sim_action.state.trace_storage import save_trace
from sim_action.state.verdict import Judged, Verdict
from tests.outcomes import outcome
from tests.scenarios import LEAST, load
from tests.traces import trace


@pytest.fixture
def loaded(tmp_path: Path) -> LoadedScenario:
    return load(tmp_path, LEAST)


def ran(digest: str | None = "a", **changed: Any) -> Outcome:
    return outcome("s.sim.yml").model_copy(update={"digest": digest, **changed})


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


def test_a_run_that_never_judged_an_expectation_differs_from_one_that_did(
    loaded: LoadedScenario, tmp_path: Path
) -> None:
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

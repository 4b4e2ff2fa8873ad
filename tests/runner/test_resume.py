"""The outcomes of an earlier call that a call takes over."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim_action.results.artifacts import run_files
from sim_action.results.events import Event, Finished, RunEnded
from sim_action.results.journal import JOURNAL_FILE, Journal
from sim_action.results.journal_records import Header
from sim_action.results.outcome import Failure, Outcome, Repeats, Status
from sim_action.runner.outcome_assembly import OutcomeAssembly, planned_outcomes
from sim_action.runner.resume import TakenOver, take_over
from sim_action.runner.run_keys import RunKeys
from sim_action.scenario.model import LoadedScenario
from tests.outcomes import outcome as passed
from tests.scenarios import LEAST, load

CRASH = Failure(kind="crash", title="SIGSEGV", message="it crashed")
FLAKY = Failure(kind="flaky", title="flaky", message="1 of 2 runs agree")


class Keys:
    """Keys that are the names of scenarios; `unknown_names` have none."""

    def __init__(self, *unknown_names: str) -> None:
        self._unknown = unknown_names

    def of(self, loaded: LoadedScenario) -> str | None:
        name = loaded.scenario.name
        return None if name in self._unknown else f"key of {name}"

    def unknown(self, _loaded: LoadedScenario) -> str | None:
        return "git is missing" if self._unknown else None


class Call:
    """A call that runs scenarios with names, with an earlier call in its folder."""

    def __init__(self, folder: Path, names: Sequence[str] = ("a", "b"), repeat: int = 1) -> None:
        self.folder, self.repeat = folder, repeat
        self.runs = [load(folder, LEAST.replace("burger drives straight", name)) for name in names]
        plans = [(run,) for run in self.runs]
        self.events: list[Event] = []
        self.assembly = OutcomeAssembly(plans, repeat, folder, None, self.events.append)
        self.planned = planned_outcomes(plans, [])
        self.files = run_files(list(names) * repeat, folder, replays=False, formats=())
        for run in self.files:
            run.trace.parent.mkdir(exist_ok=True)
            run.trace.write_bytes(b"trace")

    def outcome(self, place: int, turn: int = 1, **changes: Any) -> Outcome:
        trace = self.files[(turn - 1) * len(self.runs) + place].trace.relative_to(self.folder).as_posix()
        own = {name: getattr(self.planned[place], name) for name in ("name", "file", "line", "number")}
        return passed("s.sim.yml").model_copy(
            update={**own, "trace": trace, "replay": None, "recordings": (), **changes}
        )

    def journal(self, *events: Event) -> None:
        header = Header.of_call(self.planned, ())
        journal = Journal(self.folder, header, pytest.fail, time.monotonic())
        for event in events:
            journal(event)
        journal.close()

    def taken(self, keys: Keys | None = None) -> TakenOver:
        known = cast("RunKeys", keys or Keys())
        return take_over(self.folder, self.planned, self.runs, self.assembly, files=self.files, keys=known)


@pytest.fixture
def call(tmp_path: Path) -> Call:
    return Call(tmp_path)


def taken_places(found: TakenOver) -> list[tuple[int | None, int | None]]:
    return [(record.place, record.turn) for record in found.records]


def test_a_verdict_with_an_equal_key_is_taken_over(call: Call) -> None:
    call.journal(Finished(0, call.outcome(0), "key of a"), Finished(1, call.outcome(1), "another"))
    found = call.taken()
    assert taken_places(found) == [(0, None)]
    assert found.files == {"traces/a.npz"}
    assert (found.finals, found.runs(1), found.not_passed, found.remarks) == (1, 1, False, ())


def test_its_place_is_that_of_this_call(tmp_path: Path) -> None:
    earlier = Call(tmp_path, ("b", "a"))
    earlier.journal(Finished(1, earlier.outcome(1), "key of a"))
    assert taken_places(Call(tmp_path, ("a",)).taken()) == [(0, None)]


@pytest.mark.parametrize(
    ("status", "failures", "is_taken"),
    [("passed", (), True), ("error", (CRASH,), False), ("skipped", (), False), ("failed", (), False)],
)
def test_only_valid_verdicts_count(
    call: Call, status: Status, failures: tuple[Failure, ...], *, is_taken: bool
) -> None:
    expectations = call.outcome(0).expectations if status in ("passed", "failed") else ()
    changed = call.outcome(0, status=status, failures=failures, expectations=expectations)
    call.journal(Finished(0, changed, "key of a"))
    assert bool(call.taken().records) is is_taken


@pytest.mark.parametrize(
    "changes",
    [
        {"line": 7},
        {"number": 2},
        {"group": "another"},
        {"trace": None},
        {"trace": "traces/b.npz"},
        {"trace": "../traces/a.npz"},
        {"trace": "/etc/passwd"},
        {"replay": "replays/a.json.gz"},
        {"recordings": ("recordings/a.csv",)},
    ],
)
def test_it_has_the_attributes_and_the_files_of_the_plan(call: Call, changes: dict[str, Any]) -> None:
    call.journal(Finished(0, call.outcome(0, **changes), "key of a"))
    assert call.taken().records == ()


@pytest.mark.parametrize("damage", ["missing", "empty", "link"])
def test_its_files_exist(call: Call, damage: str) -> None:
    trace = call.files[0].trace
    trace.unlink()
    if damage == "empty":
        trace.touch()
    elif damage == "link":
        trace.symlink_to(call.files[1].trace)
    call.journal(Finished(0, call.outcome(0), "key of a"))
    assert call.taken().records == ()


def test_runs_without_a_key_run_again_and_the_reason_is_given(call: Call) -> None:
    call.journal(Finished(0, call.outcome(0), None), Finished(1, call.outcome(1), "key of b"))
    found = call.taken(Keys("a"))
    assert taken_places(found) == [(1, None)]
    assert found.remarks == ("verdicts of user code are not taken over: git is missing",)


def test_a_call_in_which_all_has_changed_says_so(call: Call) -> None:
    call.journal(Finished(0, call.outcome(0), "another"))
    (remark,) = call.taken().remarks
    assert remark == (
        "no verdict of the earlier run is taken over: since then, files, options, environment variables, software or "
        "the current folder have changed"
    )


def test_without_a_journal_there_is_nothing_to_resume(call: Call) -> None:
    assert call.taken().records == ()
    assert "there is no earlier run to resume: " in call.taken().remarks[0]


def test_repetitions_are_taken_over_one_by_one(tmp_path: Path) -> None:
    call = Call(tmp_path, repeat=2)
    call.journal(
        RunEnded(0, 1, call.outcome(0), "key of a", is_one_of_several=True),
        RunEnded(1, 1, call.outcome(1), None, is_one_of_several=True),
        RunEnded(0, 2, call.outcome(0, 2, status="error", expectations=(), failures=(CRASH,)), "key of a"),
    )
    found = call.taken()
    assert taken_places(found) == [(0, 1)]
    assert (found.finals, found.runs(2)) == (0, 1)
    call.assembly.take_over(found.records)
    assert call.assembly.ended == {(0, 1)}
    (event,) = call.events
    assert isinstance(event, RunEnded)
    assert event.taken_over
    assert event.is_one_of_several


@pytest.mark.parametrize("traces", [1, 2])
def test_a_flaky_scenario_keeps_the_traces_of_both_runs(tmp_path: Path, traces: int) -> None:
    call = Call(tmp_path, ("a",), repeat=3)
    repeats = Repeats(count=3, agreed=2, digests=2)
    flaky: dict[str, Any] = {"status": "flaky", "failures": (FLAKY,), "expectations": (), "repeats": repeats}
    for run in call.files[traces:]:
        run.trace.unlink()
    call.journal(Finished(0, call.outcome(0, **flaky), "key of a"))
    found = call.taken()
    assert found.finals == traces - 1
    assert found.runs(3) == 3 * (traces - 1)
    assert found.not_passed is (traces == 2)


def test_final_outcomes_are_reported_as_taken_over(call: Call) -> None:
    call.journal(Finished(0, call.outcome(0), "key of a"))
    call.assembly.take_over(call.taken().records)
    assert call.events == [Finished(0, call.outcome(0), "key of a", taken_over=True)]
    assert call.assembly.ended == {(0, 1)}
    call.assembly.end([call.outcome(0), call.outcome(1)])
    assert [event.place for event in call.events if isinstance(event, Finished)] == [0, 1]


def test_a_key_of_repetitions_is_that_of_all(tmp_path: Path) -> None:
    call = Call(tmp_path, repeat=2)
    for place, keys in enumerate((("key", "key"), ("key", None))):
        for turn, key in enumerate(keys, start=1):
            call.assembly(RunEnded(place, turn, call.outcome(place, turn), key))
    assert [event.key for event in call.events if isinstance(event, Finished)] == ["key", None]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.integers(0, 5_000), byte=st.integers(0, 255))
def test_a_changed_byte_is_no_traceback_and_no_other_verdict(
    tmp_path_factory: pytest.TempPathFactory, place: int, byte: int
) -> None:
    call = Call(tmp_path_factory.mktemp("call"), ("a",))
    call.journal(Finished(0, call.outcome(0), "key of a"))
    journal = call.folder / JOURNAL_FILE
    data = bytearray(journal.read_bytes())
    data[place % len(data)] = byte
    journal.write_bytes(data)
    outcomes = [record.outcome for record in call.taken().records]
    assert [outcome.status for outcome in outcomes if outcome is not None] in ([], ["passed"])

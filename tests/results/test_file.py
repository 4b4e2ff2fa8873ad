"""What all outcomes of a call say to the process that called, and how they are kept."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sim_action.core.errors import ExitCode, Location, UsageError
from sim_action.results.file import Results
from sim_action.results.outcome import ExpectationOutcome, Failure, FailureKind, Outcome
from sim_action.results.shards import Shard
from sim_action.state.verdict import Verdict


def outcome(name: str = "a", kind: FailureKind | None = None, *, passed: bool = True) -> Outcome:
    if kind is None:
        return Outcome(name=name, file=f"{name}.sim.yml", status="passed" if passed else "failed", travelled=1.5)
    failure = Failure(kind=kind, title=kind, message="why")
    return Outcome(name=name, file=f"{name}.sim.yml", status="error", failures=(failure,))


def results(*outcomes: Outcome) -> Results:
    return Results(sim_action="0", python="3.11", platform="here", wall_time=1.0, outcomes=outcomes)


@pytest.mark.parametrize(
    ("outcomes", "code", "conclusion"),
    [
        ([outcome()], 0, "success"),
        ([outcome(), outcome(passed=False)], 1, "failure"),
        ([outcome(kind="crash")], 1, "failure"),
        ([outcome(kind="missing")], 2, "failure"),
        ([outcome(passed=False), outcome(kind="invalid")], 2, "failure"),
        ([outcome(kind="invalid"), outcome(kind="internal")], 3, "failure"),
        ([outcome(kind="internal"), outcome(kind="interrupted"), outcome(passed=False)], 130, "cancelled"),
        ([], 5, "failure"),
    ],
)
def test_the_worst_outcome_makes_the_exit_code(outcomes: list[Outcome], code: int, conclusion: str) -> None:
    assert results(*outcomes).exit_code == code
    assert results(*outcomes).conclusion == conclusion


def test_results_are_read_as_they_were_written(tmp_path: Path) -> None:
    verdict = Verdict(False, 1.12, 1.5, -0.38, "m", 30.0, "travelled 1.12 m of 1.5 m in 30.0 s")
    expectation = ExpectationOutcome(
        name="far", assertion="travel", severity="error", location=Location("a.sim.yml", 9, 5), verdict=verdict
    )
    written = results(
        outcome(passed=False).model_copy(update={"expectations": (expectation,)}), outcome("b", kind="wall limit")
    )
    assert Results.read(written.write(tmp_path)) == written


HEAD = '"version": 1, "sim_action": "0", "python": "3", "platform": "p"'


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "Invalid JSON: EOF while parsing a value at line 1 column 0"),
        ("[1, 2]", "Input should be an object"),
        ("[" * 100_000, "Invalid JSON: recursion limit exceeded at line 1 column 202"),
        ("{}", "sim_action: Field required (and 4 more)"),
        ('{"version": 2}', "version: Input should be 1 (and 5 more)"),
        (f'{{{HEAD}, "wall_time": NaN, "outcomes": []}}', "wall_time: Input should be a finite number"),
        (f'{{{HEAD}, "wall_time": "1", "outcomes": []}}', "wall_time: Input should be a valid number"),
        (f'{{{HEAD}, "wall_time": 1, "outcomes": [], "##[error]x": 1}}', "Extra inputs are not permitted"),
        (
            f'{{{HEAD}, "wall_time": 1, "outcomes": [{{"name": "a", "file": "a", "status": "fine"}}]}}',
            "outcomes.0.status: Input should be 'passed', 'failed', 'flaky', 'error' or 'skipped'",
        ),
        (
            f'{{{HEAD}, "wall_time": 1, "outcomes": [], "shard": {{"index": 3, "count": 2, "total": 1}}}}',
            "shard: Value error, there is no shard 3 of 2",
        ),
    ],
)
def test_what_is_no_results_file_is_a_usage_error_of_one_line(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "results.json"
    path.write_text(text)
    with pytest.raises(UsageError) as raised:
        Results.read(path)
    assert str(raised.value) == f"{path} is no results file: {told}"


def test_results_larger_than_anybody_writes_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    with path.open("wb") as file:
        file.truncate(64_000_001)
    with pytest.raises(UsageError, match="it is larger than 64 MB"):
        Results.read(path)


def test_a_pipe_is_no_results_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "results.json")
    with pytest.raises(UsageError, match="no regular file"):
        Results.read(tmp_path / "results.json")


@pytest.mark.parametrize(("total", "code"), [(2, ExitCode.PASSED), (0, ExitCode.NO_SCENARIO)])
def test_a_shard_without_scenarios_passes_if_the_list_had_some(total: int, code: ExitCode) -> None:
    shard = Shard(index=3, count=3, total=total)
    assert results().model_copy(update={"shard": shard}).exit_code is code
    assert results(outcome(passed=False)).model_copy(update={"shard": shard}).exit_code is ExitCode.FAILED


def test_the_worst_come_first() -> None:
    given = results(outcome("fine"), outcome("failed", passed=False), outcome("broken", kind="crash"))
    assert [found.name for found in given.worst_first()] == ["broken", "failed", "fine"]


def test_how_far_the_robot_came_is_told_for_one_scenario_alone() -> None:
    assert results(outcome()).travelled == 1.5
    assert results(outcome(), outcome()).travelled is None

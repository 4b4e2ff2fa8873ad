"""From the results of shards on disk to those of one run."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest

from sim_action.errors import ExitCode, InvalidScenario, UsageError
from sim_action.joining import Listing
from sim_action.location import Location, Problem
from sim_action.merging import MergeRequest, merge
from sim_action.outcome import Outcome, Results
from sim_action.reporting import ReportRequest
from tests.results import outcome, results, stored


@pytest.fixture(autouse=True)
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name in os.environ:
        if name.startswith("GITHUB_"):
            monkeypatch.delenv(name)
    return tmp_path


def request(
    *patterns: str, listing: Listing | None = None, folder: str = "joined", junit: str | None = None
) -> MergeRequest:
    reports = ReportRequest(Path(folder), Path(junit) if junit else None, False, "normal", frozenset())
    return MergeRequest(patterns or ("shards",), listing, reports)


def read(folder: str = "joined") -> Results:
    return Results.read(Path(folder, "results.json"))


def shard(index: int, *outcomes: Outcome, total: int = 3) -> Path:
    return stored(Path("shards", str(index)), results(*outcomes, shard=(index, 2, total), wall_time=float(index)))


def test_traces_come_along_under_names_of_their_own() -> None:
    trace = "traces/same.npz"
    shard(1, outcome("a/same.sim.yml", trace=trace), outcome("c/same.sim.yml"))
    shard(2, outcome("b/Same.sim.yml", trace=trace))
    assert merge(request()) is ExitCode.PASSED
    found = {made.file: made.trace for made in read().outcomes}
    assert found == {
        "a/same.sim.yml": "traces/same.npz",
        "b/Same.sim.yml": "traces/Same-2.npz",
        "c/same.sim.yml": None,
    }
    assert Path("joined/traces/same.npz").read_text() == "trace of a/same.sim.yml"
    assert Path("joined/traces/Same-2.npz").read_text() == "trace of b/Same.sim.yml"
    assert len(list(Path("joined/traces").iterdir())) == 2


def test_what_could_not_be_loaded_takes_no_name_from_a_trace() -> None:
    error = InvalidScenario([Problem(Location("a/same"), "not a scenario")])
    shard(1, Outcome.of_invalid("a/same", error), total=2)
    shard(2, outcome("b/same", trace="traces/same.npz"), total=2)
    assert merge(request()) is ExitCode.INVALID
    assert [made.trace for made in read().outcomes] == [None, "traces/same.npz"]


@pytest.mark.parametrize("trace", ["../../secret", "/etc/hostname", "traces/link.npz", "traces/nope.npz"])
def test_a_trace_that_is_not_beside_its_results_is_left_out_and_that_is_told(workspace: Path, trace: str) -> None:
    (workspace / "secret").write_text("secret")
    path = shard(1, outcome("a.sim.yml"), total=1)
    (path.parent / "traces" / "link.npz").symlink_to("../../../secret")
    written = Results.read(path)
    forged = written.outcomes[0].model_copy(update={"trace": trace})
    written.model_copy(update={"outcomes": (forged,)}).write(path.parent)
    assert merge(request()) is ExitCode.PASSED
    (made,) = read().outcomes
    assert made.trace is None
    assert made.notes == (f"its trace {trace} is not beside the results of its shard",)
    assert not Path("joined/traces").exists()


def test_what_people_waited_for_is_the_longest_shard() -> None:
    shard(1, outcome("a"), outcome("c"))
    shard(2, outcome("b"))
    merge(request())
    assert (read().wall_time, read().shard) == (2.0, None)


def test_shards_that_were_not_alike_are_not_called_so() -> None:
    shard(1, outcome("a"), outcome("c"))
    path = shard(2, outcome("b"))
    Results.read(path).model_copy(update={"sim_action": "0.2.0", "platform": "Other"}).write(path.parent)
    merge(request())
    assert (read().sim_action, read().python, read().platform) == ("0.1.0, 0.2.0", "3.11.7", "Linux, Other")


def test_a_missing_shard_is_in_every_report_and_in_the_exit_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("GITHUB_STEP_SUMMARY", "GITHUB_OUTPUT"):
        monkeypatch.setenv(name, name)
    shard(1, outcome("a"), outcome("c"))
    assert merge(request()) is ExitCode.FAILED
    assert 'name="shard 2 of 2"' in Path("joined/junit.xml").read_text()
    assert "shard 2 of 2 has left no results" in Path("GITHUB_STEP_SUMMARY").read_text()
    assert "\nfailure\n" in Path("GITHUB_OUTPUT").read_text()
    assert "shard 2 of 2 has left no results; 1 of 3 scenarios have none" in capsys.readouterr().out


def test_only_what_no_shard_has_annotated_is_annotated(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    shard(1, outcome("a", holds=False), outcome("c"))
    listing = Listing([Path("a"), Path("b.sim.yml"), Path("c")], [])
    assert merge(request(listing=listing)) is ExitCode.FAILED
    commands = [line for line in capsys.readouterr().out.splitlines() if line.startswith(("::error", "::warning"))]
    (command,) = commands
    assert command.startswith("::error file=b.sim.yml,title=b.sim.yml%3A no result::no shard has left a result")


def test_annotations_of_what_is_of_no_file_name_none(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    shard(1, outcome("a"), outcome("c"))
    merge(request())
    assert "\n::error title=shard 2 of 2%3A no results::shard 2 of 2 has left" in capsys.readouterr().out


def test_results_can_be_joined_into_the_folder_above_them() -> None:
    shard(1, outcome("a", trace="traces/x.npz"), outcome("c"))
    shard(2, outcome("b", trace="traces/x.npz"))
    assert merge(request(folder="shards")) is ExitCode.PASSED
    assert len(read("shards").outcomes) == 3
    assert Path("shards/1/traces/x.npz").read_text() == "trace of a"


@pytest.mark.parametrize(
    ("patterns", "folder", "junit"),
    [
        (["shards"], "shards/1", None),
        (["shards"], "joined", "shards/1/results.json"),
        (["shards/1/other.json"], "shards/1", None),
        (["shards/1/traces/inner.json"], "shards/1", None),
    ],
)
def test_nothing_that_is_joined_is_overwritten(patterns: list[str], folder: str, junit: str | None) -> None:
    path = shard(1, outcome("a", trace="traces/x.npz"), total=1)
    path.with_name("other.json").write_bytes(path.read_bytes())
    results(outcome("b")).write(path.parent / "traces").rename(path.parent / "traces" / "inner.json")
    before = {file: file.read_bytes() for file in path.parent.rglob("*") if file.is_file()}
    with pytest.raises(UsageError, match="would be overwritten; choose another"):
        merge(request(*patterns, folder=folder, junit=junit))
    assert {file: file.read_bytes() for file in path.parent.rglob("*") if file.is_file()} == before


def test_silenced_reports_are_not_written(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    shard(1, outcome("a"), total=1)
    asked = request()
    merge(replace(asked, reports=replace(asked.reports, silenced=frozenset({"summary"}))))
    assert not Path("summary.md").exists()
    merge(asked)
    assert Path("summary.md").exists()


def test_one_scenario_reports_how_far_it_came() -> None:
    shard(1, outcome("a").model_copy(update={"travelled": 1.5}), total=1)
    merge(request())
    assert read().travelled == 1.5

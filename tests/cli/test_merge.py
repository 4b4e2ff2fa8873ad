from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from sim_action.cli.merge import MergeRequest, merge_results
from sim_action.core.errors import ExitCode, InvalidScenario, Location, Problem, UsageError
from sim_action.reports import ReportRequest
from sim_action.results.outcome import Failure, Outcome
from sim_action.results.results_json import Results
from sim_action.results.shard_results import Listing
from tests.outcomes import as_former_version, outcome, results, source, stored, unjudged
from tests.work import work_of

START = datetime(2026, 11, 6, 8, 30, tzinfo=UTC)


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
    part = results(*outcomes, shard=(index, 2, total), wall_time=float(index))
    started = START + timedelta(hours=index - 1)
    return stored(Path("shards", str(index)), part.model_copy(update={"started_at": started}))


def test_files_come_along_under_names_of_their_own() -> None:
    recordings = ("recordings/same.mcap", "recordings/same.csv")
    a, b = (
        outcome(file, trace="traces/same.npz", replay="replays/same.json.gz").model_copy(
            update={"recordings": recordings}
        )
        for file in ("a/same.sim.yml", "b/Same.sim.yml")
    )
    shard(1, a, outcome("c/same.sim.yml"))
    shard(2, b)
    assert merge_results(request()) is ExitCode.PASSED
    assert {made.file: (made.trace, made.replay, *made.recordings) for made in read().outcomes} == {
        "a/same.sim.yml": ("traces/same.npz", "replays/same.json.gz", *recordings),
        "b/Same.sim.yml": (
            *("traces/Same-2.npz", "replays/Same-2.json.gz"),
            *("recordings/Same-2.mcap", "recordings/Same-2.csv"),
        ),
        "c/same.sim.yml": (None, None),
    }
    assert Path("joined/traces/same.npz").read_text() == "trace of a/same.sim.yml"
    assert Path("joined/traces/Same-2.npz").read_text() == "trace of b/Same.sim.yml"
    assert Path("joined/replays/Same-2.json.gz").read_text() == "replay of b/Same.sim.yml"
    assert Path("joined/recordings/Same-2.mcap").read_text() == "recordings/same.mcap of b/Same.sim.yml"
    assert len(list(Path("joined/traces").iterdir())) == 2


def test_results_of_the_former_version_are_merged_into_results_of_this_version() -> None:
    shard(1, outcome("a"), total=2)
    as_former_version(Path("shards/1/results.json"))
    shard(2, outcome("b"), total=2)
    assert merge_results(request()) is ExitCode.PASSED
    assert read().version == 5
    assert [made.end for made in read().outcomes] == ["controllers finished", outcome("b").end]


def test_what_was_not_exercised_in_a_shard_fails_the_whole() -> None:
    shard(1, outcome("a"), total=2)
    as_former_version(Path("shards/1/results.json"), version=2)
    shard(2, unjudged("b"), total=2)
    assert merge_results(request()) is ExitCode.FAILED
    assert [made.status for made in read().outcomes] == ["passed", "not_exercised"]
    assert read().outcomes[1] == unjudged("b")
    junit = Path("joined/junit.xml").read_text()
    assert '<testsuites name="sim-action" tests="2" failures="0" errors="1"' in junit
    assert '<error type="not_exercised" message="never checked:' in junit


def test_what_could_not_be_loaded_takes_no_name_from_a_trace() -> None:
    error = InvalidScenario([Problem(Location("a/same"), "not a scenario")])
    shard(1, Outcome.of_invalid("a/same", error), total=2)
    shard(2, outcome("b/same", trace="traces/same.npz"), total=2)
    assert merge_results(request()) is ExitCode.INVALID
    assert [made.trace for made in read().outcomes] == [None, "traces/same.npz"]


@pytest.mark.parametrize(
    ("kind", "forged"),
    [
        *(("trace", name) for name in ("../../secret", "/etc/hostname", "traces/link.npz", "traces/nope.npz")),
        ("replay", "../../secret"),
        ("recordings", ("recordings/a.sh", "../../secret.csv", "recordings/gone.tum")),
    ],
)
def test_a_file_that_lies_elsewhere_is_left_out(workspace: Path, kind: str, forged: str | tuple[str, ...]) -> None:
    for name in ("secret", "secret.csv"):
        (workspace / name).write_text("secret")
    path = shard(1, outcome("a.sim.yml", trace=None if kind == "trace" else "traces/a.npz"), total=1)
    (path.parent / "traces" / "link.npz").symlink_to("../../../secret")
    (path.parent / "recordings/a.sh").write_text("echo")
    written = Results.read(path)
    made = written.outcomes[0].model_copy(update={kind: forged})
    written.model_copy(update={"outcomes": (made,)}).write(path.parent)
    assert merge_results(request()) is ExitCode.PASSED
    (made,) = read().outcomes
    assert (made.trace, made.replay, made.recordings) == (None if kind == "trace" else "traces/a.npz", None, ())
    assert made.notes == tuple(
        f"its {kind.removesuffix('s')} {name} was not found next to the results of its shard"
        for name in ((forged,) if isinstance(forged, str) else forged)
    )
    assert [folder.name for folder in Path("joined").glob("*s") if folder.is_dir()] == ["traces"] * (kind != "trace")


def test_of_equal_shards_the_longest_is_waited_for_and_nothing_told(capsys: pytest.CaptureFixture[str]) -> None:
    shard(1, outcome("a"), outcome("c"))
    shard(2, outcome("b"))
    assert merge_results(request()) is ExitCode.PASSED
    assert [made.notes for made in read().outcomes] == [(), (), ()]
    assert capsys.readouterr().err == ""
    assert (read().wall_time, read().shard) == (2.0, None)
    assert read().started_at == START


def test_shards_that_were_not_alike_are_not_called_so(capsys: pytest.CaptureFixture[str]) -> None:
    shard(1, outcome("a"), outcome("c"))
    path = shard(2, outcome("b"))
    Results.read(path).model_copy(update={"sim_action": "0.2.0", "platform": "Other"}).write(path.parent)
    assert merge_results(request()) is ExitCode.PASSED
    assert (read().sim_action, read().python, read().platform) == ("0.1.0, 0.2.0", "3.11.7", "Linux, Other")
    assert [made.notes for made in read().outcomes] == [
        ("it ran with sim-action 0.1.0",),
        ("it ran with sim-action 0.2.0",),
        ("it ran with sim-action 0.1.0",),
    ]
    told = "sim-action: the results come from different versions of sim-action: 0.1.0, 0.2.0\n"
    assert capsys.readouterr().err == told


def test_a_made_up_version_is_cut(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    shard(1, outcome("a"), outcome("c"))
    path = shard(2, outcome("b"))
    forged = "\n::error::forged\n##[error]forged" + "x" * 100_000
    Results.read(path).model_copy(update={"sim_action": forged, "python": forged}).write(path.parent)
    merge_results(request())
    assert len(read().sim_action) <= 200
    assert len(read().python) <= 200
    assert all(len(note) < 300 for made in read().outcomes for note in made.notes)
    (line,) = capsys.readouterr().err.splitlines()
    assert "##[" not in line
    assert len(line) < 300


def test_a_missing_shard_is_in_all_reports(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("GITHUB_STEP_SUMMARY", "GITHUB_OUTPUT"):
        monkeypatch.setenv(name, name)
    shard(1, outcome("a"), outcome("c"))
    assert merge_results(request()) is ExitCode.INVALID
    assert 'name="shard 2 of 2"' in Path("joined/junit.xml").read_text()
    assert "shard 2 of 2 returned no results" in Path("GITHUB_STEP_SUMMARY").read_text()
    assert "\nfailure\n" in Path("GITHUB_OUTPUT").read_text()
    assert "shard 2 of 2 returned no results; 1 of 3 scenarios have none" in capsys.readouterr().out


def test_only_new_errors_are_annotated(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    shard(1, outcome("a", holds=False), outcome("c"))
    listing = Listing([source("a"), source("b.sim.yml"), source("c")], [])
    assert merge_results(request(listing=listing)) is ExitCode.INVALID
    (command,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith(("::error", "::warning")))
    assert command.startswith("::error file=b.sim.yml,title=b.sim.yml%3A no result::no shard returned a result")
    merge_results(request())
    assert "\n::error title=shard 2 of 2%3A no results::shard 2 of 2 returned" in capsys.readouterr().out


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
        merge_results(request(*patterns, folder=folder, junit=junit))
    assert {file: file.read_bytes() for file in path.parent.rglob("*") if file.is_file()} == before


def test_the_same_call_again_leaves_out_what_it_has_written(capsys: pytest.CaptureFixture[str]) -> None:
    shard(1, outcome("a", trace="traces/x.npz"), outcome("c"))
    shard(2, outcome("b", trace="traces/x.npz"))
    for patterns in (["shards"], ["."], ["shards/*", "shards/results.json*"]):
        merge_results(request(*patterns, folder="shards"))
        first = read("shards")
        assert len(first.outcomes) == 3
        assert Path("shards/1/traces/x.npz").read_text() == "trace of a"
        capsys.readouterr()
        assert merge_results(request(*patterns, folder="shards")) is ExitCode.PASSED
        assert read("shards") == first
        told = "sim-action: shards/results.json is skipped: an earlier merge wrote it, and this one overwrites it\n"
        assert capsys.readouterr().err == told


def test_what_was_joined_elsewhere_is_joined_like_anything_else() -> None:
    shard(1, outcome("a"), outcome("c"))
    shard(2, outcome("b"))
    merge_results(request(folder="joined"))
    with pytest.raises(UsageError, match="contain results of"):
        merge_results(request(".", folder="again"))
    assert merge_results(request("joined", folder="again")) is ExitCode.PASSED
    assert len(read("again").outcomes) == 3


def test_an_earlier_merge_is_neither_overwritten_nor_a_result_of_a_shard(capsys: pytest.CaptureFixture[str]) -> None:
    shard(1, outcome("a"), total=1)
    merge_results(request())
    listing = Listing([source("a")], [])
    with pytest.raises(UsageError, match="would be overwritten; choose another"):
        merge_results(request("joined/results.json", listing=listing))
    with pytest.raises(UsageError, match=r"no results\.json found at 'joined'"):
        merge_results(request("joined"))
    assert merge_results(request("joined", listing=listing)) is ExitCode.INVALID
    assert "no shard returned any results" in capsys.readouterr().out


@pytest.mark.parametrize("made", [True, False])
def test_if_all_shards_are_lost_every_listed_scenario_is_an_error_in_every_report(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], made: bool
) -> None:
    for name in ("GITHUB_STEP_SUMMARY", "GITHUB_OUTPUT"):
        monkeypatch.setenv(name, name)
    if made:
        Path("shards").mkdir()
    listing = Listing([source("a.sim.yml"), source("deep/b.sim.yml")], [])
    assert merge_results(request(listing=listing)) is ExitCode.INVALID
    assert [(made.file, made.exit_code) for made in read().outcomes] == [
        ("a.sim.yml", ExitCode.INVALID),
        ("deep/b.sim.yml", ExitCode.INVALID),
    ]
    captured = capsys.readouterr()
    assert captured.err == "sim-action: no results.json found at 'shards'\n"
    assert captured.out.count("no shard returned any results") == 2
    assert ET.parse("joined/junit.xml").getroot().get("errors") == "2"
    assert "2 of 2 scenarios did not pass" in Path("GITHUB_STEP_SUMMARY").read_text()
    assert "\nfailure\n" in Path("GITHUB_OUTPUT").read_text()


@pytest.mark.parametrize("pattern", ["nope", "nope.json", "no/pe", "nope*", "empty"])
def test_without_a_listing_nobody_knows_what_is_lost(pattern: str) -> None:
    Path("empty").mkdir()
    shard(1, outcome("a"), total=1)
    with pytest.raises(UsageError) as raised:
        merge_results(request("shards", pattern))
    assert str(raised.value) == (
        f"no results.json found at '{pattern}': download the results of the shards first, "
        "or list the scenarios with --scenarios"
    )
    assert not Path("joined").exists()


def test_with_a_listing_a_place_without_results_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    shard(1, outcome("a"), total=1)
    assert merge_results(request("shards", "nope", listing=Listing([source("a")], []))) is ExitCode.PASSED
    assert capsys.readouterr().err == "sim-action: no results.json found at 'nope'\n"


def test_a_link_that_leads_in_a_circle_is_but_a_name() -> None:
    Path("loop").symlink_to("loop")
    shard(1, outcome("loop"), total=1)
    assert merge_results(request()) is ExitCode.PASSED
    assert ET.parse("joined/junit.xml").find("testsuite[@file='loop']") is not None
    for folder, junit in (("loop", None), ("again", "loop/junit.xml")):
        with pytest.raises(UsageError, match="'loop' is a link"):
            merge_results(request(folder=folder, junit=junit))


def test_very_many_outcomes_of_one_name_take_no_longer_than_others() -> None:
    failure = Failure(kind="crash", title="SIGSEGV", message="it was ended")
    made = Outcome(name="same", file="", status="error", failures=(failure,))

    def work(count: int) -> int:
        stored(Path(f"{count}"), results(*[made] * count))
        return work_of(lambda: merge_results(request(f"{count}", folder=f"joined{count}")))

    work(1)  # what is done once is done
    once, twice, four_times = map(work, (50, 100, 200))
    assert four_times - twice < 1.2 * 2 * (twice - once)


def test_silenced_reports_and_travelled_distances(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    shard(1, outcome("a").model_copy(update={"travelled": 1.5}), total=1)
    asked = request()
    merge_results(replace(asked, reports=replace(asked.reports, silenced=frozenset({"summary"}))))
    assert not Path("summary.md").exists()
    merge_results(asked)
    assert Path("summary.md").exists()
    assert read().travelled == 1.5


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("", "Invalid JSON: EOF"),
        ('{"version": 5, "sim_action": "1", "outcomes": [', "Invalid JSON: EOF"),
        ('{"version": 99}', "its format version is 99, and this sim-action reads 1 to 5"),
        ("\0\xff", "Invalid JSON"),
        ("[" * 100_000, "Invalid JSON"),
    ],
)
def test_an_invalid_shard_costs_no_other(content: str, reason: str, capsys: pytest.CaptureFixture[str]) -> None:
    shard(1, outcome("a.sim.yml"), outcome("c.sim.yml"))
    Path("shards/2").mkdir()
    Path("shards/2/results.json").write_text(content, encoding="latin-1")
    assert merge_results(request()) is ExitCode.INVALID
    found = read()
    assert [made.file for made in found.outcomes[:2]] == ["a.sim.yml", "c.sim.yml"]
    assert [made.status for made in found.outcomes[:2]] == ["passed", "passed"]
    lost = {made.name: made for made in found.outcomes[2:]}
    assert set(lost) == {"shard 2 of 2", "shards/2/results.json"}
    assert reason in lost["shards/2/results.json"].failures[0].message
    assert "run its shard again" in lost["shards/2/results.json"].failures[0].message
    assert "shards/2/results.json" in Path("joined/junit.xml").read_text(encoding="utf-8")
    assert "Traceback" not in capsys.readouterr().err
    with pytest.raises(UsageError, match="is an input of the merge and would be overwritten"):
        merge_results(request(folder="shards/2"))


def test_no_valid_shard_is_a_mistake_of_the_call() -> None:
    for index in (1, 2):
        Path("shards", str(index)).mkdir(parents=True)
        Path("shards", str(index), "results.json").write_text("{}")
    with pytest.raises(UsageError, match="is not a valid results file"):
        merge_results(request())

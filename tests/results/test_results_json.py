"""What all outcomes of a call say to the process that called, and how they are kept."""

from __future__ import annotations

import json
import os
from contextlib import nullcontext
from pathlib import Path

import pytest

from sim_action.core.errors import ExitCode, Location, UsageError
from sim_action.results.outcome import ExpectationOutcome, Failure, FailureKind, Measurement, Outcome
from sim_action.results.results_json import Results, Shard, find_all, read_all
from sim_action.scenario.source import Varied
from sim_action.state.verdict import Judged, Verdict
from tests.outcomes import as_former_version, outcome, results, stored


def made(name: str = "a", kind: FailureKind | None = None, *, passed: bool = True) -> Outcome:
    if kind is None:
        return Outcome(name=name, file=f"{name}.sim.yml", status="passed" if passed else "failed", travelled=1.5)
    failure = Failure(kind=kind, title=kind, message="why")
    return Outcome(name=name, file=f"{name}.sim.yml", status="error", failures=(failure,))


def of_call(*outcomes: Outcome) -> Results:
    return Results(sim_action="0", python="3.11", platform="here", wall_time=1.0, outcomes=outcomes)


@pytest.mark.parametrize(
    ("outcomes", "code", "conclusion"),
    [
        ([made()], 0, "success"),
        ([made(), made(passed=False)], 1, "failure"),
        ([made(kind="crash")], 1, "failure"),
        ([made(kind="missing")], 2, "failure"),
        ([made(passed=False), made(kind="invalid")], 2, "failure"),
        ([made(kind="invalid"), made(kind="internal")], 3, "failure"),
        ([made(kind="internal"), made(kind="interrupted"), made(passed=False)], 130, "cancelled"),
        ([], 5, "failure"),
    ],
)
def test_the_worst_outcome_makes_the_exit_code(outcomes: list[Outcome], code: int, conclusion: str) -> None:
    assert of_call(*outcomes).exit_code == code
    assert of_call(*outcomes).conclusion == conclusion


def test_results_are_read_as_they_were_written(tmp_path: Path) -> None:
    verdict = Verdict(False, 1.12, 1.5, -0.38, "m", 30.0, "travelled 1.12 m of 1.5 m in 30.0 s")
    expectation = ExpectationOutcome(
        name="far", assertion="travel", severity="error", location=Location("a.sim.yml", 9, 5), verdict=verdict
    )
    written = of_call(
        made(passed=False).model_copy(update={"expectations": (expectation,)}), made("b", kind="wall limit")
    )
    assert Results.read(written.write(tmp_path)) == written


def test_differences_without_a_limit_are_no_expectations_of_a_former_version(tmp_path: Path) -> None:
    held, apart = (
        ExpectationOutcome(
            name=name, assertion="agreement", severity="warning", location=Location("a.sim.yml", 1), verdict=verdict
        )
        for name, verdict in (
            ("the same verdicts as pybullet 3.2.7", Verdict(True, message="judged as in pybullet 3.2.7")),
            (
                "distance to pybullet 3.2.7",
                Verdict(True, 0.01, None, None, "m", 0.2, "position differs", judged=Judged(4, 0.0, 0.3)),
            ),
        )
    )
    path = of_call(made().model_copy(update={"expectations": (held, apart)})).write(tmp_path)
    as_former_version(path, version=3)
    (outcome,) = Results.read(path).outcomes
    assert outcome.expectations == (held,)
    assert outcome.measurements == (
        Measurement(name=apart.name, measured=0.01, unit="m", time=0.2, message="position differs"),
    )
    assert Results.read(Results.read(path).write(tmp_path)).outcomes == (outcome,)


HEAD = '"version": 5, "sim_action": "0", "python": "3", "platform": "p"'


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "Invalid JSON: EOF while parsing a value at line 1 column 0"),
        ("[1, 2]", "Input should be an object"),
        ("[" * 100_000, "Invalid JSON: recursion limit exceeded at line 1 column 202"),
        ("{}", "sim_action: Field required (and 4 more)"),
        ('{"version": 6}', "its format version is 6, and this sim-action reads 1 to 5"),
        ('{"version": "2"}', "version: Input should be 5 (and 5 more)"),
        ('{"version": 1}', "sim_action: Field required (and 4 more)"),
        (f'{{{HEAD}, "wall_time": NaN, "outcomes": []}}', "wall_time: Input should be a finite number"),
        (f'{{{HEAD}, "wall_time": "1", "outcomes": []}}', "wall_time: Input should be a valid number"),
        (f'{{{HEAD}, "wall_time": 1, "outcomes": [], "##[error]x": 1}}', "Extra inputs are not permitted"),
        (
            f'{{{HEAD}, "wall_time": 1, "outcomes": [{{"name": "a", "file": "a", "status": "fine"}}]}}',
            (
                "outcomes.0.status: Input should be 'error', 'failed', 'flaky', 'inconclusive', 'not_exercised', "
                "'passed' or 'skipped'"
            ),
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
    assert str(raised.value) == f"{path} is not a valid results file: {told}"


@pytest.mark.parametrize(
    ("former", "end"),
    [
        ("broken", "expectation failed"),
        ("nobody left", "controllers finished"),
        ("test over", "test finished"),
        ("nodes gone", "nodes finished"),
        ("goals met", "goals met"),
        (None, None),
    ],
)
def test_results_of_the_former_version_are_read_with_the_values_of_today(
    tmp_path: Path, former: str | None, end: str | None
) -> None:
    written = of_call(made(), made(kind="crash")).model_copy(update={"selected": True})
    path = written.write(tmp_path)
    as_former_version(path, former)
    outcomes = tuple(outcome.model_copy(update={"end": end}) for outcome in written.outcomes)
    assert Results.read(path) == written.model_copy(update={"outcomes": outcomes})


def test_results_of_version_2_are_read_and_keep_their_status(tmp_path: Path) -> None:
    path = results(outcome("a.sim.yml"), outcome("b.sim.yml", holds=False)).write(tmp_path)
    as_former_version(path, version=2)
    assert [outcome.status for outcome in Results.read(path).outcomes] == ["passed", "failed"]


def test_more_varied_keys_than_a_scenario_has_are_not_read(tmp_path: Path) -> None:
    varied = tuple(Varied(f"a.b{number}", number) for number in range(21))
    for count in (20, 21):
        varying = Outcome(name="a", file="a.sim.yml", status="skipped")
        path = results(varying.model_copy(update={"variation": varied[:count]})).write(tmp_path)
        with nullcontext() if count == 20 else pytest.raises(UsageError, match=r"outcomes\.0\.variation"):
            Results.read(path)


def test_results_larger_than_anybody_writes_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    with path.open("wb") as file:
        file.truncate(64_000_001)
    with pytest.raises(UsageError, match="it is larger than 64 MB"):
        Results.read(path)
    # Nor is a pipe.
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(UsageError, match="not a regular file"):
        Results.read(path)


@pytest.mark.parametrize(("total", "code"), [(2, ExitCode.PASSED), (0, ExitCode.NO_SCENARIO)])
def test_a_shard_without_scenarios_passes_if_the_list_had_some(total: int, code: ExitCode) -> None:
    shard = Shard(index=3, count=3, total=total)
    assert of_call().model_copy(update={"shard": shard}).exit_code is code
    assert of_call(made(passed=False)).model_copy(update={"shard": shard}).exit_code is ExitCode.FAILED


def test_the_worst_come_first_and_one_scenario_tells_its_way() -> None:
    # The worst come first.
    given = of_call(made("fine"), made("failed", passed=False), made("broken", kind="crash"))
    assert [found.name for found in given.worst_first()] == ["broken", "failed", "fine"]
    # How far the robot came is told for one scenario alone.
    assert of_call(made()).travelled == 1.5
    assert of_call(made(), made()).travelled is None


@pytest.fixture
def shards(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """`shards/1`, `shards/2/deep` and the hidden `shards/.3`, each with one results file."""
    monkeypatch.chdir(tmp_path)
    for name in ("1", "2/deep", ".3"):
        stored(tmp_path / "shards" / name, results(outcome(f"{name[-1]}.sim.yml", trace="traces/a.npz")))
    return tmp_path / "shards"


def found(*patterns: str) -> list[str]:
    return [file.path.as_posix() for file in read_all(find_all(patterns))]


def refused(*patterns: str) -> str:
    with pytest.raises(UsageError) as raised:
        found(*patterns)
    assert str(raised.value).isprintable()
    return str(raised.value)


@pytest.mark.usefixtures("shards")
class TestFound:
    def test_a_folder_means_every_one_in_and_below_it(self) -> None:
        everything = ["shards/.3/results.json", "shards/1/results.json", "shards/2/deep/results.json"]
        assert found("shards") == everything
        assert found(".") == everything
        assert found("shards/1") == ["shards/1/results.json"]

    def test_a_file_means_itself_whatever_its_name(self) -> None:
        Path("shards/1/results.json").rename("one")
        assert found("one") == ["one"]

    def test_a_glob_means_folders_and_json_files(self) -> None:
        assert found("shards/*") == ["shards/1/results.json", "shards/2/deep/results.json"]
        assert found("shards/1/*") == ["shards/1/results.json"]
        assert found("shards/**") == found(".")

    def test_each_file_counts_once(self) -> None:
        assert found("shards/1", "./shards/1/results.json", "shards/*/results.json") == ["shards/1/results.json"]

    @pytest.mark.parametrize("pattern", ["shards/1/traces", "nope*", "shards/*/*.xml", "nope", "nope.json", "no/pe"])
    def test_where_there_is_none_nothing_is_found(self, pattern: str) -> None:
        assert find_all(["shards/1", pattern]) == {"shards/1": [Path("shards/1/results.json")], pattern: []}

    @pytest.mark.parametrize(
        ("target", "told"), [("nowhere", "No such file or directory"), ("link", "Too many levels of symbolic links")]
    )
    def test_a_link_that_leads_nowhere_is_an_error(self, target: str, told: str) -> None:
        Path("link").symlink_to(target)
        assert refused("link") == f"link is not a valid results file: {told}"


def test_more_outcomes_than_anybody_has_are_not_read(shards: Path) -> None:
    stored(shards / "4", results(outcome("4.sim.yml")))
    (shards / "5").mkdir()
    (shards / "5" / "results.json").write_text("not read")
    assert len(read_all(find_all(["shards/[124]", "shards/.3"]), most=4)) == 4
    with pytest.raises(UsageError) as raised:
        read_all(find_all(["shards"]), most=3)
    assert str(raised.value) == (
        "shards/4/results.json: this file brings the number of outcomes to 4; at most 3 are allowed"
    )


def test_links_and_broken_files(shards: Path) -> None:
    # A link is not followed but told.
    (shards / "4").mkdir()
    (shards / "4" / "results.json").symlink_to("../1/results.json")
    assert "shards/4/results.json is a link" in refused("shards")
    assert found("shards/4/results.json") == ["shards/4/results.json"]
    (shards / "4" / "results.json").unlink()
    # A broken one is named in one line.
    (shards / "1" / "results.json").write_text('{"version": 1, "outcomes": [')
    assert refused("shards").startswith("shards/1/results.json is not a valid results file: Invalid JSON: EOF")


def refused_with(change: dict[str, object]) -> str:
    """Why the first shard is refused after a change of its outcome."""
    path = Path("shards/1/results.json")
    written = json.loads(path.read_text())
    written["outcomes"][0] |= change
    path.write_text(json.dumps(written))
    return refused("shards/1")


LONG = "x" * 200_001
PLACE = {"file": LONG, "line": 1, "column": 1}


@pytest.mark.usefixtures("shards")
@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"name": LONG}, "name"),
        ({"notes": ["short", LONG]}, "notes.1"),
        ({"failures": [{"kind": "crash", "title": "", "message": "", "location": PLACE}]}, "failures.0.location.file"),
        ({"surroundings": {"allowed": [], "stated": {"world.x": LONG}}}, "surroundings.stated.world.x"),
        ({"surroundings": {"allowed": [], "stated": {"\\" * 200_001: 1}}}, "surroundings.stated"),
    ],
)
def test_texts_have_a_limit(change: dict[str, object], place: str) -> None:
    message = refused_with(change)
    assert message.startswith(f"shards/1/results.json is not a valid results file: outcomes.0.{place}")
    assert "200000 characters" in message
    assert len(message) < 300


@pytest.mark.usefixtures("shards")
@pytest.mark.parametrize(
    "change",
    [
        {"expectations": []},
        {"status": "failed"},
        {"status": "error"},
        {"failures": [{"kind": "crash", "title": "t", "message": "m"}]},
    ],
)
def test_what_contradicts_itself_is_not_believed(change: dict[str, object]) -> None:
    assert refused_with(change) == (
        "shards/1/results.json is not a valid results file: the status of '1.sim.yml' contradicts its failures "
        "or expectations"
    )


def test_half_of_a_surrogate_pair_does_not_lose_the_results(tmp_path: Path) -> None:
    made = outcome("a.sim.yml").model_copy(update={"output": "a\ud800b"})
    path = results(made, outcome("b.sim.yml")).write(tmp_path)
    assert [found.output for found in Results.read(path).outcomes] == ["a?b", ""]


@pytest.mark.parametrize("count", [0, 1, 3])
def test_the_file_is_written_in_parts_and_reads_as_if_written_at_once(count: int, tmp_path: Path) -> None:
    strange = 'quoted "outcomes": []\n}\n and a line\nmore'
    several = [outcome(f"{number}.sim.yml").model_copy(update={"output": strange}) for number in range(count)]
    written = results(*several)
    assert written.write(tmp_path).read_text(encoding="utf-8") == written.model_dump_json(indent=2) + "\n"

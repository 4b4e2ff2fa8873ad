"""Which results are found, and which are not believed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sim_action.core.errors import UsageError
from sim_action.results.reading import find_all, read_all
from tests.outcomes import outcome, results, stored


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
        assert refused("link") == f"link is no results file: {told}"


def test_more_outcomes_than_anybody_has_are_not_read(shards: Path) -> None:
    stored(shards / "4", results(outcome("4.sim.yml")))
    (shards / "5").mkdir()
    (shards / "5" / "results.json").write_text("not read")
    assert len(read_all(find_all(["shards/[124]", "shards/.3"]), most=4)) == 4
    with pytest.raises(UsageError) as raised:
        read_all(find_all(["shards"]), most=3)
    assert str(raised.value) == "shards/4/results.json: with its outcomes there are more than 3, which is the most"


def test_a_link_is_not_followed_but_told(shards: Path) -> None:
    (shards / "4").mkdir()
    (shards / "4" / "results.json").symlink_to("../1/results.json")
    assert "shards/4/results.json is a link" in refused("shards")
    assert found("shards/4/results.json") == ["shards/4/results.json"]


def test_a_broken_one_is_named_in_one_line(shards: Path) -> None:
    (shards / "1" / "results.json").write_text('{"version": 1, "outcomes": [')
    assert refused("shards").startswith("shards/1/results.json is no results file: Invalid JSON: EOF")


@pytest.mark.parametrize(
    "change",
    [
        {"expectations": []},
        {"status": "failed"},
        {"status": "error"},
        {"failures": [{"kind": "crash", "title": "t", "message": "m"}]},
    ],
)
def test_what_contradicts_itself_is_not_believed(shards: Path, change: dict[str, object]) -> None:
    path = shards / "1" / "results.json"
    written = json.loads(path.read_text())
    written["outcomes"][0] |= change
    path.write_text(json.dumps(written))
    assert refused("shards/1") == (
        "shards/1/results.json is no results file: what it says of '1.sim.yml' contradicts itself"
    )

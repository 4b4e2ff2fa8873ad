"""A pattern or tag that selects no scenario is an error in every report, and the others run."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from sim_action.cli.main import call
from sim_action.results.results_json import Results

SCENARIO = """\
name: {name}
tags: [{tag}]
robot: {{model: turtlebot3_burger}}
expect: [upright: {{max_tilt: 20 deg}}]
time_limit: 0.1 s
"""
MESSAGE = "no scenario is named 'drve'; did you mean 'drive'? (allowed: drive, turn)"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "a.sim.yml").write_text(SCENARIO.format(name="drive", tag="quick"))
    (tmp_path / "b.sim.yml").write_text(SCENARIO.format(name="turn", tag="slow"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def outcomes(folder: Path) -> list[tuple[str, str]]:
    return [(each.name, each.status) for each in Results.read(folder / "results.json").outcomes]


def test_it_is_an_error_in_every_report_and_the_others_run(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(folder / "summary.md"))
    assert call(["run", "--only", "turn", "--only", "drve", "--tag", "slow", "--tag", "nightly"]) == 2
    results = folder / "sim-results"
    expected = [("turn", "passed"), ("--only drve", "error"), ("--tag nightly", "error")]
    assert outcomes(results) == expected
    errors = [
        suite.get("name")
        for suite in ET.parse(results / "junit.xml").iter("testsuite")
        if suite.find(".//error") is not None
    ]
    assert errors == ["--only drve", "--tag nightly"]
    texts = [(folder / "summary.md").read_text(), (results / "report.html").read_text(), capsys.readouterr().out]
    for text in texts:
        assert "drve" in text
        assert "nightly" in text
    assert MESSAGE in texts[-1]


def test_only_the_first_shard_reports_it_and_a_merge_has_it_once(folder: Path) -> None:
    only = ["--only", "drive", "--only", "turn", "--only", "drve"]
    for index, (code, found) in enumerate([(2, ["drive", "--only drve"]), (0, ["turn"])], start=1):
        place = folder / f"part{index}"
        assert call(["run", "-q", *only, "--shard", f"{index}/2", "--output-dir", str(place)]) == code
        assert [name for name, _ in outcomes(place)] == found
    listed = [[], ["--scenarios", ".", *only]]
    for options in listed:
        assert call(["merge", "-q", "part1", "part2", *options, "--output-dir", "whole"]) == 2
        assert outcomes(folder / "whole") == [("drive", "passed"), ("turn", "passed"), ("--only drve", "error")]


def test_nothing_at_all_runs_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["run", "--only", "drve"]) == 2
    printed = capsys.readouterr().err
    assert MESSAGE in printed
    assert "of 2 scenarios, none is selected" in printed
    assert not Path("sim-results").exists()


def test_a_list_tells_it_and_so_does_a_matrix(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["run", "--list", "--only", "turn", "--only", "drve"]) == 2
    printed = capsys.readouterr()
    assert printed.out == "turn\tb.sim.yml:1\tslow\n"
    assert printed.err == f"--only: {MESSAGE}\n"
    for options in (["--exclude-tag", "slow"], ["--exclude", "t*"], ["--tag", "quick"]):
        assert call(["run", "--list", *options]) == 0
        assert capsys.readouterr().out == "drive\ta.sim.yml:1\tquick\n"
    assert call(["matrix", "--shards", "2", "--only", "turn", "--only", "drve"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert MESSAGE in printed.err


def test_a_shard_of_a_matrix_has_scenarios_for_some_patterns_only(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    only = ["--only", "turn", "--only", "drive"]
    assert call(["matrix", "--shards", "2", *only]) == 0
    shards = json.loads(capsys.readouterr().out)["include"]
    for shard in shards:
        assert call(["run", "-q", *shard["scenario"].split("\n"), *only]) == 0
        assert len(outcomes(folder / "sim-results")) == 1

"""`sim-action compare`: from two results on disk to reports and an exit code."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sim_action.cli.compare import compare_results
from sim_action.cli.main import call
from sim_action.core.errors import ExitCode, UsageError
from tests.outcomes import as_former_version, outcome, results, stored, unjudged


@pytest.fixture(autouse=True)
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two runs, of which the second fails; one scenario, which passes, then is slower by half, and then is gone."""
    monkeypatch.chdir(tmp_path)
    for name in os.environ:
        if name.startswith("GITHUB_"):
            monkeypatch.delenv(name)
    stored(Path("old"), results(outcome("a.sim.yml"), outcome("b.sim.yml")))
    stored(Path("new"), results(outcome("a.sim.yml"), outcome("b.sim.yml", holds=False)))
    made = outcome("a.sim.yml").model_copy(update={"sim_time": 60.0, "real_time_factor": 100.0})
    stored(Path("one"), results(made))
    stored(Path("slow"), results(made.model_copy(update={"real_time_factor": 55.0})))
    stored(Path("none"), results())


@pytest.mark.parametrize(
    ("typed", "code"),
    [
        ("one one", 0),
        ("one none", 1),
        ("one none --allow-removed", 0),
        ("one none --allow-removed --strict", 1),
        ("none one", 0),
        ("none none", 0),
        ("one slow --strict", 0),
        ("one slow --strict --slower 0.6", 1),
        ("one slow --slower 60", 2),
        ("one missing", 2),
        ("one", 2),
    ],
)
def test_exit_codes(typed: str, code: int) -> None:
    assert call(["compare", *typed.split()]) == code


@pytest.mark.parametrize(("new", "warned"), [("one", True), ("./one", True), ("slow", False)])
def test_a_comparison_with_itself_is_a_warning(new: str, warned: bool, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["compare", "one", new]) == 0
    assert ("one is compared with itself" in capsys.readouterr().err) is warned


def test_files_and_folders_are_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    assert compare_results("old", "new") is ExitCode.FAILED
    first = capsys.readouterr().out
    assert compare_results("old/results.json", "new/results.json") is ExitCode.FAILED
    assert capsys.readouterr().out == first
    assert first.splitlines()[-1] == "1 newly fails, 1 still passes"


def test_former_results_are_compared() -> None:
    assert compare_results("new", "old", strict=True) is ExitCode.PASSED
    as_former_version(Path("old/results.json"))
    assert compare_results("old", "new") is ExitCode.FAILED
    assert compare_results("new", "old", strict=True) is ExitCode.PASSED


@pytest.mark.parametrize("version", [1, 2, 3, 4])
def test_a_pass_of_any_version_newly_fails_if_not_exercised(version: int, capsys: pytest.CaptureFixture[str]) -> None:
    if version < 4:
        as_former_version(Path("old/results.json"), version=version)
    stored(Path("unread"), results(outcome("a.sim.yml"), unjudged("b.sim.yml")))
    assert compare_results("old", "unread") is ExitCode.FAILED
    found = capsys.readouterr().out
    assert "newly fails  b  b.sim.yml  travel: never checked: sensor 'lidar' had no reading\n" in found
    assert compare_results("unread", "old", strict=True) is ExitCode.PASSED
    assert "fixed  b  b.sim.yml  not exercised before: travel: never checked" in capsys.readouterr().out


def test_what_failed_is_not_fixed_by_checking_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    stored(Path("unread"), results(outcome("a.sim.yml"), unjudged("b.sim.yml")))
    compare_results("new", "unread")
    assert "fails differently  b  b.sim.yml  was: failed; travel: never checked" in capsys.readouterr().out
    compare_results("unread", "unread")
    assert "still fails  b  b.sim.yml  travel: never checked" in capsys.readouterr().out


def test_shards_are_one_run() -> None:
    for index, name in ((1, "a.sim.yml"), (2, "b.sim.yml")):
        stored(Path("shards", str(index)), results(outcome(name), shard=(index, 2, 2)))
    assert compare_results("old", "shards", strict=True) is ExitCode.PASSED


def test_a_shard_that_is_lost_fails(capsys: pytest.CaptureFixture[str]) -> None:
    stored(Path("shards/1"), results(outcome("a.sim.yml"), shard=(1, 2, 2)))
    assert compare_results("old", "shards") is ExitCode.FAILED
    assert "shard 2 of 2" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("nowhere", "new", "no results.json found at 'nowhere'"),
        ("old", "empty", "no results.json found at 'empty'"),
        ("old", "*.none", "no results.json found at '*.none'"),
        ("text", "new", "text is not a valid results file"),
    ],
)
def test_what_cannot_be_compared(old: str, new: str, complaint: str) -> None:
    Path("empty").mkdir()
    Path("text").write_text("{}")
    with pytest.raises(UsageError) as error:
        compare_results(old, new)
    assert complaint in str(error.value)
    assert error.value.exit_code is ExitCode.INVALID


def test_markdown_goes_to_a_file_or_takes_the_place_of_what_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    compare_results("old", "new", markdown="comment.md")
    assert Path("comment.md").read_text(encoding="utf-8").startswith("## ❌ 1 scenario newly fails\n")
    assert "##" not in capsys.readouterr().out
    assert compare_results("old", "new", markdown="-") is ExitCode.FAILED
    assert capsys.readouterr().out.startswith("## ❌ 1 scenario newly fails\n")
    assert not Path("-").exists()
    with pytest.raises(UsageError, match=r"--markdown no/such\.md cannot be written: No such file or directory"):
        compare_results("old", "new", markdown="no/such.md")
    Path("mine.md").write_text("mine")
    with pytest.raises(UsageError, match=r"--markdown mine\.md exists and is not a comparison"):
        compare_results("old", "new", markdown="mine.md")


def test_github_gets_a_summary_and_outputs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    monkeypatch.setenv("GITHUB_OUTPUT", "output")
    Path("summary.md").write_text("before\n")
    compare_results("old", "new", summary=False)
    assert Path("summary.md").read_text() == "before\n"
    Path("output").unlink()
    compare_results("old", "new")
    assert Path("summary.md").read_text(encoding="utf-8").startswith("before\n## ❌ 1 scenario newly fails\n")
    lines = Path("output").read_text().splitlines()
    assert [lines[0].partition("<<")[0], lines[1]] == ["newly-failing", "1"]
    assert [lines[3].partition("<<")[0], lines[4]] == ["warnings", "0"]


def test_a_scenario_that_checks_less_is_a_warning(capsys: pytest.CaptureFixture[str]) -> None:
    strict, weak = outcome("a.sim.yml"), outcome("a.sim.yml")
    (travel,) = strict.expectations
    more = (travel, travel.model_copy(update={"name": "stay upright", "assertion": "upright"}))
    stored(Path("strict"), results(strict.model_copy(update={"expectations": more})))
    stored(Path("weak"), results(weak))
    assert compare_results("strict", "weak", markdown="comment.md") is ExitCode.PASSED
    assert "no longer checked  a  a.sim.yml  stay upright: removed from the scenario" in capsys.readouterr().out
    assert "| no longer checked |" in Path("comment.md").read_text(encoding="utf-8")
    assert compare_results("strict", "weak", strict=True) is ExitCode.FAILED
    assert compare_results("weak", "strict", strict=True) is ExitCode.PASSED

"""`sim-action compare`, as it is typed."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.cli.main import call
from tests.outcomes import outcome, results, stored


@pytest.fixture(autouse=True)
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One scenario, which passes; then it is slower by half, and is gone."""
    monkeypatch.chdir(tmp_path)
    for name in ("GITHUB_STEP_SUMMARY", "GITHUB_OUTPUT", "GITHUB_ACTIONS"):
        monkeypatch.delenv(name, raising=False)
    made = outcome("a.sim.yml").model_copy(update={"sim_time": 60.0, "real_time_factor": 100.0})
    stored(Path("old"), results(made))
    stored(Path("slow"), results(made.model_copy(update={"real_time_factor": 55.0})))
    stored(Path("none"), results())


@pytest.mark.parametrize(
    ("typed", "code"),
    [
        ("old old", 0),
        ("old none", 1),
        ("old none --allow-removed", 0),
        ("old none --allow-removed --strict", 1),
        ("none old", 0),
        ("none none", 0),
        ("old slow --strict", 0),
        ("old slow --strict --slower 0.6", 1),
        ("old slow --slower 60", 2),
        ("old missing", 2),
        ("old", 2),
    ],
)
def test_exit_codes(typed: str, code: int) -> None:
    assert call(["compare", *typed.split()]) == code


@pytest.mark.parametrize(("new", "warned"), [("old", True), ("./old", True), ("slow", False)])
def test_results_compared_with_themselves_are_a_warning(
    new: str, warned: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(["compare", "old", new]) == 0
    assert ("old is compared with itself" in capsys.readouterr().err) is warned


def test_what_is_wrong_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    call(["compare", "old", "missing"])
    assert "sim-action: no results.json found at 'missing'" in capsys.readouterr().err

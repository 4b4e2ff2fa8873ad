"""The page of one run for a notebook."""

from __future__ import annotations

from pathlib import Path

from sim_action.reports import ReportOptions
from sim_action.reports.html.notebook import outcome_page
from tests.outcomes import like, outcome
from tests.replays import drive, kept


def options(folder: Path) -> ReportOptions:
    return ReportOptions(folder, folder / "junit.xml", junit_strict=False, environment={}, workspace=folder)


def test_a_run_of_a_gate_is_shown_alone(tmp_path: Path) -> None:
    name = kept(drive(), tmp_path, "cart")
    ran = like(outcome("cart.sim.yml"), replay=name, gate="often", group="cart")
    made = outcome_page(ran, options(tmp_path))
    assert made is not None
    text = made.text()
    assert '<html lang="en" data-embed>' in text
    assert text.count("<article") == 1
    assert "<nav" not in text


def test_a_run_without_a_replay_has_no_page(tmp_path: Path) -> None:
    assert outcome_page(outcome("a.sim.yml"), options(tmp_path)) is None
    lost = outcome("a.sim.yml", replay="replays/lost.json.gz")
    assert outcome_page(lost, options(tmp_path)) is None
    outside = outcome("a.sim.yml", replay="../cart.json.gz")
    assert outcome_page(outside, options(tmp_path)) is None

"""The saved figures of the comparison with hand-written tests become a table with goals, machines and versions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tools.bench.by_hand.comparisons import Settings
from tools.bench.by_hand.measured import FILE, Row, load, save
from tools.bench.by_hand.processes import Orientation
from tools.bench.table import Ratio
from tools.docs.generators import by_hand

ROW = Row("one", 0.5, 0.4, 1.0, 2.0, 7, "2026-01-02", "a machine", "sim-action 1")


def test_rows_show_ratio_goal_times_and_circumstances(monkeypatch: pytest.MonkeyPatch) -> None:
    step = replace(ROW, name="step", ours=52e-6, theirs=50e-6, goal=1.05, wall=None)
    long = replace(step, name="many", ours=30.0, theirs=40.0, date="2026-01-03", rounds=9)
    monkeypatch.setattr(by_hand, "load", lambda: [ROW, step, long])
    assert by_hand.costs().splitlines()[2:] == [
        "| one | **1.25** | <= 1 | 500 ms | 400 ms |",
        "| step | 1.04 | <= 1.05 | 52 µs | 50 µs |",
        "| many | 0.75 | <= 1.05 | 30.0 s | 40.0 s |",
        "",
        "- 2026-01-02, a machine; sim-action 1; medians of 7 runs: one; step.",
        "- 2026-01-03, a machine; sim-action 1; medians of 9 runs: many.",
    ]


def test_without_figures_the_table_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(by_hand, "load", list)
    assert by_hand.costs() == "No figures have been saved yet.\n"


def test_a_row_that_is_not_measured_again_keeps_its_figures(tmp_path: Path) -> None:
    path = tmp_path / "measured.json"
    assert load(path) == []
    settings = Settings(tmp_path, rounds=3)
    save([Ratio("a", 1, 2, 1), Orientation("a", 3, 2, 0.4), "a text", Ratio("b", 1, 2, 1)], settings, path)
    save([Ratio("b", 5, 2, 1)], replace(settings, rounds=2), path)
    first, second = load(path)
    assert (first.name, first.ratio, first.wall, first.rounds) == ("a", 0.5, 1.5, 3)
    assert (second.name, second.ours, second.wall, second.rounds) == ("b", 5, None, 2)
    assert "cores" in first.machine
    assert first.versions.startswith("sim-action ")


def test_the_figures_of_this_repository_can_be_read() -> None:
    assert not FILE.exists() or by_hand.costs().startswith("| job ")

"""The quadrotor of the examples: Python and C fly it bit by bit alike, and a gust of three times the force fails."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from sim_action.simulation.loop import SimulationRun
from tests.integration.engines import on_every_engine
from tests.simulated import run_of

EXAMPLE = Path(__file__).parents[2] / "examples/quadrotor"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return shutil.copytree(EXAMPLE, tmp_path / "quadrotor")


def statuses(run: SimulationRun) -> set[str]:
    return {verdict.status for verdict in run.verdicts}


@on_every_engine
def test_it_hovers_bit_by_bit_alike_in_python_and_in_c(engine: str, folder: Path) -> None:
    python = run_of(folder / "hover.sim.yml", backend=engine)
    assert statuses(python) == {"passed"}
    if shutil.which("cc") is None:
        pytest.skip("no C compiler, which the scenario of hover.c starts")
    compiled = run_of(folder / "hover_in_c.sim.yml", backend=engine)
    assert statuses(compiled) == {"passed"}
    assert compiled.digest == python.digest


@on_every_engine
def test_it_holds_its_place_in_a_gust_the_same_way_each_time_but_not_in_three_times_the_gust(
    engine: str, folder: Path
) -> None:
    gust = folder / "gust.sim.yml"
    first, second = (run_of(gust, backend=engine) for _ in range(2))
    assert statuses(first) == {"passed"}
    assert first.digest == second.digest
    assert not any("settle" in note for note in first.notes)
    text = gust.read_text(encoding="utf-8")
    stronger = re.sub(r"(-?[\d.]+)(?= N)", lambda found: f"{3 * float(found[1]):g}", text)
    assert "[9 N, 0, 0]" in stronger
    gust.write_text(stronger, encoding="utf-8")
    assert "failed" in statuses(run_of(gust, backend=engine))


@on_every_engine
def test_without_settle_0_it_falls_before_the_start_and_a_note_says_so(engine: str, folder: Path) -> None:
    gust = folder / "gust.sim.yml"
    text = gust.read_text(encoding="utf-8").replace("physics: {settle: 0 s}\n", "")
    gust.write_text(text.replace("duration: 4.5 s", "duration: 0.6 s"), encoding="utf-8")
    fallen = run_of(gust, backend=engine)
    assert any("fell 0.9" in note and "physics: {settle: 0}" in note for note in fallen.notes), fallen.notes

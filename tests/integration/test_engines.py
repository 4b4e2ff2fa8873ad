"""Scenarios on both engines, through the command line: names, comparison, exit codes, reports."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sim_action.engines import ENGINES
from sim_action.state.trace_storage import load_trace
from tests.integration.conftest import outcomes, sim_action

ENGINE_NAMES = tuple(ENGINES)
for _engine in ENGINE_NAMES:
    pytest.importorskip(_engine, reason=f"it takes two engines, and {_engine} is not installed")

DRIVES = """\
name: drives
robot: {model: turtlebot3_burger}
commands: {twist: [{linear: 0.5}]}
expect: [{travel: {at_least: 1 m}}]
"""


def run(folder: Path, text: str = "", *flags: str) -> tuple[int, list[dict[str, Any]]]:
    """Exit code and outcomes."""
    (folder / "drives.sim.yml").write_text(f"{DRIVES}{text}\ntime_limit: 5 s\n")
    code = sim_action(folder, "run", *flags).returncode
    return code, outcomes(folder)


def test_all_engines_run_it_under_names_of_their_own_and_are_compared(tmp_path: Path) -> None:
    code, both = run(tmp_path, "", "--backend", "all")
    assert code == 0
    assert [outcome["name"] for outcome in both] == ["drives [pybullet]", "drives [mujoco]"]
    assert [outcome["engine"].split()[0] for outcome in both] == list(ENGINE_NAMES)
    assert [len(outcome["expectations"]) for outcome in both] == [1, 2]
    assert not both[0]["measurements"]
    position, yaw = both[1]["measurements"]
    assert (position["name"], yaw["name"]) == ("distance to pybullet 3.2.7", "difference in yaw to pybullet 3.2.7")
    assert 0 < position["measured"] < 0.005
    assert 0 < yaw["measured"] < 0.01
    for outcome in both:
        assert len(load_trace(tmp_path / "sim-results" / outcome["trace"])) > 10


def test_agreement_that_was_asked_and_is_missed_fails_on_its_line(tmp_path: Path) -> None:
    code, both = run(tmp_path, "agreement: {position: 0.001 mm}")
    assert code == 1
    assert [outcome["status"] for outcome in both] == ["passed", "failed"]
    (missed,) = [one for one in both[1]["expectations"] if not one["verdict"]["passed"]]
    assert missed["name"] == "the same position as pybullet 3.2.7"
    assert missed["location"]["line"] == 5


def test_each_engine_has_one_digest_alone_and_among_others(tmp_path: Path) -> None:
    for number in range(4):
        (tmp_path / f"{number}.sim.yml").write_text(DRIVES + "time_limit: 5 s\n")
    _, alone = run(tmp_path, "", "--backend", "all")
    sim_action(tmp_path, "run", "--backend", "all", "--jobs", "2")
    several = outcomes(tmp_path)
    assert len(several) == 10
    digests = {(outcome["engine"], outcome["digest"]) for outcome in (*alone, *several)}
    assert len(digests) == len(ENGINE_NAMES)

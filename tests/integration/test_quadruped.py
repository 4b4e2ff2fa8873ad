"""The built-in quadruped on real engines: its example, and the force that tips it over against its formula."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sim_action.cli.init import files
from sim_action.engines import installed
from sim_action.scenario.loading import build_scene
from sim_action.simulation.loop import SimulationRun, simulate
from tests.scenarios import load
from tools.bench.robots import QUADRUPED_STANCE

EXAMPLE = (Path(__file__).parents[2] / "examples/quadruped/push.sim.yml").read_text(encoding="utf-8")
STANCE = ", ".join(f"{name}: {angle}" for name, angle in QUADRUPED_STANCE.items())
# N: a force on the trunk, at the height of the hips, turns the robot about its left or right feet.
TIPPING = (
    9.0 * 9.80665 * (0.049 + 0.062) / (0.209 * math.cos(math.radians(40)) + 0.175 * math.cos(math.radians(50)) + 0.02)
)


def run(folder: Path, engine: str, text: str) -> SimulationRun:
    loaded = load(folder, f"{text}backend: {engine}\n")
    assert loaded.warnings == ()
    return simulate(loaded.scenario, build_scene(loaded), lambda _: None)


@pytest.mark.parametrize("engine", installed())
def test_the_example_passes_clearly_and_always_with_the_same_digest(engine: str, tmp_path: Path) -> None:
    first, again = (run(tmp_path, engine, EXAMPLE) for _ in range(2))
    assert first.digest == again.digest
    assert [verdict.status for verdict in first.verdicts] == ["passed"] * len(first.verdicts)
    margins = [verdict.margin or 0.0 for verdict in first.verdicts]
    tilt, _, support, inside, *_ = margins
    assert tilt > math.radians(4)
    assert support > 0.05
    assert inside > 0.005


@pytest.mark.parametrize("engine", installed())
def test_the_example_fails_if_the_push_is_doubled(engine: str, tmp_path: Path) -> None:
    doubled = EXAMPLE.replace("force: [0, 20 N, 0]", "force: [0, 40 N, 0]")
    assert doubled != EXAMPLE
    _, feet, support, *_ = run(tmp_path, engine, doubled).verdicts
    assert (feet.status, support.status) == ("failed", "failed")
    assert "3 of 4 feet on the ground" in feet.message


def pushed(folder: Path, engine: str, force: float) -> float:
    """Return the largest tilt in deg under a force that lasts for 1.4 s."""
    text = (
        f"name: pushed\nrobot: {{model: quadruped, joints: {{{STANCE}}}}}\n"
        f"world: {{disturbances: [{{at: 0.1 s, for: 1.4 s, force: [0, {force}, 0]}}]}}\n"
        "expect: [upright: {max_tilt: 100 deg}]\ntime_limit: 1.5 s\ntrace: {rate: 60 Hz}\n"
    )
    x, y = run(folder, engine, text).trace.base_orientation_xyzw[:, :2].T
    return float(np.degrees(np.arccos(1 - 2 * (x * x + y * y))).max())


@pytest.mark.parametrize("engine", installed())
def test_it_tips_over_at_the_force_of_its_weight_and_its_feet(engine: str, tmp_path: Path) -> None:
    assert 1.5 * 20 < TIPPING < 0.9 * 40
    assert pushed(tmp_path, engine, 0.85 * TIPPING) < 3
    assert pushed(tmp_path, engine, 1.1 * TIPPING) > 45


@pytest.mark.parametrize("engine", installed())
def test_its_first_scenario_passes(engine: str, tmp_path: Path) -> None:
    verdicts = run(tmp_path, engine, files("", "quadruped")["simulation/keep_standing.sim.yml"]).verdicts
    assert [verdict.status for verdict in verdicts] == ["passed"] * 4

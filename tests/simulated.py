"""Runs of scenarios in the process of the test."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from sim_action.core.permissions import Permissions
from sim_action.engines import ENGINES
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.simulation.loop import SimulationRun, simulate


def simulated(folder: Path, scenario: str | Mapping[str, Any], *, outside: bool = False) -> SimulationRun:
    """The run of a scenario, given as text or as its keys. Where the engine of its keys is missing, skips the test.

    :param outside: models may lie outside of the folder.
    """
    if not isinstance(scenario, str):
        if engine := scenario.get("backend"):
            pytest.importorskip(ENGINES[engine].package, reason=f"{engine} is not installed")
        scenario = json.dumps(scenario)
    path = folder / "s.sim.yml"
    path.write_text(scenario, encoding="utf-8")
    return run_of(path, outside=outside)


def run_of(path: Path, *, outside: bool = False, **changes: Any) -> SimulationRun:
    """The run of a scenario file; `changes` replace parts of the scenario."""
    loaded = load_scenario(path, Permissions(outside=outside))
    return simulate(loaded.scenario.model_copy(update=changes), build_scene(loaded), lambda _: None)

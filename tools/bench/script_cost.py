"""Measure the cost of a Python controller at 50 Hz: the loop of a run with one, against a run without."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.simulation.loop import simulate
from tools.bench.engines import PACKAGES

_ROUNDS: Final = 20
"""Noise only ever adds: the least time counts."""

# 50 Hz does not divide the usual 240 Hz.
_SCENARIO: Final = """\
name: burger drives straight
robot: {{model: turtlebot3_burger}}
physics: {{rate: 250 Hz}}
commands: {{rate: 50 Hz, {source}}}
expect: [upright]
time_limit: 10 s
"""
_CONTROLLER: Final = """\
from sim_action import Twist

class Controller:
    def step(self, observation):
        x, _, _ = observation.pose.position_xyz
        return Twist.planar(0.2 if x < 100 else 0.0)
"""


class ScriptCost(NamedTuple):
    """Seconds of wall time of the loop on one engine, for the same trajectory."""

    engine: str
    by_script: float
    by_twists: float


def script_costs() -> Iterator[ScriptCost]:
    """For each engine; both kinds of run take turns in this process."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "controller.py").write_text(_CONTROLLER)
        script, twists = _loaded(folder, "script: controller.py"), _loaded(folder, "twist: [{linear: 0.2}]")
        for engine in PACKAGES:
            rounds = [(_seconds(script, engine), _seconds(twists, engine)) for _ in range(_ROUNDS + 1)]
            by_script, by_twists = map(min, zip(*rounds[1:], strict=True))
            yield ScriptCost(engine, by_script, by_twists)


def _loaded(folder: Path, source: str) -> LoadedScenario:
    path = folder / "s.sim.yml"
    path.write_text(_SCENARIO.format(source=source))
    return load_scenario(path)


def _seconds(loaded: LoadedScenario, engine: str) -> float:
    scenario = loaded.scenario.model_copy(update={"backend": engine})
    return simulate(scenario, build_scene(loaded), lambda _: None).wall_time

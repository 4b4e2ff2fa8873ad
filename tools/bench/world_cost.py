"""Measure a map of 200 boxes: its loading, and the loop of a run in it against one with a single box."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.simulation.loop import simulate
from tools.bench.engines import PACKAGES

BOXES: Final = 200

_ROUNDS: Final = 10
"""Noise only ever adds: the least time counts."""

_CELLS: Final = 1000

_SCENARIO: Final = """\
name: burger drives straight
robot: {{model: turtlebot3_burger}}
{world}
commands: {{rate: 10 Hz, twist: [{{linear: 0.2}}]}}
expect: [upright, no_collision]
time_limit: 10 s
"""
_MAP: Final = "image: map.pgm\nresolution: 0.05\norigin: [-25, -25, 0]\n"


class WorldCost(NamedTuple):
    """Seconds of wall time on one engine: of the loop in the map and beside one box, and of reading the map."""

    engine: str
    mapped: float
    bare: float
    reading: float


def world_costs() -> Iterator[WorldCost]:
    """For each engine; both kinds of run take turns in this process."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_map(folder)
        started = time.perf_counter()
        mapped = _loaded(folder, "world: {objects: [{name: house, map: {file: map.yaml}}]}")
        reading = time.perf_counter() - started
        assert len(mapped.parts["house"]) == BOXES
        bare = _loaded(folder, "world: {objects: [{name: box, box: [1, 1, 1], pose: {y: 5}}]}")
        for engine in PACKAGES:
            rounds = [(_seconds(mapped, engine), _seconds(bare, engine)) for _ in range(_ROUNDS + 1)]
            in_map, beside_box = map(min, zip(*rounds[1:], strict=True))
            yield WorldCost(engine, in_map, beside_box, reading)


def _write_map(folder: Path) -> None:
    """Short walls all over 50 m x 50 m, but for the lane that is driven."""
    pixels = np.full((_CELLS, _CELLS), 254, np.uint8)
    for number in range(BOXES):
        row, column = 44 + 48 * (number // 10), 30 + 97 * (number % 10)
        pixels[row : row + 2, column : column + 40] = 0
    header = f"P5 {_CELLS} {_CELLS} 255\n".encode()
    (folder / "map.pgm").write_bytes(header + pixels.tobytes())
    (folder / "map.yaml").write_text(_MAP)


def _loaded(folder: Path, world: str) -> LoadedScenario:
    path = folder / "s.sim.yml"
    path.write_text(_SCENARIO.format(world=world))
    return load_scenario(path)


def _seconds(loaded: LoadedScenario, engine: str) -> float:
    scenario = loaded.scenario.model_copy(update={"backend": engine})
    return simulate(scenario, build_scene(loaded), lambda _: None).wall_time

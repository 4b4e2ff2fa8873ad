"""Measure the cost of a replay: a run that records one and writes it, against the same run without."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from sim_action.recording.replay.build import make_replay
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.simulation.loop import simulate
from sim_action.simulation.recorder import RunRecorder

ROUNDS: Final = 7

WORLDS: Final = {
    "on its own": "[]",
    "beside a wall, two balls and a door": "[{name: wall, box: [0.1, 2, 0.5], pose: {x: -3}}, "
    "{name: left, sphere: {radius: 10 cm}, mass: 1, pose: {y: 2}}, "
    "{name: right, sphere: {radius: 10 cm}, mass: 1, pose: {y: -2}}, "
    "{name: door, box: [0.1, 1, 1], pose: {x: -2}, path: [{at: 0, x: -2}, {at: 30, x: -4}]}]",
}
SCENARIO: Final = """\
name: burger drives on
robot: {{model: turtlebot3_burger}}
world: {{objects: {objects}}}
commands: {{rate: 10 Hz, twist: [{{linear: 1.0}}]}}
expect: [{{travel: {{at_least: 1.5 m}}}}]
duration: 30 s
time_limit: 30 s
backend: {engine}
"""


class FilmingCost(NamedTuple):
    """Seconds that a replay adds to a run, and those of PyBullet's loop without it; bytes of the replay's file."""

    engine: str
    world: str
    added: float
    run: float
    size: int


def filming_costs() -> Iterator[FilmingCost]:
    """The least of several rounds in which all take turns."""
    for world, objects in WORLDS.items():
        with tempfile.TemporaryDirectory() as name:
            path, file, calls = Path(name, "a.sim.yml"), Path(name, "replay.json.gz"), []
            for engine in ("pybullet", "mujoco"):
                path.write_text(SCENARIO.format(objects=objects, engine=engine))
                loaded = load_scenario(path)
                calls += [_filmed(loaded, file), _plain(loaded)]
            rounds = [[call() for call in calls] for _ in range(ROUNDS)]
            filmed, plain, filmed_too, plain_too = map(min, zip(*rounds, strict=True))
            size = file.stat().st_size
            yield FilmingCost("pybullet", world, max(0.0, filmed - plain), plain, size)
            yield FilmingCost("mujoco", world, max(0.0, filmed_too - plain_too), plain, size)


def _filmed(loaded: LoadedScenario, file: Path) -> Callable[[], float]:
    def call() -> None:
        scene, footage = build_scene(loaded), RunRecorder(loaded.scenario, filmed=True)
        simulate(loaded.scenario, scene, lambda _: None, footage)
        film = footage.film()
        assert film is not None
        assert footage.start is not None
        make_replay(loaded.scenario, scene, footage.start, film, file)

    return partial(_seconds, call)


def _plain(loaded: LoadedScenario) -> Callable[[], float]:
    return partial(_seconds, lambda: simulate(loaded.scenario, build_scene(loaded), lambda _: None))


def _seconds(call: Callable[[], object]) -> float:
    """Return the processor time of a call in s. Wall time is too noisy for so small a difference."""
    started = time.process_time()
    call()
    return time.process_time() - started

"""Measure the cost of recordings against the loop of a run of 30 s without any."""

from __future__ import annotations

import io
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

from sim_action.recording.export import EXPORTS
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.video import pictures
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.simulation.loop import simulate
from sim_action.simulation.recorder import RunRecorder

ROUNDS: Final = 7
PICTURES: Final = 30

SCENARIO: Final = """\
name: burger drives a circle
robot: {{model: turtlebot3_burger}}
world: {{objects: [{{name: wall, box: [0.1, 2.0, 0.5], pose: {{x: 2}}}}]}}
commands: {{rate: 10 Hz, twist: [{{linear: 0.5, angular: 0.5}}]}}
expect: [{{travel: {{at_least: 50 cm}}}}]
duration: 30 s
time_limit: 30 s
backend: {engine}
"""


class RecordingCost(NamedTuple):
    """Seconds: of the loop without recordings, of what it takes longer with them, and of what is written then."""

    loop: float
    keeping: float
    csv: float
    mcap: float
    picture: float


def recording_cost(engine: str) -> RecordingCost:
    """The least of several rounds in which they take turns."""
    loaded = _load(engine)
    plain, recorded = _loop(loaded, recorded=False), _loop(loaded, recorded=True)
    run = _recorded(loaded)
    calls = [plain, recorded, _writing("csv", run), _writing("mcap", run), _filming(run)]
    rounds = [[call() for call in calls] for _ in range(ROUNDS + 1)][1:]
    loop, keeping, csv, mcap, film = map(min, zip(*rounds, strict=True))
    return RecordingCost(loop, max(0.0, keeping - loop), csv, mcap, film / PICTURES)


def _loop(loaded: LoadedScenario, *, recorded: bool) -> Callable[[], float]:
    def call() -> float:
        footage = RunRecorder(loaded.scenario, recorded=recorded)
        return simulate(loaded.scenario, build_scene(loaded), lambda _: None, footage).wall_time

    return call


def _recorded(loaded: LoadedScenario) -> RecordedRun:
    footage, scene = RunRecorder(loaded.scenario, recorded=True), build_scene(loaded)
    simulate(loaded.scenario, scene, lambda _: None, footage)
    film, trace = footage.film(), footage.trace()
    assert film is not None
    assert trace is not None
    return RecordedRun.of(scene, film, trace, loaded.scenario, footage.twists())


def _writing(name: str, run: RecordedRun) -> Callable[[], float]:
    def call() -> float:
        started = time.perf_counter()
        EXPORTS.load(name).write(run, io.BytesIO())
        return time.perf_counter() - started

    return call


def _filming(run: RecordedRun) -> Callable[[], float]:
    def call() -> float:
        shown = pictures(run, 20)
        started = time.perf_counter()
        for _ in range(PICTURES):
            next(shown)
        return time.perf_counter() - started

    return call


def _load(engine: str) -> LoadedScenario:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "circle.sim.yml")
        path.write_text(SCENARIO.format(engine=engine))
        return load_scenario(path)

"""Both engines side by side: a step, a whole run, their size, and how long they take to install."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import distribution
from pathlib import Path
from typing import Final

from sim_action.engines import ENGINES
from sim_action.scenario.loading import build_scene
from sim_action.scenario.model import LoadedScenario
from sim_action.simulation.loop import simulate
from tools.bench.robots import ROBOTS, KnownRobot

PACKAGES: Final = {name: engine.distribution for name, engine in ENGINES.items()}
"""Engine -> the package that it comes in."""

_SECONDS: Final = 5
_ROUNDS: Final = 5


@dataclass(frozen=True, slots=True)
class SideBySide:
    """One measure, by engine."""

    name: str
    figures: dict[str, float]
    unit: str

    def __str__(self) -> str:
        pybullet, mujoco = (self.figures[engine] for engine in PACKAGES)
        figures = f"PyBullet {pybullet:.3g} {self.unit}, MuJoCo {mujoco:.3g} {self.unit}"
        return f"     {self.name}: {figures} ({pybullet / mujoco:.2g} : 1)"


def engines(whole_runs: Mapping[str, Callable[[], object]]) -> Iterator[SideBySide]:
    """All measures; `whole_runs`: what runs the same scenario on each engine, from the command line."""
    for known in ROBOTS:
        yield SideBySide(f"{known.name} at rest, a step", _least(_steps(known)), "us")
    runs = {engine: _timed(run) for engine, run in whole_runs.items()}
    yield SideBySide("burger, 30 s, whole process", _least(runs), "s")
    yield SideBySide("on disk", {engine: _megabytes(package) for engine, package in PACKAGES.items()}, "MB")
    installs = {engine: _timed(_install(package))() for engine, package in PACKAGES.items()}
    yield SideBySide("pip install", installs, "s")


def _least(measures: Mapping[str, Callable[[], float]]) -> dict[str, float]:
    """Return the least times of several rounds in which the measures take turns."""
    rounds = [[measure() for measure in measures.values()] for _ in range(_ROUNDS)]
    return dict(zip(measures, map(min, zip(*rounds, strict=True)), strict=True))


def _timed(call: Callable[[], object]) -> Callable[[], float]:
    def seconds() -> float:
        started = time.perf_counter()
        call()
        return time.perf_counter() - started

    return seconds


def _steps(known: KnownRobot) -> dict[str, Callable[[], float]]:
    with tempfile.TemporaryDirectory() as folder:
        loaded = known.resting(Path(folder), _SECONDS)
    return {engine: _microseconds(loaded, engine) for engine in PACKAGES}


def _microseconds(loaded: LoadedScenario, engine: str) -> Callable[[], float]:
    scenario = loaded.scenario.model_copy(update={"backend": engine})

    def measure() -> float:
        run = simulate(scenario, build_scene(loaded), lambda _: None)
        return run.wall_time / (run.sim_time * scenario.physics.rate) * 1e6

    return measure


def _megabytes(package: str) -> float:
    files = distribution(package).files or []
    return sum(path.stat().st_size for file in files if (path := Path(str(file.locate()))).is_file()) / 1e6


def _install(package: str) -> Callable[[], object]:
    """Into an empty folder, from the cache of pip if it has one."""
    version = distribution(package).version

    def call() -> None:
        with tempfile.TemporaryDirectory() as folder:
            pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--disable-pip-version-check"]
            subprocess.run([*pip, "--target", folder, f"{package}=={version}"], check=True, capture_output=True)

    return call

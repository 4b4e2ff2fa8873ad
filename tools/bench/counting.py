"""Measure the cost of counting the moments at which expectations are judged, within one run.

Two runs, with and without it, differ by more than this cost on any machine that does something else too.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, NamedTuple
from unittest.mock import patch

from sim_action.assertions.temporal_logic import monitor
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.simulation.loop import simulate
from sim_action.state.verdict import Judged
from tools.bench.engines import PACKAGES

_ROUNDS: Final = 10
"""Noise only ever adds: the least share counts."""

# An assertion of each kind that counts: steps, readings, steps with a distance, parts, and a formula.
_SCENARIO: Final = """\
name: burger drives round among things
robot: {model: turtlebot3_burger}
world:
  objects:
    - {name: wall, box: [0.1, 3.0, 0.5], pose: {x: 2}}
    - {name: left, cylinder: {radius: 10 cm, height: 1.0}, pose: {x: 0.0, y: 1.3}}
sensors: [{imu: {}, rate: 240 Hz}, {odometry: {}, rate: 60 Hz}]
commands: {rate: 10 Hz, twist: [{linear: 0.2, angular: 0.5}]}
expect:
  - no_collision
  - upright: {max_tilt: 20 deg}
  - clearance: {at_least: 10 cm}
  - sensor: {name: imu, reading: angular_velocity_xyz, which: norm, at_most: 9}
  - odometry_error: {position: 9 m}
  - all_of: [{max_speed: {linear: 9}}, {stay_within: {x: [-9 m, 9 m]}}]
  - stl: always[0 s, 3 s] (speed < 9)
time_limit: 4 s
"""


_COUNTING: Final[tuple[tuple[Any, str], ...]] = ((monitor, "with_judged"), (Judged, "followed_by"))
"""All functions that count. One calls another: what they take together is counted twice, and an upper bound."""


class CountingCost(NamedTuple):
    """Seconds of processor time of a run on one engine: all of it, and the part without counting."""

    engine: str
    whole: float
    bare: float


def counting_costs() -> Iterator[CountingCost]:
    """Measure each engine; the run with the least share of counting speaks."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name, "round.sim.yml")
        path.write_text(_SCENARIO)
        loaded = load_scenario(path)
    for engine in PACKAGES:
        whole, counting = min((_seconds(loaded, engine) for _ in range(_ROUNDS)), key=lambda took: took[1] / took[0])
        yield CountingCost(engine, whole, whole - counting)


def _seconds(loaded: LoadedScenario, engine: str) -> tuple[float, float]:
    """Return the times of a run, without loading, and of all calls in it that count."""
    spent = [0.0]

    def timed(count: Callable[..., Judged]) -> Callable[..., Judged]:
        def call(*arguments: Any) -> Judged:
            began = time.process_time()
            judged = count(*arguments)
            spent[0] += time.process_time() - began
            return judged

        return call

    scenario, scene = loaded.scenario.model_copy(update={"backend": engine}), build_scene(loaded)
    with ExitStack() as stack:
        for owner, name in _COUNTING:
            stack.enter_context(patch.object(owner, name, timed(getattr(owner, name))))
        began = time.process_time()
        run = simulate(scenario, scene, lambda _: None)
        took = time.process_time() - began
    assert all(verdict.judged is not None and verdict.judged.moments for verdict in run.verdicts)
    return took, spent[0]

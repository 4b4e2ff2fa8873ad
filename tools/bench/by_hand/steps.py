"""Measure the CPU time of a step: sim-action's loop against a hand-written one that keeps the full state.

The difference between a run of 30 s and one of 5 s leaves out loading, settling and judging.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

SHORT_S: Final = 5
LONG_S: Final = 30

_SCENARIO: Final = """\
name: burger drives on
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, twist: [{{linear: 1.0}}]}}
expect: [{{travel: {{at_least: 1.5 m}}}}]
duration: {seconds} s
time_limit: {seconds} s
backend: {engine}
"""


class StepCosts(NamedTuple):
    """Seconds of CPU time for each step."""

    ours: float
    by_hand: float


def step_costs(engine: str, rounds: int) -> StepCosts:
    """Return the medians of rounds in which the loops take turns, each in processes of its own.

    In one process with sim-action, the loop by hand would have its settings, such as MuJoCo without a profiler.
    """
    measured = [[_in_process(engine, name) for name in _LOOPS] for _ in range(rounds)]
    return StepCosts(*map(statistics.median, zip(*measured, strict=True)))


def _in_process(engine: str, name: str) -> float:
    words = [sys.executable, "-m", "tools.bench.by_hand.steps", engine, name]
    return float(subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()[-1])


def _each_step(loop: Callable[[int], object]) -> float:
    short, long = _cpu(loop, SHORT_S), _cpu(loop, LONG_S)
    return (long - short) / ((LONG_S - SHORT_S) * 240)


def _cpu(loop: Callable[[int], object], seconds: int) -> float:
    started = time.process_time()
    loop(seconds)
    return time.process_time() - started


def _ours(engine: str) -> Callable[[int], object]:
    from sim_action.scenario.loading import build_scene, load_scenario  # the loop by hand does without it
    from sim_action.simulation.loop import simulate  # the loop by hand does without it

    with tempfile.TemporaryDirectory() as folder:
        loaded = {}
        for seconds in (SHORT_S, LONG_S):
            path = Path(folder, f"{seconds}.sim.yml")
            path.write_text(_SCENARIO.format(engine=engine, seconds=seconds))
            loaded[seconds] = load_scenario(path)
    return lambda seconds: simulate(loaded[seconds].scenario, build_scene(loaded[seconds]), lambda _: None)


def _by_hand(engine: str) -> Callable[[int], object]:
    if engine == "pybullet":
        from tools.bench.by_hand.with_pybullet import record as pybullet_loop

        return pybullet_loop.record
    from tools.bench.by_hand.with_mujoco import record as mujoco_loop

    return mujoco_loop.record


_LOOPS: Final = {"ours": _ours, "by hand": _by_hand}

if __name__ == "__main__":
    run = _LOOPS[sys.argv[2]](sys.argv[1])
    run(SHORT_S)  # what a first run imports and compiles does not count
    print(_each_step(run))

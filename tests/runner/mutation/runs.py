"""Runs that passed, with traces made by hand."""

from __future__ import annotations

import math
from pathlib import Path

from sim_action.results.outcome import Outcome
from sim_action.runner.mutation.mutant import Original
from sim_action.state.trace import Trace
from tests.scenarios import load
from tests.traces import trace

TEXT = """\
name: burger drives
robot: {{model: turtlebot3_burger}}
world:
  ground: {{friction: 0.8}}
  objects:
    - {{name: crate, box: [0.4, 0.4, 0.4], pose: {{x: 1.0, y: 1.0}}}}
    - {{name: far crate, box: [0.4, 0.4, 0.4], pose: {{x: 1.0, y: -9.0}}}}
    {objects}
sensors: [{sensors}]
{commands}
expect: [{expect}]
time_limit: 10 s
"""


def straight(metres: float = 2.0, seconds: int = 20) -> Trace:
    """A way along x, at 10 moments a second; the left wheel turns."""
    time = [step / 10 for step in range(10 * seconds + 1)]
    x = [metres * now / seconds for now in time]
    return trace(time, x=x, position=[each / 0.033 for each in x])


def curve(radius: float = 1.0) -> Trace:
    """A quarter of a circle to the left."""
    angles = [math.pi / 2 * step / 100 for step in range(101)]
    return trace(
        [step / 10 for step in range(101)],
        x=[radius * math.sin(angle) for angle in angles],
        y=[radius * (1 - math.cos(angle)) for angle in angles],
        yaw=angles,
    )


def original(
    folder: Path,
    way: Trace | None = None,
    *,
    objects: str = "",
    sensors: str = "",
    commands: str = "commands: {twist: [{linear: 0.2}]}",
    expect: str = "{travel: {at_least: 1.0}}",
    wall_time: float = 1.0,
) -> Original:
    """A run of a burger in a world with two crates."""
    loaded = load(folder, TEXT.format(objects=objects, sensors=sensors, commands=commands, expect=expect))
    name = loaded.scenario.name
    outcome = Outcome(name=name, file=loaded.file, status="passed", wall_time=wall_time, digest="ours")
    return Original(loaded, outcome, straight() if way is None else way)

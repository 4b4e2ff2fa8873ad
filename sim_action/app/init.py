"""The use case `init`: write a commented scenario that passes and a workflow that runs it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from sim_action import __version__
from sim_action.core.errors import UsageError

_SCENARIO: Final = """\
# yaml-language-server: $schema=scenario.schema.json
# A simulation test of a robot. Run it in the folder above this one: sim-action run simulation
name: robot drives straight

robot:
  model: turtlebot3_burger      # a built-in model (sim-action models), or the path of your .urdf, relative to this file

world:                          # flat ground, and a wall that the robot must not touch
  objects:
    - {name: wall, box: [0.1, 2.0, 0.5], pose: {x: 3.0}}

commands:                       # what drives the robot (sim-action commands lists more)
  rate: 10 Hz
  twist:
    - {linear: 0.5, for: 4 s}
    - {linear: 0.2, angular: 30 deg/s}   # a curve; not reached here, as the run ends at 1.5 m

expect:                         # expectations (sim-action assertions lists what they can be)
  - travel: {at_least: 1.5 m}   # a goal: it must come true once; the run ends when all goals are met
    before: 10 s                # deadline of this goal
  - no_collision                # an invariant: it must always hold; the run ends when it is broken
  - upright: {max_tilt: 10 deg}

time_limit: 20 s                # sim time at which the scenario fails if a goal is not met
"""

# The tag that moves to the newest release of this major version.
_MOVING_TAG: Final = f"v{__version__.partition('.')[0]}"

_WORKFLOW: Final = f"""\
name: simulation
on: [push, pull_request]
permissions:
  contents: read
jobs:
  simulation:
    runs-on: ubuntu-latest
    steps:
      - uses: actions/checkout@3d3c42e5aac5ba805825da76410c181273ba90b1 # v7.0.1
      - uses: sim-action/sim-action@{_MOVING_TAG}
        with:
          scenario: simulation
"""


def files(schema: str) -> dict[str, str]:
    """Path below the folder -> text of each file that `init` writes."""
    return {
        "simulation/drive_straight.sim.yml": _SCENARIO,
        "simulation/scenario.schema.json": schema,
        ".github/workflows/simulation.yml": _WORKFLOW,
    }


def write_scaffold(folder: Path, schema: str, *, force: bool) -> list[Path]:
    """Writes the files; returns their paths. Raises UsageError, and writes nothing, if one is there already."""
    targets = {folder / name: text for name, text in files(schema).items()}
    existing = [str(path) for path in targets if os.path.exists(path)]  # noqa: PTH110 - a name may be too long
    if existing and not force:
        raise UsageError(f"file exists already: {', '.join(existing)}; use --force to overwrite it")
    for path, text in targets.items():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise UsageError(f"cannot write {path}: {error.strerror}") from None
    return list(targets)

"""In an interpreter of its own: what importing the engine takes, then reading a model, then the same once more, in s.

The model is that of a robot of 27 links and 26 joints, whose meshes have been rewritten before (they are kept by
content). A scenario pays for its model in two places: where it is checked, and where it runs.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path


def main() -> None:
    """Prints the three times."""
    engine = _seconds(lambda: import_module("pybullet"))
    from sim_action.robot.reading.loading import ModelLibrary
    from sim_action.scenario.loading import build_scene
    from tools.bench.robots import MINITAUR, WORKSPACE

    library, robot = ModelLibrary(), MINITAUR.robot
    first = _seconds(lambda: library.load(robot, WORKSPACE))
    with tempfile.TemporaryDirectory() as folder:
        loaded = MINITAUR.resting(Path(folder), seconds=1)
    second = _seconds(lambda: (library.load(robot, WORKSPACE), build_scene(loaded)))
    print(engine, first, second)


def _seconds(call: Callable[[], object]) -> float:
    started = time.perf_counter()
    call()
    return time.perf_counter() - started


if __name__ == "__main__":
    main()

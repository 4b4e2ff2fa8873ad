"""Count what calls do: modules of ours that they import, and calls of functions. Both are the same every time.

Times on a shared machine cannot guard speed. `budgets.toml` holds the figures that are allowed; a commit that needs
more raises them, and gives the reason in its message.

    python -m tools.bench.budgets            # today's figures, as a table of TOML
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from sim_action.engines import ENGINES
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.simulation.loop import simulate
from tools.bench.calls import counted_calls

_ROOT: Final = Path(__file__).parents[2]
BUDGETS: Final = Path(__file__).with_suffix(".toml")

_SCENARIO: Final = """\
name: a burger drives
robot: {model: turtlebot3_burger}
commands: {rate: 10 Hz, twist: [{linear: 0.2}]}
expect: [{upright: {max_tilt: 20 deg}}, no_collision]
"""
_FILES: Final[Mapping[str, str]] = {
    "short": f"{_SCENARIO}time_limit: 2 s\n",
    "long": f"{_SCENARIO}time_limit: 4 s\n",
    "few": f"{_SCENARIO}time_limit: 1 s\nvariations: {{world.ground.friction: [0.7, 0.8]}}\n",
    "many": f"{_SCENARIO}time_limit: 1 s\nvariations: {{world.ground.friction: {[n / 20 for n in range(5, 15)]}}}\n",
}
_MORE_STEPS: Final = 2 * 240
_MORE_VARIATIONS: Final = 8
"""So many that the few hundred calls by which two equal runs differ are far below one per cent of a variation."""

# A busy machine makes a run longer, which is then heard of and looked at more often: here, only once it has ended.
_HEARD_ONCE: Final = (
    "from sim_action.runner import child_main, process_pool\n"
    "child_main._PROGRESS_PERIOD_S *= 1000\nprocess_pool._MAX_WAIT_S *= 1000\n"
)


def figures() -> Iterator[tuple[str, int]]:
    """Yield the name of each figure and the figure. The steps of a run are done by its child, and counted apart."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / ".git").mkdir()
        for stem, text in _FILES.items():
            (folder / f"{stem}.sim.yml").write_text(text, encoding="utf-8")
        for engine in ENGINES:  # What a first call compiles and stores does not count.
            _of_command(folder, "run", "short.sim.yml", "--backend", engine, "-j1")
        modules, calls = _of_command(folder, "validate", "short.sim.yml")
        yield "validate: modules", modules
        yield "validate: calls", calls
        few, many = (
            _of_command(folder, "run", f"{stem}.sim.yml", "-j1", first=_HEARD_ONCE)[1] for stem in ("few", "many")
        )
        yield "a further variation: calls", (many - few) // _MORE_VARIATIONS
        for engine in ENGINES:
            modules, calls = _of_command(folder, "run", "short.sim.yml", "--backend", engine, "-j1")
            yield f"run on {engine}: modules", modules
            yield f"run on {engine}: calls", calls
            _of_simulation(folder / "short.sim.yml", engine)  # What a first simulation imports does not count.
            short, long = (_of_simulation(folder / f"{stem}.sim.yml", engine) for stem in ("short", "long"))
            yield f"100 further steps on {engine}: calls", 100 * (long - short) // _MORE_STEPS


def _of_command(folder: Path, *arguments: str, first: str = "") -> tuple[int, int]:
    """Return the modules of ours that a command line imports, and its calls; `first`: code that does not count."""
    environment = {"PATH": os.environ["PATH"], "HOME": str(folder), "PYTHONHASHSEED": "0", "PYTHONPATH": str(_ROOT)}
    words = [sys.executable, "-c", f"{first}from tools.bench.calls import command; command()", *arguments]
    ran = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=True)
    modules, calls = ran.stdout.splitlines()[-1].split()
    return int(modules), int(calls)


def _of_simulation(path: Path, engine: str) -> int:
    loaded = load_scenario(path)
    scenario, scene = loaded.scenario.model_copy(update={"backend": engine}), build_scene(loaded)
    with counted_calls() as calls:
        simulate(scenario, scene, lambda _: None)
    return next(calls)


if __name__ == "__main__":
    for name, figure in figures():
        print(f'"{name}" = {figure}')

"""Measure scenarios that a program with threads runs, against the same ones on the command line, and the import."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from tools.bench.by_hand.processes import Command, Costs, Orientation, compared, take_turns
from tools.bench.table import Ratio

CALLS: Final = 20
SUITE: Final = 32
IMPORT_LIMIT_S: Final = 0.03
_ROUNDS: Final = 3
_IMPORTS: Final = 25

_SCENARIO: Final = """\
name: burger drives on {number}
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, twist: [{{linear: 0.2}}]}}
expect: [{{travel: {{at_least: 1 m}}}}, upright]
time_limit: 10 s
"""

# Each call is of the paths in one argument; the thread lives as long as the calls.
_PROGRAM: Final = """\
import sys, threading
from sim_action import run

done = threading.Event()
threading.Thread(target=done.wait).start()
try:
    for number, paths in enumerate(sys.argv[1:]):
        results = run(paths.split(), output_dir=f"results/{number}")
        assert results.passed and results[0].digest
finally:
    done.set()
"""


def embedding_costs(folder: Path) -> Iterator[Ratio | Orientation]:
    """Yield the costs of calls with one scenario each, of one call with many, and of the import."""
    folder.mkdir()
    files = [f"{number}.sim.yml" for number in range(SUITE)]
    for number, file in enumerate(files):
        (folder / file).write_text(_SCENARIO.format(number=number))
    yield from _against_command_line(folder, f"{CALLS} calls of run()", [[file] for file in files[:CALLS]])
    yield from _against_command_line(folder, f"one call of run() with {SUITE} scenarios", [files])
    yield from _imports(folder)


def _against_command_line(folder: Path, name: str, calls: list[list[str]]) -> Iterator[Ratio | Orientation]:
    """Compare one process that calls `run` with a process of the command line for each call."""
    program = Command([sys.executable, "-c", _PROGRAM, *map(" ".join, calls)], folder)
    several = " && ".join(f'"$0" -m sim_action run --output-dir results {" ".join(files)}' for files in calls)
    command_line = Command(["sh", "-c", several, sys.executable], folder)
    ours, theirs = take_turns(_ROUNDS, program, command_line)
    yield from compared(f"{name} beside a thread, against the command line", ours, theirs, 1.2)


def _imports(folder: Path) -> Iterator[Ratio | Orientation]:
    """Measure `import sim_action`, which imports no other module before a name is asked for."""
    programs = ("pass", "import sim_action", "from sim_action import run")
    bare, package, name = take_turns(_IMPORTS, *(Command([sys.executable, "-c", text], folder) for text in programs))
    yield Ratio("import sim_action, against 30 ms", _above(package, bare), IMPORT_LIMIT_S, 1)
    print(f"     from sim_action import run, for orientation: {_above(name, bare) * 1000:.3g} ms")


def _above(costs: Costs, bare: Costs) -> float:
    return max(costs.least_cpu - bare.least_cpu, 0.0)

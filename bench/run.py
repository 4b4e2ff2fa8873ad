"""What sim-action costs, as ratios measured side by side in one run: `make bench`.

Machines are noisy, so both sides of a ratio alternate, and the median of the pairs counts. Times are printed for
orientation only.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RAW = ROOT / "bench/raw_loop.py"
SUITE = 16
FEW, MANY = 2, 8

SCENARIO = """\
name: burger drives on {number}
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, twist: [{{linear: 1.0}}]}}
expect: [{{travel: {{at_least: 1.5 m}}}}]
duration: 30 s
time_limit: 30 s
"""


@dataclass(frozen=True, slots=True)
class Ratio:
    """One measured ratio against what it may be; `at_most` tells which way is good."""

    name: str
    pairs: tuple[tuple[float, float], ...]
    target: float
    at_most: bool = True

    @property
    def value(self) -> float:
        """The median over the pairs."""
        return statistics.median(ours / theirs for ours, theirs in self.pairs)

    @property
    def met(self) -> bool:
        """Whether the target is met."""
        return self.value <= self.target if self.at_most else self.value >= self.target

    def __str__(self) -> str:
        ours, theirs = (statistics.median(side) * 1000 for side in zip(*self.pairs, strict=True))
        bound = "at most" if self.at_most else "at least"
        spread = ", ".join(f"{ours / theirs:.2f}" for ours, theirs in sorted(self.pairs, key=lambda p: p[0] / p[1]))
        return (
            f"{'ok  ' if self.met else 'MISS'} {self.name}: {self.value:.2f} ({bound} {self.target:g}; "
            f"{ours:.0f} ms / {theirs:.0f} ms; pairs {spread})"
        )


def command(*arguments: str, cwd: Path | None = None) -> Callable[[], object]:
    """A call of a program that lies beside this interpreter, to be timed."""
    program = Path(sys.executable).parent / arguments[0]
    environment = {**os.environ, "GITHUB_ACTIONS": ""}

    def call() -> object:
        return subprocess.run([program, *arguments[1:]], cwd=cwd, env=environment, check=True, capture_output=True)

    return call


def seconds(call: Callable[[], object]) -> float:
    """Wall time of one call."""
    started = time.perf_counter()
    call()
    return time.perf_counter() - started


def alternating(ours: Callable[[], float], theirs: Callable[[], float], times: int) -> tuple[tuple[float, float], ...]:
    """Both sides, one after the other, after a first pair that warms caches."""
    ours(), theirs()
    return tuple((ours(), theirs()) for _ in range(times))


def write_suite(folder: Path, count: int) -> Path:
    """A folder with `count` scenarios."""
    folder.mkdir()
    for number in range(count):
        (folder / f"{number}.sim.yml").write_text(SCENARIO.format(number=number))
    return folder


def whole_process(folder: Path) -> Ratio:
    """`sim-action run` of one scenario against a script that does the same by hand."""
    one = write_suite(folder / "one", 1)
    ours, theirs = command("sim-action", "run", str(one), cwd=folder), command("python", str(RAW))
    return Ratio(
        "whole process, against a raw script", alternating(lambda: seconds(ours), lambda: seconds(theirs), 7), 1.6
    )


def further_scenario(folder: Path) -> Ratio:
    """What each further scenario adds, with one job, against what each further raw loop adds."""
    few, many = write_suite(folder / "few", FEW), write_suite(folder / "many", MANY)

    def ours() -> float:
        runs = [command("sim-action", "run", "--jobs", "1", str(suite), cwd=folder) for suite in (many, few)]
        return (seconds(runs[0]) - seconds(runs[1])) / (MANY - FEW)

    def theirs() -> float:
        return (seconds(command("python", str(RAW), str(MANY))) - seconds(command("python", str(RAW), str(FEW)))) / (
            MANY - FEW
        )

    return Ratio("each further scenario, against the raw loop", alternating(ours, theirs, 5), 1.2)


def parallel(folder: Path) -> Ratio:
    """A suite with one job against the same with two."""
    suite = str(write_suite(folder / "suite", SUITE))
    one, two = (command("sim-action", "run", "--jobs", jobs, suite, cwd=folder) for jobs in "12")
    pairs = alternating(lambda: seconds(one), lambda: seconds(two), 3)
    return Ratio(f"{SUITE} scenarios, one job against two", pairs, 1.6, at_most=False)


def start_up(folder: Path) -> list[Ratio]:
    """Commands that need no engine against an interpreter that does nothing."""
    bare = command("python", "-c", "pass")
    scenario = str(write_suite(folder / "start-up", 1))
    calls = (("--help", ["--help"], 6.0), ("validate of one file", ["validate", scenario], 20.0))
    ratios = []
    for name, arguments, target in calls:
        ours = partial(seconds, command("sim-action", *arguments))
        pairs = alternating(ours, partial(seconds, bare), 15)
        ratios.append(Ratio(f"{name}, against python -c pass", pairs, target))
    return ratios


def main() -> None:
    """Prints a line a ratio; exits with 1 if one is missed."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ratios = []
        for ratio in (*start_up(folder), *(measure(folder) for measure in (whole_process, further_scenario, parallel))):
            print(ratio, flush=True)
            ratios.append(ratio)
    sys.exit(not all(ratio.met for ratio in ratios))


if __name__ == "__main__":
    main()

"""Measure what processes cost: CPU of the whole tree and wall time, of commands that take turns."""

from __future__ import annotations

import os
import statistics
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

from tools.bench.table import Ratio


@dataclass(frozen=True, slots=True)
class Command:
    """A process to measure.

    Attributes:
        junit: the JUnit XML that it writes, relative to `cwd`; None: no JUnit XML.
        tests: number of tests that must be in it.
    """

    arguments: Sequence[str]
    cwd: Path
    junit: str | None = None
    tests: int = 1
    environment: Mapping[str, str] = field(default_factory=dict)


class Cost(NamedTuple):
    """Seconds of a process with all of its children."""

    cpu: float
    wall: float


@dataclass(frozen=True, slots=True)
class Costs:
    """The costs of a command in several rounds."""

    rounds: Sequence[Cost]

    @property
    def cpu(self) -> float:
        """The median CPU time in s."""
        return statistics.median(cost.cpu for cost in self.rounds)

    @property
    def least_cpu(self) -> float:
        """The least CPU time in s."""
        return min(cost.cpu for cost in self.rounds)

    @property
    def wall(self) -> float:
        """The median wall time in s."""
        return statistics.median(cost.wall for cost in self.rounds)


def take_turns(rounds: int, *commands: Command, warm_up: bool = True) -> list[Costs]:
    """Run the commands alternately, in turned order in every second round. A warm-up round does not count."""
    if warm_up:
        for command in commands:
            measure(command)
    taken: list[list[Cost]] = [[] for _ in commands]
    for number in range(rounds):
        order = range(len(commands)) if number % 2 == 0 else reversed(range(len(commands)))
        for index in order:
            taken[index].append(measure(commands[index]))
    return [Costs(costs) for costs in taken]


def measure(command: Command) -> Cost:
    """Run a command to its end. Raises CalledProcessError, and ValueError if it did not run the tests."""
    if command.junit is not None:
        (command.cwd / command.junit).unlink(missing_ok=True)
    environment = {**os.environ, "GITHUB_ACTIONS": "", **command.environment}
    # A shell that forbids bytecode would have the processes compile whole packages.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    with (command.cwd / "output.txt").open("w+") as output:
        started = time.perf_counter()
        process = subprocess.Popen(
            command.arguments, cwd=command.cwd, env=environment, stdout=output, stderr=subprocess.STDOUT
        )
        # The usage of this child, and of all children that it waited for.
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - started
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            output.seek(0)
            raise subprocess.CalledProcessError(process.returncode, list(command.arguments), output.read())
    if command.junit is not None and (found := _passed(command.cwd / command.junit)) != command.tests:
        raise ValueError(f"{command.arguments[0]} passed {found} tests, not {command.tests}")
    return Cost(usage.ru_utime + usage.ru_stime, wall)


@dataclass(frozen=True, slots=True)
class Orientation:
    """A line below a ratio: medians of wall times in s, and the ratio of the least CPU times."""

    name: str
    ours_wall: float
    theirs_wall: float
    least_cpu: float

    def __str__(self) -> str:
        ratio = self.ours_wall / self.theirs_wall
        walls = f"wall time {ratio:.2f} ({self.ours_wall:.3g} s / {self.theirs_wall:.3g} s)"
        return f"     {self.name}: {walls}; least CPU {self.least_cpu:.2f}"


def compared(name: str, ours: Costs, theirs: Costs, target: float) -> list[Ratio | Orientation]:
    """Return the line with the bound, which is about CPU, and a line for orientation."""
    least = ours.least_cpu / theirs.least_cpu
    return [Ratio(name, ours.cpu, theirs.cpu, target), Orientation(name, ours.wall, theirs.wall, least)]


def _passed(junit: Path) -> int:
    cases = list(ET.parse(junit).getroot().iter("testcase"))  # noqa: S314 - a process of this module wrote it
    return sum(not len(case.findall("failure") + case.findall("error") + case.findall("skipped")) for case in cases)

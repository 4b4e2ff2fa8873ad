"""The lines of `make bench`: one for each ratio, and one for each measurement that was not possible."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

MAX_REASON_LENGTH: Final = 200
"""Characters of an error that one line of the table holds."""


class NotMeasuredError(Exception):
    """A measurement is not possible on this machine because a program or a package is missing."""


@dataclass(frozen=True, slots=True)
class Ratio:
    """Two measured times in s and the bound of their ratio; `at_most` gives the direction of the bound.

    Or two sizes in MB. They are printed in kB.
    """

    name: str
    ours: float
    theirs: float
    target: float
    at_most: bool = True
    unit: str = "ms"

    @property
    def value(self) -> float:
        """Ours over theirs."""
        return self.ours / self.theirs

    @property
    def met(self) -> bool:
        """True if the ratio keeps its bound."""
        return self.value <= self.target if self.at_most else self.value >= self.target

    def __str__(self) -> str:
        bound = "at most" if self.at_most else "at least"
        times = f"{self.ours * 1000:.3g} {self.unit} / {self.theirs * 1000:.3g} {self.unit}"
        return f"{'ok  ' if self.met else 'MISS'} {self.name}: {self.value:.2f} ({bound} {self.target:g}; {times})"


@dataclass(frozen=True, slots=True)
class Goal:
    """A measured time in s and its bound; `details` names other ways to do the same, for orientation."""

    name: str
    seconds: float
    limit_s: float
    details: str

    @property
    def met(self) -> bool:
        """True if the time keeps its bound."""
        return self.seconds <= self.limit_s

    def __str__(self) -> str:
        verdict = "ok  " if self.met else "MISS"
        return f"{verdict} {self.name}: {self.seconds:.1f} s (at most {self.limit_s:g} s; {self.details})"


@dataclass(frozen=True, slots=True)
class Measurement:
    """A group of lines of the table; `name` is printed where the group ends early."""

    name: str
    lines: Callable[[], Iterable[object]]


def print_table(measurements: Iterable[Measurement]) -> bool:
    """Print every line as soon as it is measured. Return True if all bounds are kept and nothing failed.

    A measurement that ends early costs its own lines alone: the table says which one and why, and goes on. A missing
    program or package does not count as a failure, any other error does.
    """
    kept = [_print_lines(measurement) for measurement in measurements]
    return all(kept)


def _print_lines(measurement: Measurement) -> bool:
    kept = True
    try:
        for line in measurement.lines():
            print(line, flush=True)
            kept = kept and not (isinstance(line, Ratio | Goal) and not line.met)
    except (NotMeasuredError, ImportError) as missing:
        print(f"     {measurement.name}: not measured: {_first_line(missing)}", flush=True)
    except Exception as error:  # noqa: BLE001 - the other measurements take minutes, and must not be lost
        print(f"FAIL {measurement.name}: not measured: {_reason(error)}", flush=True)
        return False
    return kept


def _reason(error: Exception) -> str:
    if isinstance(error, subprocess.CalledProcessError):
        said = error.stderr or error.stdout or b""
        text = said if isinstance(said, str) else said.decode(errors="replace")
        last = next((line for line in reversed(text.splitlines()) if line.strip()), "it printed no error")
        return f"a process ended with exit code {error.returncode}: {last.strip()}"[:MAX_REASON_LENGTH]
    return f"{type(error).__name__}: {_first_line(error)}"[:MAX_REASON_LENGTH]


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]

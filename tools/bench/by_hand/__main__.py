"""Print the comparisons with hand-written tests: `python -m tools.bench.by_hand --only one --rounds 3`."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from tools.bench.by_hand import comparisons
from tools.bench.by_hand.comparisons import ENGINES, Settings
from tools.bench.by_hand.measured import save
from tools.bench.table import Measurement, print_table

ROWS = {
    "one": ("one test by hand", comparisons.one_test),
    "suite": ("a suite by hand", comparisons.suite),
    "variations": ("variations by hand", comparisons.variations),
    "gate": ("a gate by hand", comparisons.gate),
    "steps": ("steps by hand", comparisons.steps),
    "husky": ("scenario_execution", comparisons.husky),
}


def measurements(settings: Settings, names: Sequence[str] = tuple(ROWS)) -> list[Measurement]:
    """Return these comparisons, for the table of `make bench`."""
    return [Measurement(ROWS[name][0], partial(ROWS[name][1], settings)) for name in names]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each ratio; exit with 1 if a bound is missed or a measurement fails."""
    parser = argparse.ArgumentParser(prog="python -m tools.bench.by_hand", description=__doc__)
    parser.add_argument("--only", action="append", choices=list(ROWS), help="measure only these rows; repeatable")
    parser.add_argument("--engine", action="append", choices=ENGINES, help="measure only this engine; repeatable")
    parser.add_argument("--rounds", type=int, default=7, help="measured runs of each command [default: 7]")
    parser.add_argument("--variations", type=int, default=1000, help="number of variations [default: 1000]")
    parser.add_argument("--save", action="store_true", help="save the figures for the table of the documents")
    given = parser.parse_args(arguments)
    lines: list[object] = []
    with tempfile.TemporaryDirectory() as name:
        engines = tuple(given.engine or ENGINES)
        settings = Settings(Path(name), given.rounds, given.variations, engines)
        rows = measurements(settings, given.only or tuple(ROWS))
        kept = print_table([Measurement(row.name, partial(_kept_in, lines, row)) for row in rows])
    if given.save:
        save(lines, settings)
    sys.exit(not kept)


def _kept_in(lines: list[object], row: Measurement) -> Iterator[object]:
    for line in row.lines():
        lines.append(line)
        yield line


if __name__ == "__main__":
    main()

"""The table that compares sim-action with hand-written tests, from the figures that the benchmark saved."""

from __future__ import annotations

from collections.abc import Iterator

from tools.bench.by_hand.measured import Row, load
from tools.docs.generators.markdown import table

MS_MAX_S = 0.01
"""CPU times below it are steps, which are shown in microseconds."""


def costs() -> str:
    """Return the table of costs, and the machines and versions that they were measured with."""
    rows = load()
    if not rows:
        return "No figures have been saved yet.\n"
    head = ("job", "CPU, by hand = 1", "goal", "CPU, sim-action", "CPU, the other")
    return "\n".join([table(head, map(_cells, rows)), *_circumstances(rows)]) + "\n"


def _cells(row: Row) -> tuple[str, ...]:
    ratio = f"{row.ratio:.2f}"
    missed = row.ratio > row.goal
    return (row.name, f"**{ratio}**" if missed else ratio, f"<= {row.goal:g}", _time(row.ours), _time(row.theirs))


def _time(seconds: float) -> str:
    if seconds < MS_MAX_S:
        return f"{seconds * 1e6:.3g} µs"
    return f"{seconds * 1e3:.0f} ms" if seconds < 1 else f"{seconds:.1f} s"


def _circumstances(rows: list[Row]) -> Iterator[str]:
    """Yield an entry for each machine, day and set of versions."""
    kinds = dict.fromkeys((row.date, row.machine, row.versions, row.rounds) for row in rows)
    for kind in kinds:
        date, machine, versions, rounds = kind
        names = [row.name for row in rows if (row.date, row.machine, row.versions, row.rounds) == kind]
        which = "all rows" if len(kinds) == 1 else "; ".join(names)
        yield f"- {date}, {machine}; {versions}; medians of {rounds} runs: {which}."

"""Measure the zoo: `python -m tests.physics.measure [--engine NAME] [--group NAME] [--case TEXT] [--held-out]`.

The table has the cases that engines may be tuned on. `--held-out` shows the others instead, `--all` both. `--write`
writes the figures of all cases on all engines to `measured.json`, for the documents. A line begins with ok, FAIL, KNOW
(fails, and is in `known.KNOWN`) or GOOD (is in KNOWN, and to be removed from there). `--moved` lists the figures that
differ from `measured.json` by more than a hundredth of their tolerance, and fails if one has left its tolerance.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

from sim_action.engines import installed
from tests.physics.case import BETWEEN, FINE_RATE, RATE, Case
from tests.physics.known import KNOWN
from tests.physics.record import FILE, RECORDED, write
from tests.physics.zoo import ZOO


@dataclass(frozen=True)
class Figure:
    """The measured value of a case on one engine; `engine` is `BETWEEN` where both are compared."""

    case: Case
    engine: str
    measured: float

    @property
    def error(self) -> float:
        return self.case.error(self.measured)

    @property
    def passes(self) -> bool:
        return self.error <= self.case.tolerance

    @property
    def key(self) -> tuple[str, str]:
        return self.engine, self.case.name


def _measured(name: str, engines: tuple[str, ...]) -> dict[tuple[str, str], float | str]:
    """The values of one family, or why there is none: cases that share runs stay in one process."""
    found: dict[tuple[str, str], float | str] = {}
    for case in ZOO:
        for engine in case.engines:
            if (case.family or case.name) == name and engine in engines:
                try:
                    found[engine, case.name] = case.measured(engine)
                except Exception as error:  # noqa: BLE001 - one broken run must not hide the others
                    found[engine, case.name] = f"{type(error).__name__}: {error}"
    return found


def figures(cases: Iterable[Case], engines: tuple[str, ...], jobs: int) -> tuple[list[Figure], list[str]]:
    """The figures of cases, and the problems of those that have none."""
    wanted = list(cases)
    families = list(dict.fromkeys(case.family or case.name for case in wanted))
    values: dict[tuple[str, str], float | str] = {}
    with ProcessPoolExecutor(jobs) as pool:
        for found in pool.map(_measured, families, [engines] * len(families)):
            values |= found
    known, problems = [], []
    for case in wanted:
        for engine in case.engines:
            value = values.get((engine, case.name))
            if isinstance(value, float):
                known.append(Figure(case, engine, value))
            elif value is not None:
                problems.append(f"{case.name} on {engine}: {value}")
    return known, problems


def _line(row: Figure) -> str:
    good, bad = ("GOOD", "KNOW") if row.key in KNOWN else ("ok  ", "FAIL")
    case = row.case
    numbers = f"{case.truth:10.4g} {row.measured:10.4g} {row.error:10.3g} {case.tolerance:10.3g} {case.unit:8.8}"
    held_out = " (held out)" if case.held_out else ""
    return f"{good if row.passes else bad} {row.engine:8} {numbers} {case.name}{held_out}"


_MOVED_SHARE = 0.01
_ROUNDING = 1e-5  # the record has six digits


def moved(rows: Iterable[Figure], recorded: Mapping[str, Mapping[str, float]] = RECORDED) -> Iterator[str]:
    """Yield a line for each figure that differs from the record."""
    for row in rows:
        before = recorded[row.engine].get(row.case.name)
        limit = _MOVED_SHARE * row.case.tolerance + _ROUNDING * abs(row.measured)
        if before is None:
            yield f"{row.engine}: {row.case.name}: not recorded"
        elif not abs(row.measured - before) <= limit:
            yield f"{row.engine}: {row.case.name}: {before:.6g} is now {row.measured:.6g} {row.case.unit}"


def print_steps(cases: Iterable[Case], engines: tuple[str, ...]) -> None:
    """Print the quantity of cases at three rates, and the limit of their verdict."""
    for case in cases:
        for engine in case.engines:
            if engine in engines:
                values = [case.measured(engine, rate) for rate in (RATE, FINE_RATE / 2, FINE_RATE)]
                numbers = " ".join(f"{value:10.4g}" for value in values)
                print(f"{engine:8} {numbers} limit {case.verdict_limit:10.4g} {case.name}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", choices=["pybullet", "mujoco", BETWEEN])
    parser.add_argument("--group")
    parser.add_argument("--case", default="", help="a part of the name")
    parser.add_argument("--held-out", action="store_true", help="the cases that engines may not be tuned on")
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--quick", action="store_true", help="only the cases of make test")
    parser.add_argument("--steps", action="store_true", help="measure at 240, 960 and 1920 Hz instead")
    parser.add_argument("--write", action="store_true", help=f"measure all cases and write {FILE.name}")
    parser.add_argument("--moved", action="store_true", help=f"compare with {FILE.name}")
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    engines = (asked.engine,) if asked.engine else (*installed(), BETWEEN)
    every = asked.all or asked.write
    cases = [
        case
        for case in ZOO
        if (every or case.held_out == asked.held_out)
        and (asked.write or (asked.group in (None, case.group) and asked.case in case.name))
        and (case.quick or not asked.quick)
    ]
    if asked.steps:
        print_steps(cases, engines)
        return
    known, problems = figures(cases, engines, asked.jobs)
    print(f"{'':4} {'engine':8} {'truth':>10} {'measured':>10} {'error':>10} {'tolerance':>10} {'unit':8} case")
    print(*map(_line, known), *problems, sep="\n")
    print(f"{sum(row.passes for row in known)} of {len(known) + len(problems)} within their tolerance")
    wrong = {row.key for row in known if not row.passes}
    seen = {row.key for row in known}
    for title, keys in (
        ("missing in KNOWN", wrong - set(KNOWN)),
        ("to remove from KNOWN", (seen - wrong) & set(KNOWN)),
    ):
        if keys:
            print(f"{title}:", *(f'    "{case}",  # {engine}' for engine, case in sorted(keys)), sep="\n")
    if asked.moved:
        moves = list(moved(known))
        print(f"{len(moves)} of {len(known)} figures moved", *moves, sep="\n")
        if problems or wrong - set(KNOWN):
            raise SystemExit(1)
    if asked.write:
        if problems or not {"pybullet", "mujoco", BETWEEN} <= set(engines):
            raise SystemExit("not written: every case must have a figure on both engines")
        write({name: {row.case.name: row.measured for row in known if row.engine == name} for name in engines})


if __name__ == "__main__":
    main()

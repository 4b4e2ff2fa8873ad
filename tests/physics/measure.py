"""Measure the zoo: `python -m tests.physics.measure [--engine NAME] [--group NAME] [--case TEXT] [--held-out]`.

The table has the cases that engines may be tuned on. `--held-out` shows the others instead, `--all` both. `--write`
writes the figures of all cases on all engines to `measured.json`, for the documents. A line begins with ok, FAIL, KNOW
(fails, and is in `known.KNOWN`) or GOOD (is in KNOWN, and to be removed from there).
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from sim_action.engines import installed
from tests.physics.case import BETWEEN, Case
from tests.physics.known import KNOWN
from tests.physics.zoo import ZOO

FILE: Final = Path(__file__).with_name("measured.json")


@dataclass(frozen=True)
class Figure:
    """The measured value of a case on one engine; `engine` is `BETWEEN` where both are compared."""

    case: str
    group: str
    engine: str
    kind: str
    unit: str
    truth: float
    measured: float
    error: float
    tolerance: float
    held_out: bool

    @property
    def passes(self) -> bool:
        return self.error <= self.tolerance


def figure(case: Case, engine: str) -> Figure:
    measured, truth = case.measured(engine), case.reference(engine)
    return Figure(
        case.name,
        case.group,
        engine,
        case.kind,
        case.unit,
        truth,
        measured,
        case.error(measured, truth),
        case.tolerance,
        case.held_out,
    )


def _figures_of(name: str, engines: tuple[str, ...]) -> list[Figure | str]:
    """The figures of one family: cases that share runs stay in one process."""
    found: list[Figure | str] = []
    for case in ZOO:
        if (case.family or case.name) == name:
            for engine in case.engines:
                if engine in engines:
                    try:
                        found.append(figure(case, engine))
                    except Exception as error:  # noqa: BLE001 - one broken run must not hide the others
                        found.append(f"{case.name} on {engine}: {type(error).__name__}: {error}")
    return found


def figures(cases: Iterable[Case], engines: tuple[str, ...], jobs: int) -> list[Figure | str]:
    wanted = {case.name for case in cases}
    families = list(dict.fromkeys(case.family or case.name for case in ZOO if case.name in wanted))
    with ProcessPoolExecutor(jobs) as pool:
        found = [row for rows in pool.map(_figures_of, families, [engines] * len(families)) for row in rows]
    return [row for row in found if isinstance(row, str) or row.case in wanted]


def _known(row: Figure) -> str:
    return "GOOD" if row.passes else "KNOW"


def _line(row: Figure) -> str:
    verdict = ("ok  " if row.passes else "FAIL") if (row.engine, row.case) not in KNOWN else _known(row)
    numbers = f"{row.truth:10.4g} {row.measured:10.4g} {row.error:10.3g} {row.tolerance:10.3g} {row.unit:8.8}"
    return f"{verdict} {row.engine:8} {numbers} {row.case}{' (held out)' if row.held_out else ''}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", choices=["pybullet", "mujoco", BETWEEN])
    parser.add_argument("--group")
    parser.add_argument("--case", default="", help="a part of the name")
    parser.add_argument("--held-out", action="store_true", help="the cases that engines may not be tuned on")
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--quick", action="store_true", help="only the cases of make test")
    parser.add_argument("--write", action="store_true", help=f"measure all cases and write {FILE.name}")
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
    found = figures(cases, engines, asked.jobs)
    known = [row for row in found if isinstance(row, Figure)]
    print(f"{'':4} {'engine':8} {'truth':>10} {'measured':>10} {'error':>10} {'tolerance':>10} {'unit':8} case")
    print("\n".join(row if isinstance(row, str) else _line(row) for row in found))
    print(f"{sum(row.passes for row in known)} of {len(found)} within their tolerance")
    wrong = {(row.engine, row.case) for row in known if not row.passes}
    seen = {(row.engine, row.case) for row in known}
    for title, keys in (
        ("missing in KNOWN", wrong - set(KNOWN)),
        ("to remove from KNOWN", (seen - wrong) & set(KNOWN)),
    ):
        if keys:
            print(f"{title}:", *(f'    "{case}",  # {engine}' for engine, case in sorted(keys)), sep="\n")
    if asked.write:
        if len(known) < len(found) or set(engines) < {"pybullet", "mujoco", BETWEEN}:
            raise SystemExit("not written: every case must have a figure on both engines")
        FILE.write_text(json.dumps([asdict(row) for row in known], indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

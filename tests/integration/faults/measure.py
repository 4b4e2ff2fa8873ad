"""Inject every fault at every place: `python -m tests.integration.faults.measure [--short] [--write] [TEXT]`.

TEXT selects faults by a part of their names. A line shows the fault, the number of the call, the calls reached, the
faults fired, the exit code, the scenarios whose verdict was kept, and the promises that were broken. `--short` injects
at the places of `make test` alone, `--every N` at every N-th place of the long form. `--write` writes the table into
docs/contributing/faults.md.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

from tests.integration.faults.harness import Injection, Injector
from tests.integration.faults.injection import Fault
from tests.integration.faults.sites import FAULTS

_PAGE: Final = Path(__file__).parents[3] / "docs/contributing/faults.md"
_TABLE: Final = re.compile(r"(<!-- measured: faults -->\n).*?(<!-- end -->)", re.DOTALL)


def _measured(injector: Injector, fault: Fault, *, short: bool) -> list[Injection]:
    found = []
    for one in (injector.inject(fault, nth) for nth in fault.short) if short else injector.inject_everywhere(fault):
        print(one, flush=True)
        found.append(one)
    return found


def table(found: list[Injection]) -> Iterator[str]:
    """Yield the lines of a table of all faults."""
    yield "| fault | places | calls reached | faults fired | usual verdicts | broken promises |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for name in dict.fromkeys(one.fault.name for one in found):
        rows = [one for one in found if one.fault.name == name]
        sums = (sum(one.reached for one in rows), sum(one.fired for one in rows))
        verdicts = f"{sum(one.kept for one in rows)} of {sum(one.of for one in rows)}"
        broken = sum(bool(one.broken or not one.fired) for one in rows)
        yield f"| {name} | {len(rows)} | {sums[0]:,} | {sums[1]:,} | {verdicts} | {broken} |"


def main() -> int:
    """Print a line for each injection, and the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("text", nargs="?", default="")
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=None)
    options = parser.parse_args()
    chosen = [fault for fault in FAULTS if options.text.lower() in str(fault).lower()]
    faults = [replace(fault, stride=fault.stride * options.every) for fault in chosen]
    folder = options.folder or Path(tempfile.mkdtemp(prefix="faults-"))
    folder.mkdir(exist_ok=True)
    injector = Injector(folder)
    with ThreadPoolExecutor(options.jobs) as pool:
        several = list(pool.map(partial(_measured, injector, short=options.short), faults))
    found = [one for each in several for one in each]
    shown = "\n".join(table(found))
    print(shown)
    if options.write:
        text = _PAGE.read_text(encoding="utf-8")
        _PAGE.write_text(_TABLE.sub(rf"\g<1>{shown}\n\g<2>", text), encoding="utf-8")
    return int(any(one.broken or not one.fired for one in found))


if __name__ == "__main__":
    sys.exit(main())

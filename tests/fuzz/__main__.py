"""Tries inputs made by chance, and keeps those that show a fault.

    python -m tests.fuzz --minutes 15 --seed 1 --kind golden --kind log --keep /tmp/found

The same seed gives the same inputs. A table says how many inputs of each kind were tried, and what became of them. Exit
code 1 if anything was found.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tests.fuzz.urdf_damage import model_bytes
from tests.fuzz.urdf_texts import MESH, MESH_TEXT

ROOT: Final = Path(__file__).parents[2]
BATCH: Final = 100
URDF: Final = "urdf"  # the kind of models on which sim-action and PyBullet must agree
KINDS: Final = (URDF, "scenario", "model", "mesh", "map", "heightfield", "golden", "path", "log", "process")
SHARE: Final = 0.1  # of the inputs that also run as a whole command


_MAX_SHOWN: Final = 3_000


@dataclass(slots=True)
class Found:
    """What became of how many inputs, and what was wrong: a text for each input."""

    fates: Counter[str] = field(default_factory=Counter)
    wrong: dict[str, list[str]] = field(default_factory=dict)


def examine(command: Sequence[str], names: Sequence[str], found: Found) -> None:
    """Has a child try inputs, and another one after each of which it died."""
    waiting = list(names)
    while waiting:
        done = subprocess.run([*command, *waiting], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
        ends = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('["end"')]
        for _, name, fate, wrong in ends:
            found.fates[fate] += 1
            if wrong:
                found.wrong[name] = wrong
        waiting = waiting[len(ends) :]
        if waiting:
            victim = waiting.pop(0)
            found.fates["died"] += 1
            found.wrong[victim] = [f"the child died: exit status {done.returncode}"]


def examine_urdfs(paths: Sequence[Path], found: Found) -> None:
    """Compares what sim-action and the engine make of models."""
    examine([sys.executable, "-m", "tests.fuzz.urdf_trial"], list(map(str, paths)), found)


def examine_cases(names: Sequence[str], found: Found, share: float = SHARE) -> None:
    """Tries inputs by their names; see `trial`."""
    with tempfile.TemporaryDirectory() as folder:
        examine([sys.executable, "-m", "tests.fuzz.trial", folder, str(share)], names, found)


def kind_of(wrong: str) -> str:
    """What two findings have in common that are the same thing."""
    text = wrong.strip().splitlines()[-1] if "Traceback" in wrong else wrong
    return re.sub(r"(joint|link) .*?(: |, )|[-+]?\d[\d.e+-]*|'[^']*'|/\S+", "#", text)[:90]


def written(folder: Path, seed: int, count: int, start: int = 0) -> list[Path]:
    """Models numbered from `start` of a seed."""
    (folder / MESH).write_text(MESH_TEXT)
    paths = []
    for number in range(start, start + count):
        path = folder / f"{seed}-{number}.urdf"
        path.write_bytes(model_bytes(random.Random(f"{seed}-{number}")))
        paths.append(path)
    return paths


def tried(kind: str, seed: int, start: int, keep: Path | None) -> Found:
    """What became of the next batch of a kind."""
    found = Found()
    if kind != URDF:
        examine_cases([f"{kind}:{seed}:{number}" for number in range(start, start + BATCH)], found)
        return found
    with tempfile.TemporaryDirectory() as folder:
        examine_urdfs(written(Path(folder), seed, BATCH, start), found)
        if keep is not None and found.wrong:
            keep.mkdir(parents=True, exist_ok=True)
            for name in map(Path, found.wrong):
                (keep / name.name).write_bytes(name.read_bytes())
    return found


def cpu_s() -> float:
    """The processor time in s of this process and of those that have ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=15, help="of processor time")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", action="append", choices=KINDS, help="repeatable; default: all")
    parser.add_argument("--keep", type=Path, default=None, help="folder for the inputs that show a fault")
    asked = parser.parse_args()
    kinds: Sequence[str] = asked.kind or KINDS
    fates, faults, number = {kind: Counter[str]() for kind in kinds}, Counter[str](), 0
    while cpu_s() < 60 * asked.minutes:
        for kind in kinds:
            found = tried(kind, asked.seed, number, asked.keep)
            fates[kind] += found.fates
            for name, several in found.wrong.items():
                _tell(name, several, faults, asked.keep)
        number += BATCH
    print(f"{cpu_s() / 60:.1f} minutes of processor time")  # noqa: T201 - a command
    for kind, counts in fates.items():
        told = ", ".join(f"{count} {fate}" for fate, count in sorted(counts.items()))
        print(f"{kind:12} {counts.total():7} {told}")  # noqa: T201 - a command
    for text, count in faults.most_common():
        print(f"{count:6} {text}")  # noqa: T201 - a command
    sys.exit(bool(faults))


def _tell(name: str, wrong: Sequence[str], faults: Counter[str], keep: Path | None) -> None:
    for text in wrong:
        faults[kind_of(text)] += 1
        if faults[kind_of(text)] <= 3:
            print(name, text[-_MAX_SHOWN:], sep=": ", flush=True)  # noqa: T201 - a command
            if keep is not None and ":" in name:
                _keep(name, keep)


def _keep(name: str, keep: Path) -> None:
    from tests.fuzz.trial import named_case
    from tests.fuzz.trial import written as files_written

    folder = keep / name.replace(":", "-")
    folder.mkdir(parents=True, exist_ok=True)
    files_written(named_case(name), folder)


if __name__ == "__main__":
    main()

"""Asks sim-action and the engine about URDFs that nobody has written, and keeps those on which they differ.

    python -m tests.fuzz_urdf --minutes 15 --seed 1 --keep /tmp/found

The models come of a seed alone: the same seed gives the same models. Exit code 1 if anything was found.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tests.urdf_damage import model_bytes
from tests.urdf_texts import MESH, MESH_TEXT

ROOT: Final = Path(__file__).parents[1]
BATCH: Final = 100


@dataclass(slots=True)
class Found:
    """What became of how many models, and what was wrong: a text for each file."""

    fates: Counter[str] = field(default_factory=Counter)
    wrong: dict[Path, list[str]] = field(default_factory=dict)


def examine(paths: Sequence[Path], found: Found) -> None:
    """Has a child look at models, and another one after each of which it died."""
    waiting = list(map(str, paths))
    while waiting:
        command = [sys.executable, "-m", "tests.urdf_trial", *waiting]
        done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
        ends = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('["end"')]
        for _, name, fate, wrong in ends:
            found.fates[fate] += 1
            if wrong:
                found.wrong[Path(name)] = wrong
        waiting = waiting[len(ends) :]
        if waiting:
            victim = waiting.pop(0)
            found.fates["died"] += 1
            found.wrong[Path(victim)] = [f"the child died: exit status {done.returncode}"]


def kind(wrong: str) -> str:
    """What two findings have in common that are the same thing."""
    text = wrong.strip().splitlines()[-1] if "Traceback" in wrong else wrong
    return re.sub(r"(joint|link) .*?(: |, )|[-+]?\d[\d.e+-]*|'[^']*'|/\S+", "#", text)[:60]


def written(folder: Path, seed: int, count: int, start: int = 0) -> list[Path]:
    """Models numbered from `start` of a seed."""
    (folder / MESH).write_text(MESH_TEXT)
    paths = []
    for number in range(start, start + count):
        path = folder / f"{seed}-{number}.urdf"
        path.write_bytes(model_bytes(random.Random(f"{seed}-{number}")))
        paths.append(path)
    return paths


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=15)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, default=None)
    asked = parser.parse_args()
    found, kinds, number = Found(), Counter[str](), 0
    end = time.monotonic() + 60 * asked.minutes
    while time.monotonic() < end:
        with tempfile.TemporaryDirectory() as folder:
            paths = written(Path(folder), asked.seed, BATCH, number)
            number += BATCH
            examine(paths, found)
            for path, wrong in found.wrong.items():
                _tell(path, wrong, kinds, asked.keep)
            found.wrong.clear()
    print(number, "models:", dict(found.fates))  # noqa: T201 - a command
    for text, count in kinds.most_common():
        print(f"{count:6} {text}")  # noqa: T201 - a command
    sys.exit(bool(kinds))


def _tell(path: Path, wrong: Sequence[str], kinds: Counter[str], keep: Path | None) -> None:
    for text in wrong:
        kinds[kind(text)] += 1
        if kinds[kind(text)] <= 3:
            print(path.name, text, sep=": ", flush=True)  # noqa: T201 - a command
            if keep is not None:
                keep.mkdir(parents=True, exist_ok=True)
                (keep / path.name).write_bytes(path.read_bytes())


if __name__ == "__main__":
    main()

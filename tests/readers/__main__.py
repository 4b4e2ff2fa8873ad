"""Compare how six readers understand URDFs that are drawn at random, and public ones.

    python -m tests.readers --count 1000 --seed 1 [--models FOLDER] [--environment FOLDER]

The libraries of requirements.txt are installed in a temporary environment, or in the folder `--environment`, which is
then kept. `--models` also reads all URDFs below a folder. A table says how many differences each class of `CLASSES`
has. Exit code 1 if a difference has no class; the first of each kind are printed.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
import venv
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET

from tests.readers.classes import ALL, CLASSES, Class, class_of
from tests.readers.differences import Difference, differences
from tests.readers.drawn_robots import drawn_positions, drawn_robot
from tools.docs.public_models import NOT_ROBOTS

_FOLDER: Final = Path(__file__).parent
_BATCH: Final = 50
_MAX_SHOWN: Final = 5


def python_of(environment: Path) -> Path:
    """Return the Python of an environment with the libraries, which is made if it is not there."""
    python = environment / "bin/python"
    if not python.exists():
        venv.create(environment, with_pip=True)
        options = ("-q", "--require-hashes", "--only-binary", ":all:", "-r", str(_FOLDER / "requirements.txt"))
        subprocess.run([str(python), "-m", "pip", "install", *options], check=True)
    return python


def readings(python: Path, reader: str, paths: Sequence[Path]) -> dict[str, Any]:
    """Return model -> what a reader understood. A model of which the reader died has an error."""
    command = (
        [sys.executable, "-m", "tests.readers.peers"] if reader == "sim-action" else [python, _FOLDER / "peers.py"]
    )
    done, waiting = dict[str, Any](), list(paths)
    while waiting:
        batch = waiting[:_BATCH]
        child = subprocess.run([*command, reader, *batch], cwd=_FOLDER.parents[1], stdout=subprocess.PIPE, check=False)
        lines = [json.loads(line) for line in child.stdout.splitlines()]
        done |= dict(lines)
        waiting = waiting[len(lines) :]
        if len(lines) < len(batch):
            done[str(waiting.pop(0))] = {"error": f"the reader died: exit status {child.returncode}"}
    return done


def drawn(folder: Path, seed: int, count: int) -> list[Path]:
    """Write models of a seed, each with a file of the positions of its joints; return their files."""
    paths = []
    for number in range(count):
        text, positions = drawn_robot(random.Random(f"{seed}-{number}"))
        path = folder / f"{seed}-{number}.urdf"
        path.write_text(text, encoding="utf-8")
        path.with_suffix(".json").write_text(json.dumps(positions), encoding="utf-8")
        paths.append(path)
    return paths


def public(folder: Path, target: Path, seed: int) -> list[Path]:
    """Write the URDFs below a folder without shapes and materials, as `drawn` writes its own."""
    paths = []
    for number, source in enumerate(sorted(folder.rglob("*.urdf"))):
        if NOT_ROBOTS & set(source.parts):
            continue
        try:
            root = ET.parse(source).getroot()
        except ET.ParseError:
            continue
        for element in (root, *root.findall("link")):
            for part in [part for part in element if part.tag in {"visual", "collision", "material"}]:
                element.remove(part)
        path = target / f"{number}-{source.name}"
        ET.ElementTree(root).write(path)
        positions = drawn_positions(root, random.Random(f"{seed}-{path.stem}"))
        path.with_suffix(".json").write_text(json.dumps(positions), encoding="utf-8")
        paths.append(path)
    return paths


def compared(python: Path, paths: Sequence[Path]) -> Iterator[Difference]:
    """Yield all differences of models."""
    by_reader = {reader: readings(python, reader, paths) for reader in ("sim-action", *ALL)}
    for path in paths:
        text = path.read_text(encoding="utf-8")
        yield from differences(str(path), text, {reader: read[str(path)] for reader, read in by_reader.items()})


def table(counts: Mapping[Class | None, Counter[str]]) -> str:
    """Return the classes with the number of differences and of models for each reader."""
    lines = []
    for row in (*CLASSES, None):
        several = counts.get(row, Counter())
        text = "without a class" if row is None else f"{row.scope}: {row.text}"
        lines.append(f"{several.total():7}  {dict(sorted(several.items()))}  {text}")
    return "\n".join(lines)


def _counted(every: Iterable[Difference]) -> dict[Class | None, Counter[str]]:
    counts: dict[Class | None, Counter[str]] = {None: Counter()}
    shown = Counter[tuple[str, str]]()
    for difference in every:
        row = class_of(difference)
        counts.setdefault(row, Counter())[difference.reader] += 1
        kind = (difference.reader, difference.quantity)
        if row is None and shown[kind] < _MAX_SHOWN:
            print(f"without a class: {difference}")  # noqa: T201 - a command
            shown[kind] += 1
    return counts


def main() -> None:
    """Read, compare, print the table, and exit with 1 if a difference has no class."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=1000, help="models to draw")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--models", type=Path, action="append", default=[], help="folder of URDFs; repeatable")
    parser.add_argument("--environment", type=Path, help="environment of the libraries; default: a temporary one")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        python = python_of(asked.environment or folder / "environment")
        paths = drawn(folder, asked.seed, asked.count)
        for number, models in enumerate(asked.models):
            target = folder / f"models{number}"
            target.mkdir()
            paths += public(models, target, asked.seed)
        counts = _counted(compared(python, paths))
    print(f"{len(paths)} models, {sum(several.total() for several in counts.values())} differences")  # noqa: T201
    print(table(counts))  # noqa: T201
    sys.exit(bool(counts[None]))


if __name__ == "__main__":
    main()

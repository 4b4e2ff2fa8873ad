"""Some scenarios of a file, by their numbers: `push.sim.yml::1-15,31`, as a matrix hands them to its shards."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from itertools import groupby
from typing import Final

_RANGE: Final = "[0-9]{1,5}(?:-[0-9]{1,5})?"
_NUMBERED: Final = re.compile(rf"(.+)::({_RANGE}(?:,{_RANGE})*)", re.DOTALL)


def ranges_text(numbers: Iterable[int], between: str = ",") -> str:
    """Numbers in ascending order, those that follow each other as one, such as "1-15,31"."""
    # Those that follow each other are equally far from their places in the list.
    runs = [
        [number for _, number in run] for _, run in groupby(enumerate(sorted(numbers)), lambda pair: pair[1] - pair[0])
    ]
    return between.join(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)


def numbered(file: str, numbers: Iterable[int]) -> str:
    """How some scenarios of a file are called."""
    return f"{file}::{ranges_text(numbers)}"


def split(pattern: str) -> tuple[str, frozenset[int] | None]:
    """A file and the numbers that stand behind its name; None: all. What is there by that very name is a file."""
    found = _NUMBERED.fullmatch(pattern)
    if found is None or os.path.lexists(pattern):
        return pattern, None
    return found[1], frozenset(number for part in found[2].split(",") for number in _range(part))


def _range(text: str) -> range:
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)

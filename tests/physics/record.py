"""The recorded value of every case, from which the table in docs/engines/accuracy.md is made."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from tests.physics.case import BETWEEN

FILE: Final = Path(__file__).with_name("measured.json")
_DIGITS: Final = 6

RECORDED: Final[Mapping[str, Mapping[str, float]]] = (
    json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {"pybullet": {}, "mujoco": {}, BETWEEN: {}}
)
"""Engine, or `BETWEEN`, -> name of a case -> value."""


def write(values: Mapping[str, Mapping[str, float]]) -> None:
    """Write the file, with values of a few digits."""
    rounded = {
        engine: {name: float(f"{value:.{_DIGITS}g}") for name, value in cases.items()}
        for engine, cases in values.items()
    }
    FILE.write_text(json.dumps(rounded, indent=1) + "\n", encoding="utf-8")

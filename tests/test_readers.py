"""The first of the drawn URDFs of `make soak`, read by those of its readers that tests have."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.readers.__main__ import drawn
from tests.readers.classes import class_of
from tests.readers.differences import Difference, differences
from tests.readers.peers import READERS

COUNT = 15


def read(reader: str, path: Path) -> dict[str, Any]:
    try:
        return READERS[reader](path, json.loads(path.with_suffix(".json").read_text(encoding="utf-8")))
    except Exception as error:  # noqa: BLE001 - readers refuse with errors of many kinds
        return {"error": str(error)}


def found(reader: str, folder: Path, change: Callable[[dict[str, Any]], None] = lambda _: None) -> list[Difference]:
    pytest.importorskip(reader)
    several = []
    for path in drawn(folder, 3, COUNT):
        readings = {name: read(name, path) for name in ("sim-action", reader)}
        if "error" not in readings[reader]:
            change(readings[reader])
        several += list(differences(path.stem, path.read_text(encoding="utf-8"), readings))
    return several


@pytest.mark.parametrize("reader", ["mujoco", "pybullet", "urchin"])
def test_every_difference_has_a_class(reader: str, tmp_path: Path) -> None:
    every = found(reader, tmp_path)
    assert [str(difference) for difference in every if class_of(difference) is None] == []
    assert every

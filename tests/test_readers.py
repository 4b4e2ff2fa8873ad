"""The first of the drawn URDFs of `make soak`, read by those of its readers that tests have."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.readers.__main__ import drawn
from tests.readers.classes import CLASSES, class_of
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


def heavier(reading: dict[str, Any]) -> None:
    for link in reading["links"].values():
        if link:
            link["mass"] *= 1.001


def turned(reading: dict[str, Any]) -> None:
    for frame in reading["frames"].values():
        frame[3:] = frame[6:9] + frame[3:6] + frame[9:]


def wider(reading: dict[str, Any]) -> None:
    for joint in reading["joints"].values():
        if joint.get("upper"):
            joint["upper"] *= 1.01


def spread(reading: dict[str, Any]) -> None:
    for link in reading["links"].values():
        if link:
            link["inertia"][0] *= 1.1


@pytest.mark.parametrize(
    ("change", "quantity"), [(heavier, "mass"), (turned, "frame"), (wider, "upper"), (spread, "inertia")]
)
def test_a_wrong_reading_has_no_class(change: Callable[[dict[str, Any]], None], quantity: str, tmp_path: Path) -> None:
    every = found("mujoco", tmp_path, change)
    assert quantity in {difference.quantity for difference in every if class_of(difference) is None}


def test_classes_name_a_side_and_a_clause() -> None:
    assert {row.whose for row in CLASSES} == {"theirs", "specification"}
    assert all(row.clause and row.text.endswith(".") for row in CLASSES)

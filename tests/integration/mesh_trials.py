"""Asks a child what PyBullet makes of meshes, and waits for it to answer or to die."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from sim_action.core.geometry import Vector3
from sim_action.meshes import clean_mesh
from sim_action.meshes.collision_hulls import hull_file_name
from tests.patience import PATIENCE

_CHILD = Path(__file__).with_name("mesh_engine.py")
ENGINES_MARGIN = 0.001  # in m: what PyBullet 3.2.7 puts around each hull


def found(*asked: list[Any]) -> list[dict[str, Any]]:
    """What the child says to each that it is asked."""
    command = [sys.executable, str(_CHILD), json.dumps(asked)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=True)
    answers = [json.loads(line[6:]) for line in done.stdout.splitlines() if line.startswith("FOUND ")]
    assert len(answers) == len(asked)
    return answers


def reach(answer: dict[str, Any]) -> tuple[Any, ...]:
    return tuple(answer["reach"].values())


def both(lower: Vector3, upper: Vector3) -> tuple[float, ...]:
    """How far a box reaches: +x, -x, +y, -y, +z, -z."""
    return tuple(part for low, high in zip(lower, upper, strict=True) for part in (high, -low))


def written(folder: Path, name: str, data: bytes) -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


def rewritten(path: Path, scale: Vector3 = (1, 1, 1), margin: float = ENGINES_MARGIN) -> str:
    text = clean_mesh(path, path.parent / "clean", scale, margin).text
    (folder := path.parent / "rewritten").mkdir(exist_ok=True)
    return str(written(folder, hull_file_name(text), text))

"""Runs in a child, as the engine may die of what it is given: what PyBullet makes of meshes as collision shapes.

Its argument is JSON: a list of what to try, one after the other. It prints a line of JSON for each.
"""

from __future__ import annotations

import itertools
import json
import math
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pybullet

FAR = 50.0
AXES = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0), "+z": (0, 0, 1), "-z": (0, 0, -1)}
INERTIAL = """<inertial><mass value="{0}"/>
  <inertia ixx="{1}" iyy="{1}" izz="{1}" ixy="0" ixz="0" iyz="0"/></inertial>"""


def urdf(shape: str, attributes: str = "") -> str:
    collision = f"<collision {attributes}><geometry>{shape}</geometry></collision>"
    return f'<robot name="it"><link name="it">{INERTIAL.format(2, 0.02)}{collision}</link></robot>'


def load(text: str, z: float) -> int:
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_IMPLICIT_CYLINDER
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "it.urdf")
        path.write_text(text)
        return int(pybullet.loadURDF(str(path), [0, 0, z], flags=flags))


def plane(normal: tuple[float, ...] = (0, 0, 1), at: tuple[float, ...] = (0, 0, 0)) -> int:
    shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=normal)
    return int(pybullet.createMultiBody(0, shape, basePosition=at))


def reach(body: int, axis: tuple[int, int, int]) -> float | None:
    """How far the body reaches from the origin along an axis."""
    wall = plane(tuple(-part for part in axis), tuple(FAR * part for part in axis))
    points = pybullet.getClosestPoints(body, wall, 2 * FAR)
    pybullet.removeBody(wall)
    return FAR - min(point[8] for point in points) if points else None


def look_at(mesh: str, attributes: str = "", scale: str = "1 1 1") -> dict[str, Any]:
    """How far a mesh reaches, and where its origin is after a fall of 5 mm."""
    body = load(urdf(f'<mesh filename="{mesh}" scale="{scale}"/>', attributes), 0)
    reached = {name: reach(body, axis) for name, axis in AXES.items()}
    low = reached["-z"] or 0.0
    plane()
    pybullet.resetBasePositionAndOrientation(body, (0, 0, low + 0.005), (0, 0, 0, 1))
    for _ in range(480):
        pybullet.stepSimulation()
    z = pybullet.getBasePositionAndOrientation(body)[0][2]
    return {"reach": reached, "rests_at": z, "mass": pybullet.getDynamicsInfo(body, -1)[0]}


def survive(folder: str) -> dict[str, Any]:
    """Loads every mesh of a folder and lets it fall; says in how many a number was lost."""
    lost = 0
    plane()
    for path in sorted(Path(folder).glob("*.obj")):
        body = load(urdf(f'<mesh filename="{path}"/>'), 0)
        for _ in range(20):
            pybullet.stepSimulation()
        state = (*pybullet.getBasePositionAndOrientation(body), *pybullet.getBaseVelocity(body))
        lost += not all(map(math.isfinite, itertools.chain(*state)))
        pybullet.removeBody(body)
    return {"lost": lost}


TRIALS: dict[str, Callable[..., dict[str, Any]]] = {"look_at": look_at, "survive": survive}


def main() -> None:
    for name, *arguments in json.loads(sys.argv[1]):
        pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0, 0, -9.80665)
        pybullet.setPhysicsEngineParameter(enableFileCaching=0, deterministicOverlappingPairs=1)
        found = TRIALS[name](*arguments)
        print("FOUND", json.dumps(found), flush=True)  # noqa: T201 - the engine prints between
        pybullet.disconnect()


if __name__ == "__main__":
    main()

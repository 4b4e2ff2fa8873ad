"""What readers understand differently of a URDF: differences from our reading, one by one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

import numpy as np

Reading = Mapping[str, Any]
_RELATIVE: Final = 1e-4
_LENGTH_M: Final = 1e-4
_ROTATION: Final = 1e-4  # PyBullet gives poses in single precision
_NOT_KEPT: Final = object()


@dataclass(frozen=True)
class Difference:
    """A value that a reader understands differently from us."""

    model: str  # model, reader: where it is
    reader: str
    quantity: str  # "mass", "centre", "inertia", "body", "frame", "joints", "links", "type", "lower", ... or "refused".
    name: str  # of the link or joint; empty for a whole model
    element: Element | None  # of that link or joint; None for a whole model
    ours: Any  # ours, theirs: the two values
    theirs: Any
    root: Element  # the robot

    def __str__(self) -> str:
        return f"{self.model} {self.reader} {self.quantity} {self.name}: {self.theirs}, ours {self.ours}"


def differences(model: str, text: str, readings: Mapping[str, Reading]) -> Iterator[Difference]:
    """Yield all differences of other readers from "sim-action"."""
    root = ET.fromstring(text)
    ours = readings["sim-action"]
    elements = {f"{part.tag} {part.get('name')}": part for part in root if part.tag in {"link", "joint"}}
    for reader, theirs in readings.items():
        if reader == "sim-action":
            continue
        for quantity, name, our_value, their_value in _pairs(ours, theirs):
            kind = "joint" if quantity in _JOINT or quantity == "joint" else "link"
            element = elements.get(f"{kind} {name}")
            yield Difference(model, reader, quantity, name, element, our_value, their_value, root)


_JOINT: Final = ("type", "lower", "upper", "effort", "velocity")


def _pairs(ours: Reading, theirs: Reading) -> Iterator[tuple[str, str, Any, Any]]:
    if "error" in ours or "error" in theirs:
        if ("error" in ours) != ("error" in theirs):
            yield "refused", "", ours.get("error"), theirs.get("error")
        return
    yield from _links(ours, theirs)
    yield from _joints(ours["joints"], theirs["joints"])
    yield from _frames(ours["frames"], theirs["frames"])


def _links(ours: Reading, theirs: Reading) -> Iterator[tuple[str, str, Any, Any]]:
    if "bodies" in theirs:
        links, bodies = composites(ours), theirs["bodies"]
    else:
        links, bodies = ours["links"], theirs["links"]
        for name in links.keys() ^ bodies.keys():
            yield "link", name, name in links, name in bodies
    for name in links.keys() & bodies.keys():
        our, their = links[name], bodies[name]
        mass, other = our.get("mass", 0.0), their.get("mass", 0.0)
        if not _near(mass, other):
            yield "mass", name, mass, other
        elif mass:
            size = max(1.0, *map(abs, our["centre"]))
            if math.dist(our["centre"], their["centre"]) > _LENGTH_M * size:
                yield "centre", name, our["centre"], their["centre"]
            scale = max(map(abs, our["inertia"]))
            if not np.allclose(our["inertia"], their["inertia"], rtol=0, atol=10 * _RELATIVE * scale):
                yield "inertia", name, our["inertia"], their["inertia"]


def composites(reading: Reading) -> dict[str, Reading]:
    """Return the bodies of links that are welded together, by the first link of each, in that link's frame."""
    joints, frames = reading["joints"], reading["frames"]
    parents = reading["parents"]
    groups: dict[str, list[str]] = {}
    for name in reading["links"]:
        first = name
        while first in parents and joints[parents[first][0]]["type"] == "fixed":
            first = parents[first][1]
        groups.setdefault(first, []).append(name)
    return {first: _composite([_moved(reading["links"][name], frames[name]) for name in names], frames[first])
            for first, names in groups.items()}  # fmt: skip


def _moved(body: Reading, frame: list[float]) -> tuple[float, Any, Any]:
    if not body:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    rotation = np.reshape(frame[3:], (3, 3))
    return body["mass"], np.array(frame[:3]) + rotation @ body["centre"], rotation @ _matrix(body) @ rotation.T


def _matrix(body: Reading) -> Any:
    xx, xy, xz, yy, yz, zz = body["inertia"]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _composite(bodies: list[tuple[float, Any, Any]], frame: list[float]) -> Reading:
    mass = sum(body[0] for body in bodies)
    if not mass:
        return {}
    centre = sum(body[0] * body[1] for body in bodies) / mass
    tensor = np.zeros((3, 3))
    for weight, at, about in bodies:
        arm = at - centre
        tensor += about + weight * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    rotation = np.reshape(frame[3:], (3, 3))
    local = rotation.T @ tensor @ rotation
    inertia = [local[i][j] for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))]
    return {"mass": mass, "centre": list(rotation.T @ (centre - np.array(frame[:3]))), "inertia": inertia}


def _joints(ours: Reading, theirs: Reading) -> Iterator[tuple[str, str, Any, Any]]:
    for name in ours.keys() | theirs.keys():
        our, their = ours.get(name), theirs.get(name)
        if our is None or their is None:
            # Readers that weld links together, or list joints that move, keep no fixed joints.
            if (our or their or {}).get("type") not in {"fixed", "weld"}:
                yield "joint", name, our, their
            continue
        if _kind(our["type"]) != _kind(their["type"]):
            yield "type", name, our["type"], their["type"]
        elif "lower" in our and our["type"] != "fixed":
            for key in _JOINT[1:]:
                value = their.get(key, _NOT_KEPT)
                if value is not _NOT_KEPT and not _near(our[key], value):
                    yield key, name, our[key], value


def _kind(kind: str) -> str:
    if kind.startswith(("JointModelR", "revolute", "continuous")):
        return "turning"
    return "prismatic" if kind.startswith(("JointModelP", "prismatic")) else {"weld": "fixed"}.get(kind, kind)


def _frames(ours: Reading, theirs: Reading) -> Iterator[tuple[str, str, Any, Any]]:
    for name in ours.keys() & theirs.keys():
        our, their = ours[name], theirs[name]
        size = max(1.0, *map(abs, our[:3]))
        if math.dist(our[:3], their[:3]) > _LENGTH_M * size or math.dist(our[3:], their[3:]) > _ROTATION:
            yield "frame", name, our, their


def _near(ours: float | None, theirs: float | None) -> bool:
    if ours is None or theirs is None:
        return ours is theirs
    return math.isclose(ours, theirs, rel_tol=_RELATIVE, abs_tol=1e-9)

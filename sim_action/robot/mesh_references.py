"""Meshes that a model names: where they are, what is wrong with them, and what an engine gets to see instead."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.geometry import Box, Vector3
from sim_action.robot.audit.shapes import LARGEST
from sim_action.robot.packages import PackageError, Packages
from sim_action.robot.robot_model import Finding
from sim_action.robot.urdf_elements import vector
from sim_action.robot.xml_document import ModelDocument

# In m: PyBullet puts so much around every hull, and a wheel would roll over 2 % too far.
_ENGINE_MARGIN: Final = 0.001
# In m: what is smaller is nothing but that margin.
_SMALLEST: Final = 0.001
_ODD_SHAPES: Final = {
    "concave": ("concave-mesh", "is hollow or open: what collides is its convex hull; split it into convex parts"),
    "flat": ("flat-mesh", "has no volume: what collides is as thick as the engine's margin; give it a thickness"),
}


@dataclass(frozen=True, eq=False)
class Meshes:
    """What came of a model's meshes.

    Attributes:
        boxes: m, around each collision mesh, in its own frame, scale applied.
        visuals: where the file of each mesh is that is only looked at.
    """

    findings: tuple[Finding, ...]
    boxes: Mapping[Element, Box]
    visuals: Mapping[Element, Path]


def resolve_meshes(document: ModelDocument, path: Path, packages: Packages) -> Meshes:
    """Makes collision meshes files that were written here; `path`: of the model's file."""
    boxes: dict[Element, Box] = {}
    visuals: dict[Element, Path] = {}
    findings = tuple(_resolve(document, path, packages, boxes, visuals))
    return Meshes(findings, MappingProxyType(boxes), MappingProxyType(visuals))


def _resolve(
    document: ModelDocument, path: Path, packages: Packages, boxes: dict[Element, Box], visuals: dict[Element, Path]
) -> Iterator[Finding]:
    told = set[str]()
    for shape in document.elements("link/collision", "link/visual"):
        mesh = shape.find("geometry/mesh")
        if mesh is None:
            continue
        try:
            found = packages.resolve(mesh.attrib["filename"], document.files.get(mesh, path))
        except PackageError as error:
            missing = "missing-mesh" if error.rule == "missing-file" else error.rule
            rule = "missing-visual" if shape.tag == "visual" else missing
            yield document.finding(rule, mesh, str(error))
            continue
        if found.warning and found.warning not in told:
            told.add(found.warning)
            yield document.finding("several-packages", mesh, found.warning)
        if shape.tag == "collision":
            # On a body that moves, the engine would let it fall through the ground.
            shape.attrib.pop("concave", None)
            yield from _rewrite(document, mesh, found.path, boxes)
        else:
            visuals[mesh] = found.path


def _rewrite(document: ModelDocument, mesh: Element, path: Path, boxes: dict[Element, Box]) -> Iterator[Finding]:
    # Reading meshes takes numpy, which most scenarios do without until they run.
    from sim_action.meshes import MeshError, clean_mesh

    name, scale = mesh.attrib["filename"], vector(mesh, "scale", (1.0, 1.0, 1.0))
    try:
        clean = clean_mesh(path, cache_folder(), scale, _ENGINE_MARGIN)
    except MeshError as error:
        yield document.finding(error.rule, mesh, f"mesh '{name}': {error}")
        return
    if clean.facts.shape in _ODD_SHAPES:
        rule, what = _ODD_SHAPES[clean.facts.shape]
        yield document.finding(rule, mesh, f"mesh '{name}' {what}")
    boxes[mesh] = clean.box
    for rule, what in _odd_sizes(clean.box, scale):
        yield document.finding(rule, mesh, f"mesh '{name}' {what}")
    mesh.attrib.clear()
    mesh.set("filename", str(clean.path))


def _odd_sizes(box: Box, scale: Vector3) -> Iterator[tuple[str, str]]:
    """Rules about lengths that no part of a robot has, and what to write instead."""
    largest = max(above - below for below, above in zip(*box, strict=True))
    if largest > LARGEST:
        yield "absurd-size", f"measures {largest:.4g} m: is it in millimetres? then write {_scale(scale, 1e-3)}"
    elif largest < _SMALLEST:
        yield "tiny-mesh", f"measures {largest:.2g} m: is it in metres already? then write {_scale(scale, 1e3)}"


def _scale(stated: Vector3, factor: float) -> str:
    return f'scale="{" ".join(f"{part * factor:.6g}" for part in stated)}"'


def cache_folder() -> Path:
    """Where rewritten meshes are kept, by content, for all runs of this user (XDG Base Directory Specification)."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home, "sim-action", "meshes")

"""Meshes that a model names: where they are, what is wrong with them, and what an engine gets to see instead."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.models.document import ModelDocument
from sim_action.models.packages import PackageError, Packages
from sim_action.models.values import vector
from sim_action.robot_model import Finding

# In m: PyBullet puts so much around every hull, and a wheel would roll over 2 % too far.
_ENGINE_MARGIN: Final = 0.001
_ODD_SHAPES: Final = {
    "concave": ("concave-mesh", "is hollow or open: what collides is its convex hull; split it into convex parts"),
    "flat": ("flat-mesh", "has no volume: what collides is as thick as the engine's margin; give it a thickness"),
}


def resolve_meshes(document: ModelDocument, path: Path, packages: Packages) -> Iterator[Finding]:
    """Makes collision meshes files that were written here; `path`: of the model's file."""
    told = set[str]()
    for shape in document.elements("link/collision", "link/visual"):
        mesh = shape.find("geometry/mesh")
        if mesh is None:
            continue
        try:
            found = packages.resolve(mesh.attrib["filename"], path)
        except PackageError as error:
            rule = "missing-visual" if shape.tag == "visual" else "missing-mesh"
            yield document.finding(rule, mesh, str(error))
            continue
        if found.warning and found.warning not in told:
            told.add(found.warning)
            yield document.finding("several-packages", mesh, found.warning)
        if shape.tag == "collision":
            # On a body that moves, the engine would let it fall through the ground.
            shape.attrib.pop("concave", None)
            yield from _rewrite(document, mesh, found.path)


def _rewrite(document: ModelDocument, mesh: Element, path: Path) -> Iterator[Finding]:
    # Reading meshes takes numpy, which most scenarios do without until they run.
    from sim_action.models.meshes import MeshError, clean_mesh

    name = mesh.attrib["filename"]
    try:
        clean = clean_mesh(path, _cache_folder(), vector(mesh, "scale", (1.0, 1.0, 1.0)), _ENGINE_MARGIN)
    except MeshError as error:
        yield document.finding(error.rule, mesh, f"mesh '{name}': {error}")
        return
    if clean.facts.shape in _ODD_SHAPES:
        rule, what = _ODD_SHAPES[clean.facts.shape]
        yield document.finding(rule, mesh, f"mesh '{name}' {what}")
    mesh.attrib.clear()
    mesh.set("filename", str(clean.path))


def _cache_folder() -> Path:
    """Where rewritten meshes are kept, by content, for all runs of this user (XDG Base Directory Specification)."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home, "sim-action", "meshes")

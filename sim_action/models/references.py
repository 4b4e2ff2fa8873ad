"""Meshes that a model names: where they are, and what becomes of those that are not there."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

from sim_action.models.document import ModelDocument
from sim_action.models.packages import PackageError, Packages
from sim_action.robot_model import Finding


def resolve_meshes(document: ModelDocument, path: Path, packages: Packages) -> Iterator[Finding]:
    """Makes the paths of meshes absolute; `path`: of the model's file.

    Visuals whose mesh is not there are taken out: nothing can touch them.
    """
    told = set[str]()
    for link in document.elements("link"):
        for shape in (*link.findall("collision"), *link.findall("visual")):
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            try:
                found = packages.resolve(mesh.attrib["filename"], path)
            except PackageError as error:
                yield _missing(document, shape, mesh, error)
                link.remove(shape)
                continue
            mesh.set("filename", str(found.path))
            if found.warning and found.warning not in told:
                told.add(found.warning)
                yield document.finding("several-packages", mesh, found.warning)


def _missing(document: ModelDocument, shape: Element, mesh: Element, error: PackageError) -> Finding:
    rule = "missing-visual" if shape.tag == "visual" else "missing-mesh"
    return document.finding(rule, mesh, str(error))

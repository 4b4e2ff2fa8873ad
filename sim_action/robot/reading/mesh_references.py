"""Resolve the meshes that a model refers to: find them, check them, and write clean copies for the engine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final
from xml.etree.ElementTree import Element

from sim_action.core.content_cache import cache_folder
from sim_action.core.geometry import Box, Vector3
from sim_action.core.records import dataclass
from sim_action.robot.documents.packages import PackageError, Packages
from sim_action.robot.documents.urdf_elements import MAX_PART_SIZE_M, vector
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.findings import Finding
from sim_action.robot.model.robot_model import ENGINE_MARGIN_M

if TYPE_CHECKING:
    from sim_action.meshes import CleanMesh

# A smaller mesh consists of that margin only.
_MIN_MESH_SIZE_M: Final = 0.001
_ODD_SHAPES: Final = {
    "concave": ("concave-mesh", "is concave or open: its convex hull collides instead; split it into convex parts"),
    "flat": ("flat-mesh", "has no volume: it collides as a plate as thick as the engine's margin; give it a thickness"),
}


@dataclass(frozen=True, eq=False)
class Meshes:
    """The result of resolving the meshes of a model."""

    findings: tuple[Finding, ...]
    boxes: Mapping[Element, Box]  # the box around each collision mesh, in m, in its own frame, with its scale applied
    hulls: Mapping[Element, bytes]  # the text of each clean copy, see `Shape`
    visuals: Mapping[Element, Path]  # the file of each visual mesh


def resolve_meshes(document: ModelDocument, path: Path, packages: Packages) -> Meshes:
    """Find all meshes, and replace collision meshes by clean copies. `path`: the file of the model."""
    clean: dict[Element, CleanMesh] = {}
    visuals: dict[Element, Path] = {}
    findings = tuple(_resolve(document, path, packages, clean, visuals))
    boxes, hulls = {mesh: copy.box for mesh, copy in clean.items()}, {mesh: copy.text for mesh, copy in clean.items()}
    return Meshes(findings, MappingProxyType(boxes), MappingProxyType(hulls), MappingProxyType(visuals))


def _resolve(
    document: ModelDocument,
    path: Path,
    packages: Packages,
    clean: dict[Element, CleanMesh],
    visuals: dict[Element, Path],
) -> Iterator[Finding]:
    told = set[tuple[str, Path]]()
    for shape in document.elements("link/collision", "link/visual"):
        mesh = shape.find("geometry/mesh")
        if mesh is None:
            continue
        try:
            found = packages.resolve(mesh.attrib["filename"], document.files.get(mesh, path))
        except PackageError as error:
            missing = "missing-mesh" if error.rule == "missing-file" else error.rule
            rule = "missing-visual" if shape.tag == "visual" and error.rule != "outside-workspace" else missing
            yield document.finding(rule, mesh, str(error))
            continue
        for note in found.notes:
            if (note.rule, note.about) not in told:
                told.add((note.rule, note.about))
                yield document.finding(note.rule, mesh, note.text)
        if shape.tag == "collision":
            # With this flag, the engine lets a moving body fall through the ground.
            shape.attrib.pop("concave", None)
            yield from _rewrite(document, mesh, found.path, clean)
        else:
            visuals[mesh] = found.path


def _rewrite(document: ModelDocument, mesh: Element, path: Path, clean: dict[Element, CleanMesh]) -> Iterator[Finding]:
    # Reading meshes needs numpy, which is slow to import.
    from sim_action.meshes import MeshError, clean_mesh
    from sim_action.meshes.hull_file import hull_file_name  # a usual run does without it

    name, scale = mesh.attrib["filename"], vector(mesh, "scale", (1.0, 1.0, 1.0))
    try:
        copy = clean_mesh(path, cache_folder("meshes"), scale, ENGINE_MARGIN_M)
    except MeshError as error:
        yield document.finding(error.rule, mesh, f"mesh '{name}': {error}")
        return
    if copy.facts.shape in _ODD_SHAPES:
        rule, what = _ODD_SHAPES[copy.facts.shape]
        yield document.finding(rule, mesh, f"mesh '{name}' {what}")
    clean[mesh] = copy
    for rule, what in _odd_sizes(copy.box, scale):
        yield document.finding(rule, mesh, f"mesh '{name}' {what}")
    mesh.attrib.clear()
    mesh.set("filename", hull_file_name(copy.text))


def _odd_sizes(box: Box, scale: Vector3) -> Iterator[tuple[str, str]]:
    """Yield rules that the size of a mesh breaks, with the rest of the message."""
    largest = max(above - below for below, above in zip(*box, strict=True))
    if largest > MAX_PART_SIZE_M:
        yield "absurd-size", f"is {largest:.4g} m large: if it is in millimetres, write {_scale(scale, 1e-3)}"
    elif largest < _MIN_MESH_SIZE_M:
        yield "tiny-mesh", f"is only {largest:.2g} m large: if it is already in metres, write {_scale(scale, 1e3)}"


def _scale(stated: Vector3, factor: float) -> str:
    return f'scale="{" ".join(f"{part * factor:.6g}" for part in stated)}"'

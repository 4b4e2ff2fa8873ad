"""Notes of a replay: the differences between the drawing and the model, with their reasons."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Final

from sim_action.core.wording import escaped_line
from sim_action.recording.replay.pieces import LinkPieces, MeshPiece, Piece
from sim_action.recording.replay.scene_data import MAX_NOTES, MAX_TEXT_LENGTH
from sim_action.recording.replay.shapes import MeshData
from sim_action.world.parts import HullPart
from sim_action.world.scene import Scene

# A mesh with a smaller share of its triangles may look different.
_MUCH: Final = 0.1

_MAX_NAMES: Final = 3


def notes_of(
    scene: Scene, links: LinkPieces, owners: Iterable[Sequence[Piece]], meshes: Mapping[str, MeshData]
) -> tuple[str, ...]:
    """Return the notes of a scene, a sentence each.

    :param links: the pieces of the links, all of which were asked for.
    :param owners: the pieces of all links and bodies.
    :param meshes: those that are drawn.
    """
    found = (*_of_links(scene, links), *_of_hulls(scene), *_of_triangles(owners, meshes))
    return tuple(escaped_line(note)[:MAX_TEXT_LENGTH] for note in found[:MAX_NOTES])


def _of_links(scene: Scene, links: LinkPieces) -> Iterator[str]:
    reasons = [f"{name} {reason}" for name, reason in links.unreadable.items()]
    if not reasons:
        return
    drawn = sum(bool(link.visuals) for link in scene.model.links)
    said = f"{links.replaced} of {drawn} links are drawn as their collision shapes" if links.replaced else "Not drawn"
    yield f"{said}: {_listed(reasons, '; ')}"


def _of_hulls(scene: Scene) -> Iterator[str]:
    names = [
        body.name
        for body in scene.world.objects
        if body.mass is not None and any(isinstance(part, HullPart) for part in scene.parts_of(body))
    ]
    if names:
        yield f"Drawn as convex hulls, which is what collides: {_listed(names, ', ')}"


def _of_triangles(owners: Iterable[Sequence[Piece]], meshes: Mapping[str, MeshData]) -> Iterator[str]:
    surfaces = {id(piece.surface): piece.surface for own in owners for piece in own if isinstance(piece, MeshPiece)}
    stated = sum(surface.stated or len(surface) for surface in surfaces.values())
    kept = sum(len(mesh.triangles) // 3 for mesh in meshes.values())
    if kept < _MUCH * stated:
        yield f"Meshes are drawn with {kept:,} of their {stated:,} triangles"


def _listed(names: Sequence[str], separator: str) -> str:
    more = f"{separator}and {len(names) - _MAX_NAMES} more" if len(names) > _MAX_NAMES else ""
    return separator.join(islice(names, _MAX_NAMES)) + more

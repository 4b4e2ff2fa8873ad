"""What there is to see of a scene: the robot's links, the bodies of the world, the meshes that they share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sim_action.recording.replay import meshes
from sim_action.recording.replay.link_pieces import LinkPieces
from sim_action.recording.replay.meshes import Budget, digest_of, mesh_data, within
from sim_action.recording.replay.models import MOST_LETTERS, BodyData, PatchData, SceneData
from sim_action.recording.replay.pieces import MeshPiece, Piece, of_parts, pose_numbers
from sim_action.recording.replay.shapes import MAX_SHAPES, MeshData, MeshShape, Shape
from sim_action.recording.replay.skeleton import skeleton
from sim_action.sensors.rendering.colours import PALETTE
from sim_action.world import Body, placed
from sim_action.world.scene import Scene


def scenery(scene: Scene, tracks: Sequence[str]) -> SceneData:
    """All of it; `tracks`: names of the bodies that move, in the order of their columns."""
    shelf: dict[str, MeshData] = {}
    pieces, looks = LinkPieces(scene.model), scene.model.links_by_name
    links, numbers = skeleton(scene.model)
    names = {number: name for name, number in numbers.items()}
    drawn = [pieces.of(looks[names[place]]) if place in names else [] for place in range(len(links))]
    robot = _settled(drawn, meshes.ROBOT, shelf)
    bodies = scene.world.objects
    world = _settled([list(_pieces(scene, number)) for number in range(len(bodies))], meshes.WORLD, shelf)
    return SceneData(
        robot=scene.model.name[:MOST_LETTERS],
        links=tuple(link.model_copy(update={"shapes": shapes}) for link, shapes in zip(links, robot, strict=True)),
        bodies=tuple(_body(scene, body, tracks, shapes) for body, shapes in zip(bodies, world, strict=True)),
        patches=tuple(PatchData(**patch.model_dump()) for patch in scene.world.patches),
        meshes=shelf,
    )


def _pieces(scene: Scene, number: int) -> Iterator[Piece]:
    body = scene.world.objects[number]
    yield from of_parts(scene.parts_of(body), body.color or PALETTE[number % len(PALETTE)])


def _body(scene: Scene, body: Body, tracks: Sequence[str], shapes: tuple[Shape, ...]) -> BodyData:
    return BodyData(
        name=body.name,
        pose=pose_numbers(placed(body, scene.parts_of(body))),
        track=tracks.index(body.name) if body.name in tracks else None,
        appears=body.appears,
        shapes=shapes,
    )


def _settled(owners: Sequence[Sequence[Piece]], budget: Budget, shelf: dict[str, MeshData]) -> list[tuple[Shape, ...]]:
    """The shapes of each owner, with its meshes on the shelf; those that come from the same file are one."""
    surfaces = {
        id(piece.surface): piece.surface for pieces in owners for piece in pieces if isinstance(piece, MeshPiece)
    }
    kept = dict(zip(surfaces, map(mesh_data, within(budget, list(surfaces.values()))), strict=True))
    names = {key: digest_of(mesh) for key, mesh in kept.items() if mesh is not None}
    shelf.update({names[key]: mesh for key, mesh in kept.items() if mesh is not None})
    return [tuple(_shapes(pieces, names))[:MAX_SHAPES] for pieces in owners]


def _shapes(pieces: Sequence[Piece], names: dict[int, str]) -> Iterator[Shape]:
    for piece in pieces:
        if not isinstance(piece, MeshPiece):
            yield piece
        elif id(piece.surface) in names:
            yield MeshShape(kind="mesh", mesh=names[id(piece.surface)], pose=piece.pose, color=piece.color)

"""What there is to see of a scene: the robot's links, the bodies of the world, the meshes that they share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sim_action.rendering.appearance import PALETTE
from sim_action.replay import meshes
from sim_action.replay.link_pieces import LinkPieces
from sim_action.replay.meshes import Budget, digest_of, mesh_data, within
from sim_action.replay.models import MOST_LETTERS, BodyData, JointMotion, LinkData, PatchData, SceneData
from sim_action.replay.pieces import MeshPiece, Piece, of_part, pose_numbers
from sim_action.replay.shapes import MAX_SHAPES, MeshData, MeshShape, Shape
from sim_action.robot_model import Joint, RobotModel
from sim_action.scene import Scene
from sim_action.world import Body, placed


def scenery(scene: Scene, tracks: Sequence[str]) -> SceneData:
    """All of it; `tracks`: names of the bodies that move, in the order of their columns. Raises OSError."""
    shelf: dict[str, MeshData] = {}
    links, looks = list(_links(scene.model)), scene.model.links_by_name
    pieces = LinkPieces(scene.model)
    robot = _settled([pieces.of(looks[name]) for name in link_order(scene.model)], meshes.ROBOT, shelf)
    bodies = scene.world.objects
    world = _settled([list(_pieces(scene, number)) for number in range(len(bodies))], meshes.WORLD, shelf)
    return SceneData(
        robot=scene.model.name[:MOST_LETTERS],
        links=tuple(link.model_copy(update={"shapes": shapes}) for link, shapes in zip(links, robot, strict=True)),
        bodies=tuple(_body(scene, body, tracks, shapes) for body, shapes in zip(bodies, world, strict=True)),
        patches=tuple(PatchData(**patch.model_dump()) for patch in scene.world.patches),
        meshes=shelf,
    )


def link_order(model: RobotModel) -> dict[str, Joint | None]:
    """Link name -> the joint that it hangs on; the base first, and parents before their children."""
    hanging: dict[str, list[Joint]] = {}
    for joint in model.joints:
        hanging.setdefault(joint.parent, []).append(joint)
    order: dict[str, Joint | None] = {model.root: None}
    waiting = [model.root]
    for parent in waiting:
        for joint in hanging.get(parent, []):
            if joint.child not in order:
                order[joint.child] = joint
                waiting.append(joint.child)
    return order


def _links(model: RobotModel) -> Iterator[LinkData]:
    """Without what they look like."""
    order = link_order(model)
    numbers = {name: number for number, name in enumerate(order)}
    columns = {joint.name: column for column, joint in enumerate(model.moving_joints)}
    for name, joint in order.items():
        if joint is None:
            yield LinkData(name=name[:MOST_LETTERS])
        else:
            yield _link(joint, numbers[joint.parent], columns.get(joint.name))


def _link(joint: Joint, parent: int, column: int | None) -> LinkData:
    motion = None
    if column is not None:
        motion = JointMotion(
            type="prismatic" if joint.type == "prismatic" else "revolute", axis=joint.axis_xyz, column=column
        )
    return LinkData(name=joint.child[:MOST_LETTERS], parent=parent, origin=pose_numbers(joint.origin), joint=motion)


def _pieces(scene: Scene, number: int) -> Iterator[Piece]:
    body = scene.world.objects[number]
    for part in scene.parts_of(body):
        yield from of_part(part, body.color or PALETTE[number % len(PALETTE)])


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

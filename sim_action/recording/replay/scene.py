"""The scene of a replay: links of the robot and bodies of the world with their shapes, and the meshes they share."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType

from sim_action.core import geometry
from sim_action.core.geometry import ZERO, Pose, Vector3
from sim_action.core.records import dataclass
from sim_action.recording.replay.notes import notes_of
from sim_action.recording.replay.pieces import LinkPieces, MeshPiece, Piece, of_parts, pose_numbers
from sim_action.recording.replay.scene_data import (
    MAX_TEXT_LENGTH,
    BodyData,
    GroundData,
    JointMotion,
    LinkData,
    PatchData,
    SceneData,
)
from sim_action.recording.replay.shapes import MAX_SHAPES, MeshData, MeshShape, Shape
from sim_action.recording.replay.surfaces import (
    ROBOT_BUDGET,
    WORLD_BUDGET,
    Budget,
    digest_of,
    mesh_data,
    within,
)
from sim_action.robot.model.kinematics import SameModel
from sim_action.robot.model.robot_model import Joint, RobotModel
from sim_action.sensors.rendering import PALETTE
from sim_action.world import Body, placed
from sim_action.world.scene import Scene


def scenery(scene: Scene, tracks: Sequence[str]) -> SceneData:
    """Return the scene of a replay; `tracks` names the moving bodies in the order of their columns."""
    return _scenery(_Shown(scene, tuple(tracks)))


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """The part of a scene that a replay shows, as a key of a cache.

    Robot and world are compared by identity, because comparing their contents would be slow.
    """

    scene: Scene
    tracks: tuple[str, ...]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, _Shown) or self.scene.parts or other.scene.parts:
            return self is other
        mine, its = self.scene, other.scene
        return mine.model is its.model and mine.world is its.world and self.tracks == other.tracks

    def __hash__(self) -> int:
        return id(self.scene.model)


# Variations often share robot and world.
@lru_cache(maxsize=1)
def _scenery(shown: _Shown) -> SceneData:
    scene, tracks = shown.scene, shown.tracks
    shelf: dict[str, MeshData] = {}
    pieces, looks = LinkPieces(scene.model), scene.model.links_by_name
    links, numbers = skeleton(scene.model)
    names = {number: name for name, number in numbers.items()}
    drawn = [pieces.of(looks[names[place]]) if place in names else [] for place in range(len(links))]
    robot = _settled(drawn, ROBOT_BUDGET, shelf)
    bodies = scene.world.objects
    solids = [list(_body_pieces(scene, number)) for number in range(len(bodies))]
    world = _settled(solids, WORLD_BUDGET, shelf)
    return SceneData(
        robot=scene.model.name[:MAX_TEXT_LENGTH],
        links=tuple(link.model_copy(update={"shapes": shapes}) for link, shapes in zip(links, robot, strict=True)),
        bodies=tuple(_body_data(scene, body, tracks, shapes) for body, shapes in zip(bodies, world, strict=True)),
        patches=tuple(PatchData(**patch.model_dump()) for patch in scene.world.patches),
        meshes=shelf,
        ground=_ground(scene.model),
        notes=notes_of(scene, pieces, [*drawn, *solids], shelf),
    )


def _ground(model: RobotModel) -> GroundData | None:
    look = None if model.mjcf is None else model.mjcf.floor_look
    return None if look is None else GroundData(color=look.color, checker=look.other, square=look.square)


def _body_pieces(scene: Scene, number: int) -> Iterator[Piece]:
    body = scene.world.objects[number]
    yield from of_parts(scene.parts_of(body), body.color or PALETTE[number % len(PALETTE)])


def _body_data(scene: Scene, body: Body, tracks: Sequence[str], shapes: tuple[Shape, ...]) -> BodyData:
    return BodyData(
        name=body.name,
        pose=pose_numbers(placed(body, scene.parts_of(body))),
        track=tracks.index(body.name) if body.name in tracks else None,
        appears=body.appears,
        shapes=shapes,
    )


def _settled(owners: Sequence[Sequence[Piece]], budget: Budget, shelf: dict[str, MeshData]) -> list[tuple[Shape, ...]]:
    """Return the shapes of each owner, and add their meshes, simplified to the budget, to `shelf` (digest -> mesh)."""
    surfaces = {
        id(piece.surface): piece.surface for pieces in owners for piece in pieces if isinstance(piece, MeshPiece)
    }
    kept = dict(zip(surfaces, map(mesh_data, within(budget, list(surfaces.values()))), strict=True))
    names = {key: digest_of(mesh) for key, mesh in kept.items() if mesh is not None}
    shelf.update({names[key]: mesh for key, mesh in kept.items() if mesh is not None})
    return [tuple(_final_shapes(pieces, names))[:MAX_SHAPES] for pieces in owners]


def _final_shapes(pieces: Sequence[Piece], names: dict[int, str]) -> Iterator[Shape]:
    for piece in pieces:
        if not isinstance(piece, MeshPiece):
            yield piece
        elif id(piece.surface) in names:
            mesh = names[id(piece.surface)]
            yield MeshShape(kind="mesh", mesh=mesh, pose=piece.pose, color=piece.color, opacity=piece.opacity)


def skeleton(model: RobotModel) -> tuple[Sequence[LinkData], Mapping[str, int]]:
    """Return the links without shapes, parents before their children, and link name -> index of its frame.

    A link of MJCF may have several joints in series, with anchors away from its origin. Each further joint gets an
    invisible link in between.
    """
    return _skeleton(SameModel(model))


# A replay asks for it up to three times, and up to 10,000 variations share one model.
@lru_cache(maxsize=4)
def _skeleton(same: SameModel) -> tuple[Sequence[LinkData], Mapping[str, int]]:
    model = same.model
    hanging: dict[str, dict[str, list[Joint]]] = {}
    for joint in model.joints:
        hanging.setdefault(joint.parent, {}).setdefault(joint.child, []).append(joint)
    columns = {joint.name: column for column, joint in enumerate(model.moving_joints)}
    links = [LinkData(name=model.root[:MAX_TEXT_LENGTH])]
    numbers = {model.root: 0}
    waiting = [model.root]
    for parent in waiting:
        for child, joints in hanging.get(parent, {}).items():
            if child not in numbers:
                links += _chain(child, joints, numbers[parent], len(links), columns)
                numbers[child] = len(links) - 1
                waiting.append(child)
    return tuple(links), MappingProxyType(numbers)


def _chain(child: str, joints: Sequence[Joint], parent: int, number: int, columns: Mapping[str, int]) -> list[LinkData]:
    """Return the links from a parent to a child; `number` is the index of the first one."""
    links: list[LinkData] = []
    origin, before = joints[0].origin, ZERO
    for joint in joints:
        at = geometry.compose(origin, Pose(_between(before, joint.anchor_xyz)))
        motion = _motion(joint, columns[joint.name]) if joint.name in columns else None
        links.append(_link_data(child, parent if not links else number + len(links) - 1, at, motion))
        origin, before = Pose(), joint.anchor_xyz
    if before != ZERO:
        links.append(_link_data(child, number + len(links) - 1, Pose(_between(before, ZERO)), None))
    return links


def _link_data(name: str, parent: int, origin: Pose, motion: JointMotion | None) -> LinkData:
    return LinkData(name=name[:MAX_TEXT_LENGTH], parent=parent, origin=pose_numbers(origin), joint=motion)


def _motion(joint: Joint, column: int) -> JointMotion:
    if joint.type == "prismatic":
        return JointMotion(type="prismatic", axis=joint.axis_xyz, column=column)
    return JointMotion(type="revolute", axis=joint.axis_xyz, column=column)


def _between(start: Vector3, end: Vector3) -> Vector3:
    (ax, ay, az), (bx, by, bz) = start, end
    return (bx - ax, by - ay, bz - az)

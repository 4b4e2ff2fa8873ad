"""The scene of a replay: links of the robot and bodies of the world with their shapes, and the meshes they share.

Pieces are shapes whose meshes are not yet simplified to a budget. Notes name the differences between drawing and model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from itertools import islice
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np

from sim_action.core import geometry
from sim_action.core.geometry import ZERO, Pose, Vector3
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line
from sim_action.recording.replay.scene_data import (
    MAX_NOTES,
    MAX_SHAPES,
    MAX_TEXT_LENGTH,
    BodyData,
    BoxShape,
    CapsuleShape,
    CylinderShape,
    EllipsoidShape,
    GroundData,
    JointMotion,
    LinkData,
    MeshData,
    MeshShape,
    PatchData,
    PoseNumbers,
    SceneData,
    Shape,
    numbers,
)
from sim_action.recording.replay.surfaces import (
    ROBOT_BUDGET,
    WORLD_BUDGET,
    Budget,
    Triangles,
    coarse_surface,
    digest_of,
    hull_surface,
    mesh_data,
    within,
)
from sim_action.robot.model.kinematics import SameModel
from sim_action.robot.model.robot_model import Joint, Link, RobotModel, Visual
from sim_action.robot.model.robot_model import Shape as RobotShape
from sim_action.sensors.rendering import PALETTE, ROBOT, Colour
from sim_action.world import Body, placed
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, Part, SpherePart, SurfacePart
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.recording.replay.visual_meshes import VisualMeshes


class LinkPieces:
    """The pieces of a robot's links: their visuals if all can be read, else their collision shapes.

    Pieces from the same mesh file share their surface. `replaced`: the number of links so far whose collision shapes
    are drawn because a mesh cannot be read.
    """

    def __init__(self, model: RobotModel) -> None:
        # A link without visuals is invisible, unless no link has any.
        self._is_drawn = any(link.visuals for link in model.links)
        self._model = model
        self.replaced = 0
        self._scaled: dict[tuple[str, Vector3], Triangles] = {}

    @cached_property
    def _meshes(self) -> VisualMeshes:
        # Robots without meshes do not need the mesh readers.
        from sim_action.recording.replay.visual_meshes import VisualMeshes

        return VisualMeshes(self._model, ROBOT_BUDGET.per_mesh)

    def of(self, link: Link) -> list[Piece]:
        """Return the pieces of a link."""
        if self._is_drawn and not link.visuals:
            return []
        pieces = [self._piece(visual) for visual in link.visuals]
        seen = [piece for piece in pieces if piece is not None]
        if seen and len(seen) == len(pieces):
            return seen
        touched = list(self._touched(link))
        self.replaced += bool(touched and pieces)
        return touched or seen

    @property
    def unreadable(self) -> dict[str, str]:
        """Name of each mesh file so far that is not drawn -> the reason."""
        return self._meshes.unreadable if any(link.has_mesh for link in self._model.links) else {}

    def _piece(self, visual: Visual) -> Piece | None:
        pose, color, opacity = pose_numbers(visual.pose), visual.color or ROBOT, round(visual.opacity, 3)
        if not visual.file:
            x, y, z = visual.size_xyz
            shape = plain_shape(visual.kind, (x / 2, y / 2, z / 2), pose, color)
            return shape if opacity == 1 else shape.model_copy(update={"opacity": opacity})
        surface = self._surface(visual)
        if surface is None:
            return None
        return MeshPiece(surface, pose, visual.color or self._meshes.colour(visual.file) or ROBOT, opacity)

    def _surface(self, visual: Visual) -> Triangles | None:
        key = visual.file, visual.scale
        if key not in self._scaled:
            own = self._meshes.surface(visual.file)
            if own is None:
                return None
            self._scaled[key] = own.scaled(visual.scale)
        return self._scaled[key]

    def _touched(self, link: Link) -> Iterator[Piece]:
        for shape in link.collisions:
            yield from of_robot_shape(shape, ROBOT, self._hulls)

    def _hulls(self, text: bytes) -> Triangles | None:
        return self._meshes.hulls(text)


@dataclass(frozen=True, eq=False)
class MeshPiece:
    """A surface at a pose in the frame of its link or body, before simplification."""

    surface: Triangles
    pose: PoseNumbers
    color: Colour
    opacity: float = 1.0


Piece = Shape | MeshPiece


def pose_numbers(pose: Pose) -> PoseNumbers:
    """Return a pose as rounded numbers for storage."""
    x, y, z = numbers(pose.position_xyz)
    qx, qy, qz, qw = numbers(pose.orientation_xyzw)
    return (x, y, z, qx, qy, qz, qw)


def of_robot_shape(shape: RobotShape, color: Colour, hulls: Callable[[bytes], Triangles | None]) -> Iterator[Piece]:
    """Yield the piece of a collision shape: a solid, its hulls, or else the bounding box; nothing for a plane."""
    (ax, ay, az), (bx, by, bz) = shape.lower_xyz, shape.upper_xyz
    middle = geometry.compose(shape.pose, Pose(((ax + bx) / 2, (ay + by) / 2, (az + bz) / 2)))
    half: Vector3 = ((bx - ax) / 2, (by - ay) / 2, (bz - az) / 2)
    surface = hulls(shape.hulls) if shape.hulls else None
    if surface is not None:
        yield MeshPiece(surface, pose_numbers(shape.pose), color)
    elif shape.kind != "plane":
        yield plain_shape(shape.kind, half, pose_numbers(middle), color)


def plain_shape(kind: str, half: Vector3, pose: PoseNumbers, color: Colour) -> Shape:
    """Return a solid centred in its frame; `half` are its half sizes along the axes in m."""
    x, y, z = numbers(half)
    if kind in {"sphere", "ellipsoid"}:
        return EllipsoidShape(kind="ellipsoid", half=(x, y, z), pose=pose, color=color)
    if kind == "cylinder":
        return CylinderShape(kind="cylinder", radius=x, length=2 * z, pose=pose, color=color)
    if kind == "capsule":
        return CapsuleShape(kind="capsule", radius=x, length=max(0.0, 2 * (z - x)), pose=pose, color=color)
    return BoxShape(kind="box", size=(2 * x, 2 * y, 2 * z), pose=pose, color=color)


def of_parts(parts: Sequence[Part], color: Colour) -> Iterator[Piece]:
    """Yield the pieces of a body of the world."""
    origin = pose_numbers(Pose())
    hulls = [np.array(part.points_xyz) for part in parts if isinstance(part, HullPart)]
    if hulls:
        surface = hull_surface(hulls)
        if surface is not None:
            yield MeshPiece(surface, origin, color)
    for part in parts:
        if not isinstance(part, HullPart):
            yield _of_part(part, origin, color)


def _of_part(
    part: BoxPart | CylinderPart | SpherePart | GridPart | SurfacePart, origin: PoseNumbers, color: Colour
) -> Piece:
    if isinstance(part, BoxPart):
        x, y, z = numbers(part.size_xyz)
        return BoxShape(kind="box", size=(x, y, z), pose=pose_numbers(part.pose), color=color)
    if isinstance(part, CylinderPart):
        return CylinderShape(
            kind="cylinder", radius=part.radius, length=part.height, pose=pose_numbers(part.pose), color=color
        )
    if isinstance(part, SpherePart):
        return EllipsoidShape(kind="ellipsoid", half=(part.radius,) * 3, pose=pose_numbers(part.pose), color=color)
    surface = coarse_surface(part) if isinstance(part, GridPart) else Triangles(part.points_xyz, part.triangles)
    return MeshPiece(surface, origin, color)


def scenery(scene: Scene, tracks: Sequence[str]) -> SceneData:
    """Return the scene of a replay; `tracks` names the moving bodies in the order of their columns."""
    return _scenery(_Shown(scene, tuple(tracks)))


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """The part of a scene that a replay shows, as a key: robot and world by identity, which is fast."""

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
    of_actors = _actor_pieces(scene)
    solids += of_actors.values()
    world = _settled(solids, WORLD_BUDGET, shelf)
    return SceneData(
        robot=scene.model.name[:MAX_TEXT_LENGTH],
        links=tuple(link.model_copy(update={"shapes": shapes}) for link, shapes in zip(links, robot, strict=True)),
        bodies=(
            *(_body_data(scene, body, tracks, shapes) for body, shapes in zip(bodies, world, strict=False)),
            *(
                _link_data_of(name, tracks, shapes)
                for name, shapes in zip(of_actors, world[len(bodies) :], strict=True)
            ),
        ),
        patches=tuple(PatchData(**patch.model_dump(exclude={"appears", "name"})) for patch in scene.world.patches),
        meshes=shelf,
        ground=_ground(scene.model),
        notes=notes_of(scene, pieces, [*drawn, *solids], shelf),
    )


def actor_links(scene: Scene) -> list[str]:
    """Return the links of other robots with a shape, as ROBOT/LINK; in a replay each is a body."""
    links = ((name, link) for name, actor in scene.actors.items() for link in actor.model.links)
    return [f"{name}/{link.name}" for name, link in links if link.visuals or link.collisions]


def _actor_pieces(scene: Scene) -> dict[str, list[Piece]]:
    pieces = {name: LinkPieces(actor.model) for name, actor in scene.actors.items()}
    pieces_by_link = {}
    for full_name in actor_links(scene):
        name, _, link = full_name.partition("/")
        pieces_by_link[full_name] = pieces[name].of(scene.actors[name].model.links_by_name[link])
    return pieces_by_link


def _link_data_of(name: str, tracks: Sequence[str], shapes: tuple[Shape, ...]) -> BodyData:
    track = tracks.index(name) if name in tracks else None
    return BodyData(name=name[:MAX_TEXT_LENGTH], pose=pose_numbers(Pose()), track=track, shapes=shapes)


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
        disappears=body.disappears,
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


_MUCH: Final = 0.1  # a mesh with a smaller share of its triangles may look different
_MAX_NAMES: Final = 3


def notes_of(
    scene: Scene, links: LinkPieces, owners: Iterable[Sequence[Piece]], meshes: Mapping[str, MeshData]
) -> tuple[str, ...]:
    """Return the notes of a scene, a sentence each.

    `links`: the pieces of the links, all of which were asked for; `owners`: the pieces of all links and bodies;
    `meshes`: the drawn meshes.
    """
    notes = (*_of_links(scene, links), *_of_hulls(scene), *_of_triangles(owners, meshes))
    return tuple(escaped_line(note)[:MAX_TEXT_LENGTH] for note in notes[:MAX_NOTES])


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

"""Build a scene in PyBullet, once before the first step: connection, ground, bodies of the world, robot.

A connection has the plane z = 0. It is opened ahead, in use, or released for the next use.

It corrects these properties of PyBullet, as measured: a compound takes 16 shapes and silently drops the rest; each
static body costs time at every step unless it is a plain rigid one; a hull is 1 mm larger than its points; a
heightfield is centred between its lowest and highest sample and folds its cells along the other diagonal than MuJoCo.
"""

from __future__ import annotations

import ctypes
import math
import os
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pybullet

from sim_action.core import geometry
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.records import dataclass, field
from sim_action.robot.audit.joints import beyond_pybullet
from sim_action.robot.model.robot_model import Surface
from sim_action.world import MAX_SPEED, Body, World, placed
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, Part, SpherePart, SurfacePart
from sim_action.world.physics import ground_tiles
from sim_action.world.scene import Scene


class Connection(NamedTuple):
    """The numbers of a DIRECT connection and of the plane z = 0, the only body in it."""

    client: int
    plane: int


_AHEAD: Final[list[Connection]] = []
_RELEASED: Final[list[int]] = []

# Parameters of mallopt(3): how much free memory at the end of the heap goes back to the system, and from which size on
# a block is mapped on its own.
_TRIM_THRESHOLD: Final = -1
_MMAP_THRESHOLD: Final = -3
_MAX_KEPT_BYTES: Final = 32 << 20


def connect_ahead() -> None:
    """Open a connection ahead, for the next use in this process or in processes forked from it.

    Opening one takes as long as simulating a small robot for two seconds, mostly for memory that is hardly written to;
    forked processes share that memory.
    """
    if not _AHEAD:
        _AHEAD.append(_made())


def connected() -> Connection:
    """Return a connection of its own: the one that was opened ahead, one that was released, or a new one."""
    if _AHEAD:
        return _AHEAD.pop()
    client = _RELEASED.pop() if _RELEASED else None
    if client is None or not pybullet.isConnected(client):
        return _made()
    # Its first argument is not the connection.
    pybullet.resetSimulation(physicsClientId=client)
    return _with_plane(client)


def release(client: int) -> None:
    """End the use of a connection; one is kept, because a reset takes a tenth of the time of a new one."""
    if _AHEAD or _RELEASED:
        pybullet.disconnect(client)
    else:
        _keep_free_memory()
        _RELEASED.append(client)


@cache
def _keep_free_memory() -> None:
    """Let the C library keep what a reset frees: to get 14 MB from the system again would take 7 ms for each run."""
    if sys.platform == "linux":
        if (mallopt := getattr(ctypes.CDLL(None), "mallopt", None)) is not None:
            mallopt(_TRIM_THRESHOLD, _MAX_KEPT_BYTES)
            mallopt(_MMAP_THRESHOLD, _MAX_KEPT_BYTES)


def _made() -> Connection:
    return _with_plane(pybullet.connect(pybullet.DIRECT))


def _with_plane(client: int) -> Connection:
    shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    return Connection(client, int(pybullet.createMultiBody(0, shape, look(client), physicsClientId=client)))


def look(client: int) -> int:
    """Return the number of a visual shape that shows nothing; without it, PyBullet draws all shapes in up to 1 ms."""
    return int(pybullet.createVisualShape(pybullet.GEOM_BOX, halfExtents=(0.5, 0.5, 0.5), physicsClientId=client))


BASE: Final = -1  # the number of a body's base link

# Height in m from which a robot is lowered to the ground; no robot reaches further below its base.
_DROP_HEIGHT_M: Final = 100.0
# Bullet's default. The setting outlives a connection, so it is set for each one.
_CONTACT_BREAKING_THRESHOLD: Final = 0.02
# Bullet's defaults, which also outlive a connection.
_RESIDUAL_THRESHOLD: Final = 1e-7
_ITERATIONS: Final = 50
_ISLAND_SIZE: Final = 128
# Cylinders as hulls would ride 1 mm high and cost twice as much. The default inertia comes from the collision shapes.
_LOAD_FLAGS: Final = pybullet.URDF_USE_IMPLICIT_CYLINDER | pybullet.URDF_USE_INERTIA_FROM_FILE
# Without neighbours: PyBullet leaves out direct parents and children.
_SELF_COLLISION: Final = pybullet.URDF_USE_SELF_COLLISION | pybullet.URDF_USE_SELF_COLLISION_EXCLUDE_PARENT
_COLLISION: Final = re.compile(r"<collision[\s/>]")
_LOOK: Final = '<visual><geometry><box size="1 1 1"/></geometry></visual>'  # see `look`: the robot is not shown either
_OPEN_FILES: Final = 8  # PyBullet has fewer files open at the same time while it reads a model


def configure(client: int, rate: float, gravity_xyz: Vector3, *, exact: bool = False, apart: bool = False) -> None:
    """Set gravity, time step and the other parameters of the whole simulation.

    `exact`: the solver uses all its iterations. It otherwise stops early, and the forces on a robot that stands on more
    than three wheels depend on when it stopped. `apart`: the solver takes each group of touching bodies alone, so that
    distant bodies do not matter.
    """
    pybullet.setGravity(*gravity_xyz, client)
    pybullet.setPhysicsEngineParameter(
        solverResidualThreshold=0.0 if exact else _RESIDUAL_THRESHOLD,
        numSolverIterations=_ITERATIONS,
        minimumSolverIslandSize=1 if apart else _ISLAND_SIZE,
        fixedTimeStep=1 / rate,
        contactBreakingThreshold=_CONTACT_BREAKING_THRESHOLD,
        deterministicOverlappingPairs=1,
        # Two bodies collide if each one's mask has the other's group; by default one direction is enough.
        collisionFilterMode=0,
        enableFileCaching=0,
        physicsClientId=client,
    )


def pave(client: int, plane: int, world: World) -> list[int]:
    """Make the plane z = 0 the ground of a world; return the numbers of the tiles that replace it."""
    _set_dynamics(client, plane, BASE, lateralFriction=world.ground.friction)
    tiles = [
        number
        for tile in ground_tiles(world.ground, world.patches)
        for number, _ in add_pieces(client, [tile.part], Pose(), tile.friction)
    ]
    if tiles:
        # Distances to the ground are still measured to the plane, which collides with nothing.
        pybullet.setCollisionFilterGroupMask(plane, BASE, 0, 0, physicsClientId=client)
    return tiles


def add_object(client: int, body: Body, parts: Sequence[Part]) -> list[tuple[int, Pose]]:
    """Add a body at its initial pose; return the number of each of its pieces, with its pose in the body."""
    pose = placed(body, parts)
    moves = bool(body.path or body.surface_velocity)
    if body.has_own_inertia:
        from sim_action.engines.pybullet.rigid_bodies import add_rigid_body  # a usual run does without it

        number, inertial = add_rigid_body(client, body, parts)
        _set_dynamics(client, number, BASE, lateralFriction=body.friction)
        at = geometry.compose(pose, inertial)
        pybullet.resetBasePositionAndOrientation(number, at.position_xyz, at.orientation_xyzw, client)
        return [(number, inertial)]
    return add_pieces(client, parts, pose, body.friction, body.mass or 0.0, moves=moves)


def belt_notes(world: World) -> Iterator[str]:
    """Yield a note on each body with a face that its surface velocity crosses."""
    for body in world.objects:
        if body.surface_velocity is not None and any(body.surface_velocity.linear):
            push = f"in PyBullet, faces of '{body.name}' that its surface_velocity crosses push like moving walls"
            yield f"{push}; with backend: mujoco, only what lies along a face is carried"


def add_pieces(
    client: int, parts: Sequence[Part], pose: Pose, friction: float, mass: float = 0.0, *, moves: bool = False
) -> list[tuple[int, Pose]]:
    """Add the pieces of a body; `pose`: of the body."""
    added = []
    visual = look(client)
    for piece in pieces(client, parts, mass):
        # A full multibody costs time at every step. A plain rigid body does not, but its velocity does not act on
        # what touches it.
        plain = int(len(parts) > 1 and not moves)
        shapes = piece.shape, visual
        number = int(pybullet.createMultiBody(mass, *shapes, useMaximalCoordinates=plain, physicsClientId=client))
        _set_dynamics(client, number, BASE, lateralFriction=friction)
        for name, value in piece.dynamics.items():
            pybullet.changeDynamics(number, BASE, **{name: value}, physicsClientId=client)
        at = geometry.compose(pose, piece.pose)
        pybullet.resetBasePositionAndOrientation(number, at.position_xyz, at.orientation_xyzw, client)
        added.append((number, piece.pose))
    return added


def load_robot(client: int, scene: Scene) -> int:
    """Add the robot at the origin; return its number. Raise OSError or pybullet.error."""
    if (trouble := beyond_pybullet(scene.model)) is not None:
        raise pybullet.error(trouble)
    load = _load_from_files if scene.model.hull_files or sys.platform != "linux" else _load_from_memory
    try:
        return load(client, scene)
    except (OSError, pybullet.error):
        # PyBullet opens each file several times. A lack of open files may have passed by now. The script of another
        # scenario may have removed all scratch folders. A sandbox may lack files in memory.
        Path(tempfile.gettempdir()).mkdir(parents=True, exist_ok=True)
        return _load_from_files(client, scene)


def _load_from_memory(client: int, scene: Scene) -> int:
    """Load the robot as `load_robot` does, once: a folder takes twice the time of the robot itself."""
    if sys.platform != "linux":
        raise OSError("only Linux has files in memory")
    number = os.memfd_create("robot.urdf")
    with open(number, "wb") as file:  # noqa: PTH123 - `Path` opens no file by its number
        file.write(_text(scene))
        file.flush()
        return _loaded(client, Path(f"/proc/self/fd/{number}"), scene)


def _load_from_files(client: int, scene: Scene) -> int:
    """Load the robot as `load_robot` does, once."""
    # PyBullet reads models only from files. It looks for meshes in the folder of the model first.
    with tempfile.TemporaryDirectory(prefix="sim-action-", ignore_cleanup_errors=True) as folder:
        if scene.model.hull_files:
            with ExitStack() as files:
                for _ in range(_OPEN_FILES):
                    files.enter_context(Path(os.devnull).open("rb"))
        for name, text in scene.model.hull_files.items():
            Path(folder, name).write_bytes(text)
        path = Path(folder, "robot.urdf")
        path.write_bytes(_text(scene))
        return _loaded(client, path, scene)


def _text(scene: Scene) -> bytes:
    return _COLLISION.sub(lambda match: _LOOK + match[0], scene.model.urdf).encode()


def _loaded(client: int, path: Path, scene: Scene) -> int:
    """Return the number of the robot in a URDF file. Raise pybullet.error, also if the robot is not complete."""
    flags = _LOAD_FLAGS | (_SELF_COLLISION if scene.robot.self_collision else 0)
    robot = int(pybullet.loadURDF(str(path), useFixedBase=scene.bolted, flags=flags, physicsClientId=client))
    made = _complete_shapes(client, robot)
    expected = len(_COLLISION.findall(scene.model.urdf))
    if made < expected:
        pybullet.removeBody(robot, client)
        raise pybullet.error(
            f"PyBullet made {made} of {expected} collision shapes of the robot; it may lack open files or memory"
        )
    return robot


def _complete_shapes(client: int, robot: int) -> int:
    """Return the number of collision shapes; a mesh whose file could not be opened is left out, or has no points."""
    links = (
        (link, pybullet.getCollisionShapeData(robot, link, client))
        for link in range(BASE, pybullet.getNumJoints(robot, client))
    )
    return sum(len(shapes) - _is_empty_mesh(client, robot, link, shapes) for link, shapes in links)


def _is_empty_mesh(client: int, robot: int, link: int, shapes: Sequence[Any]) -> bool:
    if len(shapes) != 1 or shapes[0][2] != pybullet.GEOM_MESH:
        return False
    return not pybullet.getMeshData(robot, link, physicsClientId=client)[0]


def set_surfaces(client: int, robot: int, surfaces: Mapping[int, Surface]) -> None:
    """Set the contact surface of each link, by its number."""
    for link, surface in surfaces.items():
        soft: dict[str, float] = {}
        if surface.stiffness is not None:
            soft = {"contactStiffness": surface.stiffness, "contactDamping": surface.damping}
        _set_dynamics(client, robot, link, lateralFriction=surface.friction, **soft)


def add_rotor(client: int, robot: int, link: int, axis_xyz: Vector3, inertia: float) -> None:
    """Add the inertia of a motor in kg m^2 to a joint; `axis_xyz`: the joint axis in the frame of its link."""
    dynamics = pybullet.getDynamicsInfo(robot, link, client)
    principal_inertia, principal_axes = dynamics[2], dynamics[4]
    along = geometry.rotate(geometry.conjugate(principal_axes), axis_xyz)
    inertias = [own + inertia * part**2 for own, part in zip(principal_inertia, along, strict=True)]
    pybullet.changeDynamics(robot, link, localInertiaDiagonal=inertias, physicsClientId=client)


def place(client: int, body: int, ground: int, placement: Placement, com_in_link: Pose | None = None) -> None:
    """Move a body's link frame to its placement; without a z, onto the ground."""

    def put(z: float) -> None:
        pose = Pose((placement.x, placement.y, z), placement.orientation_xyzw)
        com = geometry.compose(pose, com_in_link) if com_in_link else pose
        pybullet.resetBasePositionAndOrientation(body, com.position_xyz, com.orientation_xyzw, client)

    put(_DROP_HEIGHT_M if placement.z is None else placement.z)
    if placement.z is None:
        # Bounding boxes are loose for rotated inertial frames; distances are exact.
        points = pybullet.getClosestPoints(body, ground, 2 * _DROP_HEIGHT_M, physicsClientId=client)
        put(_DROP_HEIGHT_M - min((float(point[8]) for point in points), default=_DROP_HEIGHT_M))


def _set_dynamics(client: int, body: int, link: int, **dynamics: float) -> None:
    # By default links have a damping of 0.04 and speeds stop at 100 m/s or rad/s. Other values set in the same call for
    # a link other than the base are silently lost.
    none = {"linearDamping": 0, "angularDamping": 0}
    pybullet.changeDynamics(body, link, **none, maxJointVelocity=MAX_SPEED, physicsClientId=client)
    pybullet.changeDynamics(body, link, physicsClientId=client, **dynamics)


_MAX_COMPOUND_SHAPES: Final = 16
# Margin in m around a hull: without it a third of all rays would pass through.
_MARGIN_M: Final = 1e-5
_ROUND: Final = geometry.quaternion_from_rpy(0.0, 0.0, math.pi / 2)


@dataclass(frozen=True, slots=True)
class Piece:
    """A PyBullet body; a body of the world may consist of several."""

    shape: int  # number of its collision shape
    pose: Pose = field(default_factory=Pose)  # of its centre, in the frame of the body of the world
    dynamics: dict[str, Any] = field(default_factory=dict)  # parameters of `changeDynamics` to set


def pieces(client: int, parts: Sequence[Part], mass: float = 0.0) -> Iterator[Piece]:
    """Create the shapes of a body; a body with a mass has one part."""
    boxes = [part for part in parts if isinstance(part, BoxPart)]
    for first in range(0, len(boxes), _MAX_COMPOUND_SHAPES) if len(boxes) > 1 else ():
        yield Piece(_compound(client, boxes[first : first + _MAX_COMPOUND_SHAPES]))
    for part in parts:
        if not isinstance(part, BoxPart) or len(boxes) == 1:
            yield _piece(client, part, mass)


def _compound(client: int, boxes: Sequence[BoxPart]) -> int:
    return int(
        pybullet.createCollisionShapeArray(
            shapeTypes=[pybullet.GEOM_BOX] * len(boxes),
            halfExtents=[[size / 2 for size in box.size_xyz] for box in boxes],
            collisionFramePositions=[box.pose.position_xyz for box in boxes],
            collisionFrameOrientations=[box.pose.orientation_xyzw for box in boxes],
            physicsClientId=client,
        )
    )


def _piece(client: int, part: Part, mass: float) -> Piece:
    if isinstance(part, HullPart):
        return _hull(client, part, mass)
    if isinstance(part, GridPart):
        return _grid(client, part)
    return Piece(_shape(client, **_properties(part)), Pose() if isinstance(part, SurfacePart) else part.pose)


def _shape(client: int, **properties: Any) -> int:
    return int(pybullet.createCollisionShape(**properties, physicsClientId=client))


def _properties(part: BoxPart | CylinderPart | SpherePart | SurfacePart) -> dict[str, Any]:
    if isinstance(part, BoxPart):
        return {"shapeType": pybullet.GEOM_BOX, "halfExtents": [size / 2 for size in part.size_xyz]}
    if isinstance(part, CylinderPart):
        return {"shapeType": pybullet.GEOM_CYLINDER, "radius": part.radius, "height": part.height}
    if isinstance(part, SpherePart):
        return {"shapeType": pybullet.GEOM_SPHERE, "radius": part.radius}
    return {
        "shapeType": pybullet.GEOM_MESH,
        "vertices": part.points_xyz.tolist(),
        "indices": part.triangles.ravel().tolist(),
        "flags": pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
    }


def _hull(client: int, part: HullPart, mass: float) -> Piece:
    points = np.array(part.points_xyz)
    no_margin = {"collisionMargin": _MARGIN_M}
    if not mass:
        return Piece(_shape(client, shapeType=pybullet.GEOM_MESH, vertices=points.tolist()), Pose(), no_margin)
    # Only a mesh of the world has a mass here; this imports the readers of all mesh formats.
    from sim_action.meshes.convex_hull import mass_properties

    # PyBullet would put the mass at the centre and use the inertia of the bounding box.
    weighs = mass_properties(points)
    moments, axes = np.linalg.eigh(weighs.inertia)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    x, y, z = weighs.centre_xyz.tolist()
    pose = Pose((x, y, z), _turned(axes))
    own = (points - weighs.centre_xyz) @ axes
    shape = _shape(client, shapeType=pybullet.GEOM_MESH, vertices=own.tolist())
    return Piece(shape, pose, {**no_margin, "localInertiaDiagonal": (mass * moments).tolist()})


def _turned(axes: Any) -> geometry.Quaternion:
    eigenvector = np.linalg.eigh(_quaternion_matrix(axes))[1][:, -1]
    x, y, z, w = eigenvector.tolist()
    return (x, y, z, w)


def _quaternion_matrix(m: Any) -> Any:
    """Return the matrix whose greatest eigenvector is the quaternion of a rotation matrix (Bar-Itzhack, 2000)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = m
    rows = [
        [xx - yy - zz, 0, 0, 0],
        [yx + xy, yy - xx - zz, 0, 0],
        [zx + xz, zy + yz, zz - xx - yy, 0],
        [zy - yz, xz - zx, yx - xy, xx + yy + zz],
    ]
    return np.array(rows) / 3


def _grid(client: int, part: GridPart) -> Piece:
    # A quarter turn makes PyBullet fold each cell along the other diagonal.
    heights = np.rot90(part.heights, 1)
    rows, columns = heights.shape
    width, depth = part.size_xy
    shape = _shape(
        client,
        shapeType=pybullet.GEOM_HEIGHTFIELD,
        meshScale=[depth / (columns - 1), width / (rows - 1), 1.0],
        heightfieldData=heights.ravel().tolist(),
        numHeightfieldRows=columns,
        numHeightfieldColumns=rows,
    )
    middle = float(heights.min() + heights.max()) / 2
    return Piece(shape, Pose((0.0, 0.0, middle), _ROUND))

"""Collision shapes as MuJoCo geoms: their names, shapes of a robot, the ground and bodies, and their contact pairs.

MuJoCo collides only with convex pieces and heightfields, and would take the hull of a mesh. A surface that is hollow or
open therefore becomes one thin convex piece behind each triangle. "Behind" follows from the order of the corners, which
is counter-clockwise seen from outside.

The clean meshes of `sim_action.meshes` hold hulls that are shrunk by PyBullet's collision margin. MuJoCo has no such
margin, so they are scaled back to the size of the mesh.

MuJoCo's contacts are softer than Bullet's by design. The parameters here were measured with the burger (a line, a
circle and a spin at 60 to 1000 Hz): contacts that converge faster separate for single steps, and wheels lose grip.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from sim_action.core.geometry import Pose, Quaternion
from sim_action.core.lazy_numpy import FloatArray
from sim_action.robot.model.robot_model import ENGINE_MARGIN_M, Shape, Surface
from sim_action.world import GROUND, Body, World
from sim_action.world.parts import (
    BoxPart,
    CylinderPart,
    GridPart,
    HullPart,
    MassProperties,
    Part,
    SpherePart,
    SurfacePart,
    mass_properties_of,
)
from sim_action.world.physics import ground_tiles
from sim_action.world.scene import Scene


def object_name(name: str) -> str:
    """Return the name of a body of the world in MuJoCo."""
    return f"object/{name}"


def engine_name(name: str) -> str:
    """Return the name of a link or a joint of the robot in MuJoCo."""
    return f"robot/{name}"


_ACTOR: Final = "actor/"


def actor_prefix(actor: str) -> str:
    """Return the prefix of all names of another robot in MuJoCo."""
    return f"{_ACTOR}{actor}/"


def actor_of(name: str) -> str:
    """Return the robot whose part has a name with its prefix; the names of robots have no slash."""
    return name.removeprefix(_ACTOR).partition("/")[0]


def with_user_names(message: str, scene: Scene) -> str:
    """Return a message of MuJoCo as one line, with the user's names of bodies, links and joints."""
    bodies = [(object_name(body.name), body.name) for body in scene.world.objects]
    robots = [("", "", scene), *((actor_prefix(name), f"{name}/", actor) for name, actor in scene.actors.items())]
    parts = [
        (prefix + engine_name(name), said + name)
        for prefix, said, robot in robots
        for name in (*robot.model.links_by_name, *robot.model.joints_by_name)
    ]
    return _renamed(" ".join(message.split()), [*bodies, *parts])


def _renamed(message: str, names: Iterable[tuple[str, str]]) -> str:
    """Replace MuJoCo's names, also of pieces such as "object/wall/0.3", by the user's."""
    user_names = dict(names)
    if not user_names:
        return message
    # A name may be the prefix of another one.
    either = "|".join(map(re.escape, sorted(user_names, key=len, reverse=True)))
    return re.sub(rf"'?({either})(?:/\d+(?:\.\d+)?)?'?(?![\w/])", lambda match: f"'{user_names[match[1]]}'", message)


FRICTION_RATIO: Final = 100.0  # ratio of friction to normal impedance, so high that robots do not creep down slopes
CONTACT_IMPEDANCE: Final = 0.9  # impedance of a contact: the share of a force that it resists

# Time constant of a contact in s and in steps.
_TIME_CONSTANT_S: Final = 0.01
_TIME_CONSTANT_STEPS: Final = 2.5
# Number of contacts that carry a body at rest; its weight then presses none of them in.
_CONTACTS: Final = 4
_MIN_FRICTION: Final = 1e-5
# Limits of MuJoCo.
_MIN_IMPEDANCE: Final = 1e-4
_MAX_IMPEDANCE: Final = 0.9999


class Collider(NamedTuple):
    """A geom that can touch others."""

    geom: str
    part: str  # name of its link or of its body of the world
    surface: Surface
    moves: bool = True
    # contype, conaffinity: the bits by which MJCF selects the geoms of a robot that may touch each other
    contype: int = 1
    conaffinity: int = 1


def pair_name(one: Collider, other: Collider) -> str:
    """Return the name of the contact pair of two geoms of the robot."""
    return f"self {one.geom} {other.geom}"


def add_pairs(
    spec: Any,
    rate: float,
    gravity: float,
    robot: Sequence[Collider],
    world: Sequence[Collider],
    *,
    own: Iterable[tuple[Collider, Collider]] = (),
) -> dict[str, Surface]:
    """Add a contact pair for all geoms except two of the robot or two static ones; return the soft pairs.

    `gravity`: m/s^2, which determines the weight on a contact. The soft pairs are the input of `soften`. `own`: pairs
    of geoms of the robot that collide.
    """
    # A map has thousands of static parts, which need no pairs among themselves.
    moving, fixed = (
        [collider for collider in world if collider.moves],
        [collider for collider in world if not collider.moves],
    )
    apart = ((one, other) for one, other in itertools.combinations(moving, 2) if one.part != other.part)
    among_others = (*apart, *itertools.product(moving, fixed))
    pairs = [(str(number), *pair) for number, pair in enumerate((*itertools.product(robot, world), *among_others))]
    pairs += [(pair_name(*pair), *pair) for pair in own]
    soft: dict[str, Surface] = {}
    hard = _hard(rate, gravity)
    for name, one, other in pairs:
        surface = _combined(one.surface, other.surface)
        names = {"name": name, "geomname1": one.geom, "geomname2": other.geom}
        dimensions, frictions = _frictions(surface)
        pair = spec.add_pair(**names, condim=dimensions, friction=frictions, **hard)
        if surface.adhesion:
            pair.adhesion, pair.gap = surface.adhesion, surface.gap
        if surface.stiffness:
            soft[name] = surface
    return soft


def soften(model: Any, rate: float, soft: Mapping[str, Surface]) -> None:
    """Turn the contacts that state a stiffness into springs, by Bullet's equations (ODE's manual, on ERP and CFM).

    For a stiffness k, a damping c and a time step h, a contact of depth x takes a force f in a step so that its speed
    afterwards is v + f / (h k + c) = k x / (h k + c). MuJoCo's constraint has the same form, with its compliance as a
    share of the bodies' own inverse inertia. A spring that would separate bodies faster than a hard contact stays hard.
    """
    for name, surface in soft.items():
        # MuJoCo sorts the pairs.
        number = model.pair(name).id
        bodies = [model.geom_bodyid[geoms[number]] for geoms in (model.pair_geom1, model.pair_geom2)]
        gives_way = sum(float(model.body_invweight0[body, 0]) for body in bodies)
        assert surface.stiffness is not None
        held = surface.stiffness / rate + surface.damping
        if surface.stiffness / held >= 1 / (2 * CONTACT_IMPEDANCE * _time(rate)):
            continue
        share = gives_way / (gives_way + rate / held)
        share = min(max(share, _MIN_IMPEDANCE), _MAX_IMPEDANCE)
        model.pair_margin[number] = 0.0
        model.pair_solimp[number, :2] = share
        model.pair_solref[number] = -share * rate * surface.stiffness / held, -share * rate


def _frictions(surface: Surface) -> tuple[int, list[float]]:
    """Return the dimensions of a contact and its coefficients: two of sliding, one of spinning, and two of rolling."""
    sliding, spinning, rolling = surface.friction, surface.spinning, surface.rolling
    # MuJoCo rejects a coefficient of 0.
    dimensions = 6 if rolling else 4 if spinning else 3
    if dimensions > 3:
        sliding, spinning = max(sliding, _MIN_FRICTION), max(spinning, _MIN_FRICTION)
    return dimensions if sliding > 0 else 1, [sliding, sliding, spinning, rolling, rolling]


def _combined(one: Surface, other: Surface) -> Surface:
    """Combine two surfaces as PyBullet does: frictions multiply, springs are in series; adhesions add, as in MuJoCo."""
    stated = [surface for surface in (one, other) if surface.stiffness]
    stiffness = 1 / sum(1 / (surface.stiffness or 1.0) for surface in stated) if stated else None
    damping = sum(surface.damping for surface in stated)
    # MuJoCo's default is the greater of the two coefficients.
    spinning, rolling = (
        mine * other.friction + its * one.friction
        for mine, its in ((one.spinning, other.spinning), (one.rolling, other.rolling))
    )
    adhesion, gap = one.adhesion + other.adhesion, max(one.gap, other.gap)
    return Surface(one.friction * other.friction, stiffness, damping, rolling, spinning, adhesion, gap)


def _time(rate: float) -> float:
    return max(_TIME_CONSTANT_S, _TIME_CONSTANT_STEPS / rate)


def _hard(rate: float, gravity: float) -> dict[str, Any]:
    """Return the parameters of the hardest contact that does not separate, with a margin that carries the weight."""
    time = _time(rate)
    depth = gravity * time**2 * (1 - CONTACT_IMPEDANCE) / CONTACT_IMPEDANCE**2
    return {
        "solref": [time, 1.0],
        "solimp": [CONTACT_IMPEDANCE, CONTACT_IMPEDANCE, 0.001, 0.5, 2.0],
        "margin": depth / _CONTACTS,
    }


GEOM: Final = mujoco.mjtGeom


def wxyz(orientation: Quaternion) -> list[float]:
    """Return a quaternion in MuJoCo's order."""
    x, y, z, w = orientation
    return [w, x, y, z]


def add_collision(spec: Any, body: Any, name: str, shape: Shape) -> Iterator[str]:
    """Add a shape of a link to a body; yield the names of its geoms, one per hull of a mesh."""
    if not shape.hulls:
        yield add_geom(body, name, shape.pose, **_primitive(shape))
        return
    for number, mesh in enumerate(_meshes(spec, shape.hulls)):
        yield add_geom(body, f"{name}.{number}", shape.pose, type=GEOM.mjGEOM_MESH, meshname=mesh)


def add_geom(body: Any, name: str, pose: Pose, **properties: Any) -> str:
    """Add a geom without a mass that collides only in contact pairs; return its name."""
    passive = {"contype": 0, "conaffinity": 0, "mass": 0.0}
    place = {"pos": list(pose.position_xyz), "quat": wxyz(pose.orientation_xyzw)}
    body.add_geom(name=name, **passive | place | properties)
    return name


def lowest_geom(model: Any, data: Any, geoms: Sequence[int]) -> float | None:
    """Return the z in m of the lowest point of geoms, world frame; None without geoms."""
    return min((_lowest(model, data, geom) for geom in geoms), default=None)


def _primitive(shape: Shape) -> dict[str, Any]:
    radius, half_length = shape.radius or 0.0, (shape.length or 0.0) / 2
    sizes: dict[str, tuple[Any, list[float]]] = {
        "box": (GEOM.mjGEOM_BOX, list(shape.upper_xyz)),
        "sphere": (GEOM.mjGEOM_SPHERE, [radius, 0, 0]),
        "cylinder": (GEOM.mjGEOM_CYLINDER, [radius, half_length, 0]),
        "capsule": (GEOM.mjGEOM_CAPSULE, [radius, half_length, 0]),
    }
    kind, size = sizes[shape.kind]
    return {"type": kind, "size": size}


def _meshes(spec: Any, hulls: bytes) -> list[str]:
    """Return the mesh names of hulls, which are added only once; `hulls`: as in `Shape`."""
    from sim_action.meshes.collision_hulls import hull_file_name  # most robots of a short run have no meshes

    name = hull_file_name(hulls)
    existing = [mesh.name for mesh in spec.meshes if mesh.name.rpartition("#")[0] == name]
    if existing:
        return existing
    names = []
    for number, points in enumerate(read_unshrunk_hulls(hulls)):
        names.append(f"{name}#{number}")
        # Links state their masses; "shell" avoids computing the volume of thin hulls.
        shell = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        spec.add_mesh(name=names[-1], uservert=points.ravel().tolist(), inertia=shell)
    return names


def _lowest(model: Any, data: Any, geom: int) -> float:
    z = float(data.geom_xpos[geom, 2])
    down = np.abs(data.geom_xmat[geom][6:9])
    a, b, c = model.geom_size[geom]
    kind = model.geom_type[geom]
    if kind == GEOM.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        points: FloatArray = model.mesh_vert[first : first + count].astype(np.float64)
        return z + float((points * data.geom_xmat[geom][6:9]).sum(axis=1).min())
    if kind == GEOM.mjGEOM_BOX:
        return z - float(down[0] * a + down[1] * b + down[2] * c)
    if kind == GEOM.mjGEOM_ELLIPSOID:
        return z - float(np.sqrt(((down * (a, b, c)) ** 2).sum()))
    if kind == GEOM.mjGEOM_CYLINDER:
        return z - float(down[2] * b + a * np.hypot(down[0], down[1]))
    # Capsule: the half length adds along its axis; sphere: the radius alone.
    return z - float(a + (down[2] * b if kind == GEOM.mjGEOM_CAPSULE else 0.0))


_FLAT: Final = 1e-6  # relative extent below which Qhull finds no volume


def read_unshrunk_hulls(text: bytes) -> list[FloatArray]:
    """Return the points (P, 3) in m of each hull of a clean mesh, at the size of the mesh."""
    from sim_action.meshes.collision_hulls import read_unshrunk_points  # most worlds have no meshes

    return [thickened(points) for points in read_unshrunk_points(text, ENGINE_MARGIN_M)]


def thickened(points: FloatArray) -> FloatArray:
    """Return the points; a hull without a volume gets the thickness of PyBullet's margin."""
    centred = points - points.mean(axis=0)
    squares, axes = np.linalg.eigh(centred.T @ centred)
    for square, axis in zip(squares, axes.T, strict=True):
        if square <= (_FLAT * max(np.abs(centred).max(), ENGINE_MARGIN_M)) ** 2:
            points = np.concatenate((points - ENGINE_MARGIN_M * axis, points + ENGINE_MARGIN_M * axis))
    return points


MAX_TRIANGLES: Final = 20_000
"""Limit for all surfaces of a body: each triangle is tested with each shape of the robot at every step."""

# Thickness in m of a heightfield below its lowest sample, and the least range of its heights.
_BASE: Final = 0.1
_MIN_RANGE: Final = 1e-9


def add_ground(spec: Any, world: World) -> Iterator[Collider]:
    """Add the plane z = 0, or the tiles that replace it; yield their colliders."""
    tiles = ground_tiles(world.ground, world.patches)
    if not tiles:
        name = add_geom(spec.worldbody, GROUND, Pose(), type=GEOM.mjGEOM_PLANE, size=[0, 0, 1])
        yield Collider(name, GROUND, Surface(world.ground.friction), moves=False)
    for number, tile in enumerate(tiles):
        for name in _add_part(spec, spec.worldbody, f"{GROUND}/{number}", tile.part, 0.0):
            yield Collider(name, GROUND, Surface(tile.friction), moves=False)


def add_object(spec: Any, body: Body, parts: Sequence[Part]) -> Iterator[Collider]:
    """Add a body at the origin; yield its colliders. Raises ValueError if MuJoCo cannot simulate the shape."""
    added = spec.worldbody.add_body(name=object_name(body.name))
    if body.mass is not None:
        added.add_freejoint(align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE)
    triangles = sum(len(part.triangles) for part in parts if isinstance(part, SurfacePart))
    if triangles > MAX_TRIANGLES:
        raise ValueError(
            f"'{body.name}' is not convex and has {triangles:,} triangles; MuJoCo needs a convex piece for each, "
            f"and at most {MAX_TRIANGLES:,} are simulated: simplify the mesh, or use backend: pybullet"
        )
    mass = body.mass or 0.0
    if body.has_own_inertia:
        weigh(added, mass_properties_of(body, parts))
        mass = 0.0
    for number, part in enumerate(parts):
        for name in _add_part(spec, added, f"{object_name(body.name)}/{number}", part, mass):
            yield Collider(name, body.name, Surface(body.friction), moves=body.mass is not None)


def weigh(body: Any, properties: MassProperties) -> None:
    """Give a body its mass properties."""
    body.explicitinertial = True
    body.mass = properties.mass
    body.ipos = list(properties.centre_xyz)
    body.fullinertia = properties.inertia[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)].tolist()


def _add_part(spec: Any, body: Any, name: str, part: Part, mass: float) -> Iterator[str]:
    if isinstance(part, SurfacePart):
        for number, points in enumerate(triangle_prisms(part.points_xyz, part.triangles)):
            yield _add_hull(spec, body, f"{name}.{number}", points, 0.0)
    elif isinstance(part, HullPart):
        yield _add_hull(spec, body, name, np.array(part.points_xyz), mass)
    elif isinstance(part, GridPart):
        yield _add_grid(spec, body, name, part)
    else:
        yield add_geom(body, name, part.pose, **_properties(part), mass=mass)


def _properties(part: BoxPart | CylinderPart | SpherePart) -> dict[str, Any]:
    if isinstance(part, BoxPart):
        return {"type": GEOM.mjGEOM_BOX, "size": [size / 2 for size in part.size_xyz]}
    if isinstance(part, CylinderPart):
        return {"type": GEOM.mjGEOM_CYLINDER, "size": [part.radius, part.height / 2, 0]}
    return {"type": GEOM.mjGEOM_SPHERE, "size": [part.radius, 0, 0]}


def _add_hull(spec: Any, body: Any, name: str, points: Any, mass: float) -> str:
    inertia = mujoco.mjtMeshInertia
    # "shell" avoids computing the volume of a hull without a mass.
    kind = inertia.mjMESH_INERTIA_CONVEX if mass else inertia.mjMESH_INERTIA_SHELL
    # MuJoCo stores points as 32-bit floats, so they are given about their centre; the origin may be 50 m away.
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    spec.add_mesh(name=name, uservert=(points - middle).ravel().tolist(), inertia=kind)
    x, y, z = middle.tolist()
    return add_geom(body, name, Pose((x, y, z)), type=GEOM.mjGEOM_MESH, meshname=name, mass=mass)


def _add_grid(spec: Any, body: Any, name: str, part: GridPart) -> str:
    low = float(part.heights.min())
    range_ = max(float(part.heights.max()) - low, _MIN_RANGE)
    rows, columns = part.heights.shape
    width, depth = part.size_xy
    heights = ((part.heights - low) / range_).ravel().tolist()
    size = [width / 2, depth / 2, range_, _BASE]
    spec.add_hfield(name=name, nrow=rows, ncol=columns, size=size, userdata=heights)
    return add_geom(body, name, Pose((0.0, 0.0, low)), type=GEOM.mjGEOM_HFIELD, hfieldname=name)


MAX_THICKNESS_M: Final = 0.005
"""Thickness in m of a piece, less for small triangles: the distance per step of a body at 1.2 m/s."""


def triangle_prisms(points_xyz: FloatArray, triangles: np.ndarray) -> Iterator[FloatArray]:
    """Yield the corners (6, 3) of the piece behind each triangle: the triangle, and a smaller one behind it.

    The piece tapers, so that it does not stick out of a neighbour unless their edge is sharper than 45 degrees.
    """
    corners = points_xyz[triangles]
    a, b, c = (corners[:, corner] for corner in range(3))
    normals = np.cross(b - a, c - a)
    doubled_area = np.linalg.norm(normals, axis=1)
    normals /= doubled_area[:, None]
    sides = np.stack([np.linalg.norm(q - p, axis=1) for p, q in ((b, c), (c, a), (a, b))], axis=1)
    around = sides.sum(axis=1)
    # The inscribed circle shrinks evenly as all sides move inwards.
    radii = doubled_area / around
    middles = (corners * sides[:, :, None]).sum(axis=1) / around[:, None]
    depths = np.minimum(MAX_THICKNESS_M, radii / 2)
    shrunk = middles[:, None] + (corners - middles[:, None]) * (1 - depths / radii)[:, None, None]
    return iter(np.concatenate((corners, shrunk - (depths[:, None] * normals)[:, None]), axis=1))

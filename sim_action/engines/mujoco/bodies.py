"""The ground and the bodies of the world as geoms, part by part.

The engine collides with convex pieces and heightfields alone: of a mesh it would take the hull. So a surface that is
hollow or open becomes pieces of its own, one behind each triangle.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import mujoco
import numpy as np

from sim_action.core.geometry import Pose
from sim_action.engines.mujoco.shapes import GEOM, add_geom
from sim_action.engines.mujoco.touch import Skin
from sim_action.engines.mujoco.triangles import behind
from sim_action.engines.mujoco.wording import object_name
from sim_action.robot.robot_model import Surface
from sim_action.world import GROUND, Body, World
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, Part, SpherePart, SurfacePart
from sim_action.world.tiles import ground_tiles

MAX_TRIANGLES: Final = 4_000
"""Of all surfaces of a body: each is looked at for each shape of the robot, at every step."""

# m: how thick a heightfield is below its lowest sample, and how far apart its heights are at the least.
_BASE: Final = 0.1
_LEAST_RANGE: Final = 1e-9


def add_ground(spec: Any, world: World) -> Iterator[Skin]:
    """Adds the plane z = 0, or the tiles that take its place; returns what can touch the robot."""
    tiles = ground_tiles(world.ground, world.patches)
    if not tiles:
        name = add_geom(spec.worldbody, GROUND, Pose(), type=GEOM.mjGEOM_PLANE, size=[0, 0, 1])
        yield Skin(name, GROUND, Surface(world.ground.friction), moves=False)
    for number, tile in enumerate(tiles):
        for name in _add_part(spec, spec.worldbody, f"{GROUND}/{number}", tile.part, 0.0):
            yield Skin(name, GROUND, Surface(tile.friction), moves=False)


def add_object(spec: Any, body: Body, parts: Sequence[Part]) -> Iterator[Skin]:
    """Adds a body at the origin; returns what can touch something. Raises ValueError for what the engine lacks."""
    added = spec.worldbody.add_body(name=object_name(body.name))
    if body.mass is not None:
        added.add_freejoint(align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE)
    triangles = sum(len(part.triangles) for part in parts if isinstance(part, SurfacePart))
    if triangles > MAX_TRIANGLES:
        raise ValueError(
            f"'{body.name}' is not convex and has {triangles:,} triangles; MuJoCo knows convex pieces alone, "
            f"so each is one, and at most {MAX_TRIANGLES:,} are simulated: simplify it, or say backend: pybullet"
        )
    for number, part in enumerate(parts):
        for name in _add_part(spec, added, f"{object_name(body.name)}/{number}", part, body.mass or 0.0):
            yield Skin(name, body.name, Surface(body.friction), moves=body.mass is not None)


def _add_part(spec: Any, body: Any, name: str, part: Part, mass: float) -> Iterator[str]:
    if isinstance(part, SurfacePart):
        for number, points in enumerate(behind(part.points_xyz, part.triangles)):
            yield _add_hull(spec, body, f"{name}.{number}", points, 0.0)
    elif isinstance(part, HullPart):
        yield _add_hull(spec, body, name, np.array(part.points_xyz), mass)
    elif isinstance(part, GridPart):
        yield _add_grid(spec, body, name, part)
    else:
        pose = part.pose if isinstance(part, BoxPart) else Pose()
        yield add_geom(body, name, pose, **_properties(part), mass=mass)


def _properties(part: BoxPart | CylinderPart | SpherePart) -> dict[str, Any]:
    if isinstance(part, BoxPart):
        return {"type": GEOM.mjGEOM_BOX, "size": [size / 2 for size in part.size_xyz]}
    if isinstance(part, CylinderPart):
        return {"type": GEOM.mjGEOM_CYLINDER, "size": [part.radius, part.height / 2, 0]}
    return {"type": GEOM.mjGEOM_SPHERE, "size": [part.radius, 0, 0]}


def _add_hull(spec: Any, body: Any, name: str, points: Any, mass: float) -> str:
    inertia = mujoco.mjtMeshInertia
    # "shell" spares the compiler the volume of what weighs nothing.
    kind = inertia.mjMESH_INERTIA_CONVEX if mass else inertia.mjMESH_INERTIA_SHELL
    # The engine keeps points as 32-bit floats: about their middle, not about an origin that may be 50 m away.
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    spec.add_mesh(name=name, uservert=(points - middle).ravel().tolist(), inertia=kind)
    x, y, z = middle.tolist()
    return add_geom(body, name, Pose((x, y, z)), type=GEOM.mjGEOM_MESH, meshname=name, mass=mass)


def _add_grid(spec: Any, body: Any, name: str, part: GridPart) -> str:
    low = float(part.heights.min())
    range_ = max(float(part.heights.max()) - low, _LEAST_RANGE)
    rows, columns = part.heights.shape
    width, depth = part.size_xy
    heights = ((part.heights - low) / range_).ravel().tolist()
    size = [width / 2, depth / 2, range_, _BASE]
    spec.add_hfield(name=name, nrow=rows, ncol=columns, size=size, userdata=heights)
    return add_geom(body, name, Pose((0.0, 0.0, low)), type=GEOM.mjGEOM_HFIELD, hfieldname=name)

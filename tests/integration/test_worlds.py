"""What stands still: ramps, stairs, meshes, heightfields, maps, patches and gravity, on every engine."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Vector3
from sim_action.meshes.convex_hull import mass_properties
from sim_action.world import GRAVITY, Body, Heightfield, MeshFile, OccupancyMap, Patch, Ramp, Stairs, World
from sim_action.world.parts import HullPart
from tests.integration.engines import (
    BALL,
    CRATE,
    advance,
    at,
    on_every_engine,
    one_link,
    push,
    running,
    scene_of,
    travelled,
)
from tests.worlds import with_files, write_map

pytestmark = on_every_engine
SMALL_BALL = one_link('<sphere radius="0.05"/>', moment=0.001)
CUBE = one_link('<box size="0.1 0.1 0.1"/>', moment=0.002)


def resting(engine: str, folder: Path, world: World, urdf: str, steps: int = 960, **pose: float) -> Vector3:
    scene = with_files(scene_of(folder, urdf, at(**pose), world))
    x, y, z = travelled(engine, scene, steps).base_position_xyz[-1].tolist()
    return (x, y, z)


def test_gravity_may_point_anywhere_or_be_none(engine: str, tmp_path: Path) -> None:
    for gravity in ((1.0, -2.0, 3.0), 0.0):
        scene = scene_of(tmp_path, BALL, at(z=10), World.model_validate({"gravity": gravity}))
        trace = travelled(engine, scene, 240)
        assert trace.base_linear_xyz[-1] == pytest.approx(gravity or (0, 0, 0), abs=1e-6)


def test_a_ramp_turns_with_its_pose_and_begins_at_the_ground(engine: str, tmp_path: Path) -> None:
    ramp = Body(name="ramp", ramp=Ramp(length=2, width=1, height=1), pose=Placement(yaw=math.pi / 2), friction=0.0)
    x, y, z = resting(engine, tmp_path, World(objects=(ramp,)), SMALL_BALL, 240, y=0.5, z=1.2)
    assert (x, z) == pytest.approx((0, 0.05), abs=0.02)
    assert y < -1


def test_each_step_of_stairs_is_as_high_as_it_says(engine: str, tmp_path: Path) -> None:
    stairs = Body(name="stairs", stairs=Stairs(steps=20, rise=0.1, run=0.3, width=1), pose=Placement(x=3))
    for step in (0, 7, 16, 19):
        x, z = 0.15 + 0.3 * step, 0.1 * step
        found = resting(engine, tmp_path, World(objects=(stairs,)), CUBE, 480, x=x, z=z + 0.2)
        assert found == pytest.approx((x, 0, z + 0.15), abs=2e-3)


def test_a_body_of_many_parts_has_one_name(engine: str, tmp_path: Path) -> None:
    stairs = Body(name="stairs", stairs=Stairs(steps=40, rise=0.1, run=0.3, width=1), pose=Placement(x=6))
    scene = scene_of(tmp_path, SMALL_BALL, at(x=11.55, z=3.9 + 0.05), World(objects=(stairs,)))
    with running(engine, scene, contacts=True) as backend:
        trace = advance(backend, 0, 60)
        inside = {contact.body for contact in backend.observe(60, contacts=True).contacts}
    assert {contact.body for contact in trace.contacts} == inside == {"stairs"}


HILLS = [[0.3, 0.3, 0.3, 0.3, 0.3], [0.3, 0.1, 0.0, 0.2, 0.3], [0.3, 0.1, 0.0, 0.1, 0.3], [0.3, 0.3, 0.3, 0.3, 0.3]]


HILLY = World(objects=(Body(name="hills", heightfield=Heightfield(heights=tuple(map(tuple, HILLS)), size=(4.0, 3.0))),))


@pytest.mark.parametrize(("x", "y"), [(-2 + 1e-3, 0.5), (0.5, -0.5), (0.3, 1.2), (1.6, 0.2), (-0.7, 0.31)])
def test_heights_are_where_the_rows_say_and_straight_between(engine: str, x: float, y: float, tmp_path: Path) -> None:
    scene = with_files(scene_of(tmp_path, SMALL_BALL, at(x=50), HILLY))
    with running(engine, scene) as backend:
        share = backend.cast_rays((x, y, 2.0), np.array([[x, y, -2.0]]))[0]
    assert 2 - 4 * share == pytest.approx(height_of_hills(x, y), abs=2e-4)


def height_of_hills(x: float, y: float) -> float:
    """Over triangles, each cell folded from its lowest x and y to its highest."""
    column, row = x + 2, y + 1.5
    i, j = int(column), int(row)
    u, v = column - i, row - j
    (a, b), (d, c) = (HILLS[3 - (j + up)][i : i + 2] for up in (0, 1))
    return a + u * (b - a) + v * (c - b) if u >= v else a + v * (d - a) + u * (c - d)


def test_a_box_rests_on_a_flat_heightfield_at_its_height(engine: str, tmp_path: Path) -> None:
    flat = Heightfield(heights=((0.5,) * 4,) * 4, size=(4, 4))
    world = World(objects=(Body(name="plateau", heightfield=flat, pose=Placement(z=0)),))
    found = resting(engine, tmp_path, world, CUBE, 480, x=0.2, y=0.1, z=0.6)
    # MuJoCo lets it sink by 1 mm into a heightfield.
    assert found[2] == pytest.approx(0.55, abs=1.2e-3)


def bowl(folder: Path) -> MeshFile:
    """A box without a lid, 2 x 2 x 0.5 m, walls without a thickness: its hull would be full."""
    corners = [(x, y, z) for z in (0, 50) for x, y in ((-100, -100), (100, -100), (100, 100), (-100, 100))]
    quads = [(0, 1, 2, 3), *((n, n + 4, (n + 1) % 4 + 4, (n + 1) % 4) for n in range(4))]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    vertices = [[f"vertex {x} {y} {z}" for x, y, z in (corners[point] for point in face)] for face in faces]
    lines = [f"facet normal 0 0 0 outer loop {' '.join(three)} endloop endfacet" for three in vertices]
    (folder / "bowl.stl").write_text("solid bowl\n" + "\n".join(lines) + "\nendsolid bowl\n")
    return MeshFile(file="bowl.stl", scale=0.01)


def test_a_hollow_mesh_is_hollow(engine: str, tmp_path: Path) -> None:
    world = World(objects=(Body(name="bowl", mesh=bowl(tmp_path), pose=Placement(x=5, z=0.2)),))
    found = resting(engine, tmp_path, world, SMALL_BALL, 480, x=5.3, y=0.2, z=0.6)
    assert found == pytest.approx((5.3, 0.2, 0.25), abs=2e-3)


def test_a_mesh_may_have_thin_triangles_far_from_its_origin(engine: str, tmp_path: Path) -> None:
    """A floor with a needle of 1 um at its rim, 100 m away from where the file has its origin."""
    floor = ["99 -1 0", "101 -1 0", "101 1 0", "99 1 0", "101.000001 0 0"]
    text = "".join(f"v {point}\n" for point in floor) + "f 1 2 3\nf 1 3 4\nf 2 5 3\n"
    (tmp_path / "floor.obj").write_text(text)
    world = World(objects=(Body(name="floor", mesh=MeshFile(file="floor.obj"), pose=Placement(x=-100, z=0.2)),))
    assert resting(engine, tmp_path, world, SMALL_BALL, 480, z=0.3)[2] == pytest.approx(0.25, abs=1e-3)


def test_the_walls_of_a_hollow_mesh_stop_from_inside(engine: str, tmp_path: Path) -> None:
    world = World(objects=(Body(name="bowl", mesh=bowl(tmp_path), friction=0.0),))
    scene = with_files(scene_of(tmp_path, SMALL_BALL, at(z=0.06), world))
    with running(engine, scene, contacts=True) as backend:
        advance(backend, 0, 60)
        push(backend, (1.0, 0.3, 0))
        trace = advance(backend, 60, 480)
    assert trace.base_position_xyz[:, 0].max() == pytest.approx(0.95, abs=0.01)
    assert {contact.body for contact in trace.contacts} == {"bowl"}


def wedge_mesh(folder: Path) -> MeshFile:
    (folder / "wedge.obj").write_text(
        "v 0 0 0\nv 3 0 0\nv 3 0 3\nv 0 1 0\nv 3 1 0\nv 3 1 3\n"
        "f 1 2 3\nf 4 6 5\nf 1 4 5\nf 1 5 2\nf 2 5 6\nf 2 6 3\nf 1 3 6\nf 1 6 4\n"
    )
    return MeshFile(file="wedge.obj", scale=0.1)


def test_a_mesh_with_a_mass_is_its_hull_and_weighs_where_that_is(engine: str, tmp_path: Path) -> None:
    # On a knife edge below its centre of mass, at 2/3 of its length, it stays; at the middle of its box it does not.
    for x, stays in ((0.2, True), (0.15, False)):
        edge = Body(name="edge", box=(0.01, 0.4, 0.1), pose=Placement(x=x, y=0.05))
        wedge = Body(name="wedge", mesh=wedge_mesh(tmp_path), mass=2.0, pose=Placement(z=0.1001), friction=1.0)
        scene = with_files(scene_of(tmp_path, SMALL_BALL, at(x=5), World(objects=(edge, wedge))))
        with running(engine, scene) as backend:
            advance(backend, 0, 240)
            pose = backend.body_pose("wedge")
        tilt = abs(pose.orientation_xyzw[1])
        assert (tilt < 0.02) == stays, (x, pose)


def test_a_mesh_with_a_mass_is_as_inert_as_its_hull_is_filled_evenly(engine: str, tmp_path: Path) -> None:
    wedge = Body(name="wedge", mesh=wedge_mesh(tmp_path), mass=2.0)
    scene = with_files(scene_of(tmp_path, SMALL_BALL, at(x=5), World(objects=(wedge,))))
    (part,) = scene.parts["wedge"]
    assert isinstance(part, HullPart)
    expected = sorted(np.linalg.eigvalsh(2 * mass_properties(np.array(part.points_xyz)).inertia))
    with running(engine, scene) as backend:
        assert sorted(moments_of(backend, "wedge")) == pytest.approx(expected, rel=1e-6)


def moments_of(backend: Any, body: str) -> list[float]:
    if backend.version.startswith("mujoco"):
        model = backend._contacts._model
        return list(model.body_inertia[model.body(f"object/{body}").id])
    import pybullet

    return list(pybullet.getDynamicsInfo(backend._objects[body][0][0], -1, backend._client)[2])


ROOM = np.full((40, 60), 254, np.uint8)
ROOM[[0, -1], :] = ROOM[:, [0, -1]] = 0
ROOM[10, 20:30] = 0
ROOM[25:30, 45] = 205  # unknown


@pytest.mark.parametrize(
    ("way", "stop"),
    [((1, 0), 60 - 1), ((-1, 0), 1), ((0, 1), 40 - 11), ((0, -1), 1)],
    ids=["right", "left", "up", "down"],
)
def test_walls_are_where_the_map_says(engine: str, way: tuple[int, int], stop: int, tmp_path: Path) -> None:
    name = write_map(tmp_path, ROOM, origin=[-1.0, -0.5, 0.0])
    walls = Body(name="walls", map=OccupancyMap(file=name, height=0.4), friction=0.0)
    scene = with_files(scene_of(tmp_path, SMALL_BALL, at(x=0, y=0), World(objects=(walls,)), rate=1000))
    trace = travelled(engine, scene, 1500, start=((2.0 * way[0], 2.0 * way[1], 0),), contacts=True)
    touch = trace.contacts[0]
    axis = 0 if way[0] else 1
    assert touch.body == "walls"
    assert touch.position_xyz[axis] == pytest.approx(stop * 0.05 + (-1.0, -0.5)[axis], abs=5e-3)


def test_a_map_is_turned_by_its_origin_and_ends_at_its_height(engine: str, tmp_path: Path) -> None:
    name = write_map(tmp_path, ROOM, origin=[1.0, 2.0, math.pi / 2])
    walls = Body(name="walls", map=OccupancyMap(file=name, height=0.4))
    # The cell in row 10 from the top and column 25, seen from the lower left corner, which the map turns about.
    across, up = 25.5 * 0.05, (40 - 10.5) * 0.05
    found = resting(engine, tmp_path, World(objects=(walls,)), CUBE, 240, x=1 - up, y=2 + across, z=0.5)
    assert found[2] == pytest.approx(0.45, abs=2e-3)


LEGS = [{"x": x, "y": y, "z": 0.35} for x in (-0.45, 0.45) for y in (-0.25, 0.25)]
TABLE = {
    "name": "table",
    "shapes": (
        {"box": (1.0, 0.6, 0.04), "pose": {"z": 0.72}},
        *({"cylinder": {"radius": 0.03, "height": 0.7}, "pose": leg} for leg in LEGS),
    ),
}


def test_a_heavy_body_of_several_shapes_stands_on_its_legs(engine: str, tmp_path: Path) -> None:
    table = Body.model_validate({**TABLE, "mass": 4.0, "pose": {"x": 2.0, "z": 0.02, "roll": 0.02}})
    with running(engine, scene_of(tmp_path, BALL, at(x=-3), World(objects=(table,)))) as backend:
        advance(backend, 0, 240)
        assert backend.body_pose("table").position_xyz == pytest.approx((2.0, 0.0, 0.0), abs=2e-3)


def test_stated_inertia_and_centre_of_mass_count(engine: str, tmp_path: Path) -> None:
    inertia = {"ixx": 0.4, "iyy": 0.4, "izz": 0.5}
    stated = {"mass": 2.0, "center_of_mass": (0.3, 0.0, 0.0), "inertia": inertia, "pose": {"z": 1.0}}
    turned = {"body": "table", "at": 0.0, "for": 0.5, "torque": (0.0, 0.0, 1.0)}
    world = {"gravity": 0.0, "objects": ({**TABLE, **stated},), "disturbances": (turned,)}
    with running(engine, scene_of(tmp_path, BALL, at(x=-3), World.model_validate(world), rate=1000)) as backend:
        advance(backend, 0, 500)
        pose = backend.body_pose("table")
    # The angle of a constant torque, about the centre of mass, which stays where it is.
    angle = 1.0 / 0.5 * 0.5**2 / 2
    assert pose.yaw == pytest.approx(angle, rel=0.01)
    assert pose.position_xyz == pytest.approx((0.3 - 0.3 * math.cos(angle), -0.3 * math.sin(angle), 1.0), abs=1e-3)


def slippery(friction: float) -> str:
    return CRATE.replace("<collision>", f'<contact><lateral_friction value="{friction}"/></contact><collision>')


def stopping(engine: str, folder: Path, world: World, urdf: str, speed: float, **pose: float) -> float:
    """How far a crate slides in x."""
    with running(engine, scene_of(folder, urdf, at(**pose), world, rate=1000)) as backend:
        start = advance(backend, 0, 100).base_position_xyz[-1, 0]
        push(backend, (speed, 0, 0))
        trace = advance(backend, 100, 6000)
    assert trace.speed[-1] < 2e-3
    assert abs(trace.base_position_xyz[-1, 1]) < 0.02
    return float(trace.base_position_xyz[-1, 0] - start)


ICE = World(patches=(Patch(x=2, size=(4, 2), friction=0.1), Patch(x=2, y=2, size=(4, 2), friction=3.0)))


@pytest.mark.parametrize(("x", "friction"), [(1.0, 0.1), (-4.0, 1.0)], ids=["on the patch", "off it"])
def test_a_crate_stops_as_the_friction_of_where_it_is_says(
    engine: str, x: float, friction: float, tmp_path: Path
) -> None:
    found = stopping(engine, tmp_path, ICE, slippery(0.5), 1.0, x=x)
    assert found == pytest.approx(1 / (2 * friction * 0.5 * GRAVITY), rel=0.02)


@pytest.mark.parametrize(("speed", "x"), [(0.5, -1.15), (2.0, -0.7)])
def test_the_edge_of_a_patch_is_no_step(engine: str, speed: float, x: float, tmp_path: Path) -> None:
    # The same friction on both sides of the edge at x = 0, which the slow one comes to with 0.1 mm a step.
    world = World(patches=(Patch(x=2, size=(4, 2), friction=1.0),))
    friction = speed**2 / (2 * GRAVITY * 1.0)
    found = stopping(engine, tmp_path, world, slippery(friction), speed, x=x)
    assert found == pytest.approx(1.0, rel=0.03)


def test_a_patch_is_ground_to_contacts_and_no_deeper(engine: str, tmp_path: Path) -> None:
    scene = scene_of(tmp_path, BALL, at(x=1.0), ICE)
    with running(engine, scene, contacts=True) as backend:
        assert all(overlap.depth < 1e-4 for overlap in backend.overlaps())
        trace = advance(backend, 0, 240)
        found = backend.observe(240, contacts=True)
    assert {contact.body for contact in found.contacts} == {"ground"}
    assert trace.contacts == ()
    assert found.pose.position_xyz[2] == pytest.approx(0.1, abs=1e-4)

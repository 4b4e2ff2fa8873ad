"""What there is to see: links where the joints put them, every kind of body, looks before collision shapes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.core.records import replace
from sim_action.recording.replay import scene_data
from sim_action.recording.replay.scenery import scenery
from sim_action.recording.replay.surfaces import Budget
from sim_action.scenario.loading import build_scene
from sim_action.world import World
from sim_action.world.parts import BoxPart
from tests.mesh_files import HALF, ball, obj, stl
from tests.outcomes import like
from tests.scenarios import LEAST, load
from tests.traces import scene

ROBOT = """\
<robot name="drawn">
  <material name="red"><color rgba="1 0 0 0.5"/></material>
  <link name="base">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="1 1 1"/></geometry></collision>
    {base}
  </link>
  <link name="hand">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.5"/></geometry></collision>
    {hand}
  </link>
  <joint name="arm" type="prismatic">
    <parent link="base"/><child link="hand"/><origin xyz="0 0 2"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/>
  </joint>
</robot>
"""
MESH = '<visual><geometry><mesh filename="box.stl" scale="2 2 2"/></geometry>{material}</visual>'
BOX = '<visual><origin xyz="0 0 1"/><geometry><box size="0.1 0.2 0.3"/></geometry>{material}</visual>'
RED = '<material name="red"/>'
BLUE = '<material name="paint"><color rgba="0 0 1 1"/></material>'


def seen(folder: Path, base: str = "", hand: str = "") -> scene_data.SceneData:
    (folder / "robot.urdf").write_text(ROBOT.format(base=base, hand=hand))
    (folder / "box.stl").write_bytes(stl())
    text = LEAST.replace("turtlebot3_burger", "robot.urdf").partition("commands")[0]
    text += "expect: [upright]\nduration: 1 s\ntime_limit: 1 s\n"
    return scenery(build_scene(load(folder, text)), [])


def extents(mesh: scene_data.MeshData) -> list[float]:
    points, _ = mesh.decoded()
    found: list[float] = (np.ptp(points, axis=0) * mesh.scale).tolist()
    return found


def test_the_burger_is_there_with_its_wheels() -> None:
    found = scenery(scene(), [])
    links = {link.name: link for link in found.links}
    assert found.robot == "turtlebot3_burger"
    assert found.links[0] == links["base_footprint"]
    left = links["wheel_left_link"]
    assert (left.parent, left.origin[:3]) == (0, (0.0, 0.08, 0.033))
    assert left.joint is not None
    assert (left.joint.type, left.joint.axis, left.joint.column) == ("revolute", (0.0, 1.0, 0.0), 0)
    assert links["base_scan"].joint is None
    assert [link.parent for link in found.links[1:]] == [0] * 4
    assert all(link.shapes for link in found.links)


def test_bodies_of_a_scene() -> None:
    # Scenes of one robot and world are drawn once.
    here = scene()
    there = replace(here, robot=like(here.robot, pose=Placement(x=2.0, yaw=1.0)))
    assert scenery(there, ["ball"]) is scenery(here, ["ball"])
    assert scenery(here, []) != scenery(here, ["ball"])
    assert len(scenery(replace(here, world=World()), []).bodies) == 0
    renamed = replace(here, model=replace(here.model, name="another"))
    assert scenery(renamed, []).robot == "another"
    # Bodies whose shapes were read from files are drawn anew.
    of_files = replace(scene(), parts={"wall": (BoxPart((1.0, 1.0, 1.0)),)})
    assert scenery(of_files, []) is not scenery(of_files, [])
    # Bodies are where they begin.
    wall, ball, _ = scenery(scene(), ["ball"]).bodies
    assert (wall.name, wall.track, wall.pose) == ("wall", None, (0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 1.0))
    assert (ball.name, ball.track, ball.pose[2]) == ("ball", 0, 0.1)
    (shape,) = ball.shapes
    assert isinstance(shape, scene_data.EllipsoidShape)
    assert shape.half == (0.1, 0.1, 0.1)


def test_links_with_and_without_looks(tmp_path: Path) -> None:
    # What a model draws is what is seen.
    base, hand = seen(tmp_path, BOX.format(material=RED), BOX.format(material=BLUE)).links
    for link, color in ((base, (1.0, 0.0, 0.0)), (hand, (0.0, 0.0, 1.0))):
        (shape,) = link.shapes
        assert isinstance(shape, scene_data.BoxShape)
        assert (shape.size, shape.color, shape.pose[:3]) == ((0.1, 0.2, 0.3), color, (0.0, 0.0, 1.0))
    assert [link.shapes[0].opacity for link in (base, hand)] == [0.5, 1.0]
    assert hand.joint is not None
    assert (hand.joint.type, hand.origin[2]) == ("prismatic", 2.0)
    # Without looks it is what can be touched.
    base, hand = seen(tmp_path).links
    assert [shape.kind for shape in (*base.shapes, *hand.shapes)] == ["box", "ellipsoid"]
    # A link that is not drawn on a robot that is cannot be seen.
    base, hand = seen(tmp_path, BOX.format(material="")).links
    assert (len(base.shapes), len(hand.shapes)) == (1, 0)


def test_meshes_and_their_colours(tmp_path: Path) -> None:
    # Meshes of one file are one.
    found = seen(tmp_path, MESH.format(material=RED), MESH.format(material=BLUE))
    shapes = [shape for link in found.links for shape in link.shapes]
    assert all(isinstance(shape, scene_data.MeshShape) for shape in shapes)
    assert len({shape.color for shape in shapes}) == 2
    assert sorted(shape.opacity for shape in shapes) == [0.5, 1.0]
    (mesh,) = found.meshes.values()
    assert extents(mesh) == pytest.approx([4 * half for half in HALF], abs=2e-3)
    assert len(mesh.triangles) == 3 * 12
    # A mesh without a material in the model has the colour of its file.
    (tmp_path / "box.obj").write_bytes(b"mtllib box.mtl\nusemtl paint\n" + obj())
    (tmp_path / "box.mtl").write_bytes(b"newmtl paint\nKd 0 0.5 1\n")
    text = MESH.replace("box.stl", "box.obj")
    stated, own = (
        link.shapes[0].color for link in seen(tmp_path, text.format(material=RED), text.format(material="")).links
    )
    assert (stated, own) == ((1, 0, 0), (0, 0.5, 1))
    # A colour that is none is grey.
    odd = BOX.format(material='<material name="x"><color rgba="1 nan"/></material>')
    (shape,) = seen(tmp_path, odd).links[0].shapes
    assert shape.color == (0.8, 0.8, 0.8)


@pytest.mark.parametrize("data", [b"solid nothing", b"", b"\x00" * 84])
def test_a_mesh_that_cannot_be_read_leaves_what_can_be_touched(data: bytes, tmp_path: Path) -> None:
    seen(tmp_path, MESH.format(material=""))
    (tmp_path / "box.stl").write_bytes(data)
    found = scenery(build_scene(load(tmp_path, (tmp_path / "s.sim.yml").read_text())), [])
    (shape,) = found.links[0].shapes
    assert isinstance(shape, scene_data.BoxShape)
    assert found.meshes == {}


@pytest.mark.parametrize(
    "shape", ['<box size="0 1 1"/>', '<box size="1 1"/>', '<sphere radius="x"/>', '<cylinder radius="1"/>']
)
def test_a_look_that_is_none_is_passed_over(shape: str, tmp_path: Path) -> None:
    odd = f"<visual><geometry>{shape}</geometry></visual>"
    found = seen(tmp_path, odd + BOX.format(material=""))
    assert len(found.links[0].shapes) == 1


WORLD = """\
name: everything
robot: {model: turtlebot3_burger}
world:
  patches: [{x: 5, size: [1, 2], friction: 0.1}]
  objects:
    - {name: box, box: [1, 2, 3], pose: {x: 9}, color: [1, 0, 0]}
    - {name: cylinder, cylinder: {radius: 1, height: 2}, pose: {x: 9}}
    - {name: ramp, ramp: {length: 2, width: 1, height: 0.5}, pose: {x: 9}}
    - {name: stairs, stairs: {steps: 4, rise: 0.1, run: 0.2, width: 1}, pose: {x: 9}}
    - {name: mesh, mesh: {file: box.stl}, pose: {x: 9}}
    - {name: hull, mesh: {file: box.stl}, mass: 1, pose: {x: 9}}
    - {name: hills, heightfield: {heights: [[0, 0, 0], [0, 1, 0]], size: [4, 2]}, pose: {x: 9}}
    - {name: map, map: {file: map.yaml}, pose: {x: 9}}
expect: [upright]
duration: 1 s
time_limit: 1 s
"""


def test_every_kind_of_body_is_seen(tmp_path: Path) -> None:
    (tmp_path / "box.stl").write_bytes(stl())
    (tmp_path / "map.pgm").write_bytes(b"P2\n4 3\n255\n0 255 255 255\n0 255 255 255\n255 255 255 255\n")
    (tmp_path / "map.yaml").write_text("image: map.pgm\nresolution: 0.5\norigin: [0, 0, 0]\n")
    found = scenery(build_scene(load(tmp_path, WORLD)), [])
    shapes = {body.name: body.shapes for body in found.bodies}
    assert shapes["box"][0].color == (1.0, 0.0, 0.0)
    assert isinstance(shapes["cylinder"][0], scene_data.CylinderShape)
    assert [shape.kind for shape in shapes["stairs"]] == ["box"] * 4
    assert shapes["map"][0].kind == "box"
    sizes = {}
    for name in ("ramp", "mesh", "hull", "hills"):
        (shape,) = shapes[name]
        assert isinstance(shape, scene_data.MeshShape)
        sizes[name] = extents(found.meshes[shape.mesh])
    assert sizes["ramp"] == pytest.approx([2, 1, 0.5], abs=5e-3)
    assert sizes["mesh"] == sizes["hull"] == pytest.approx([2 * half for half in HALF], abs=2e-3)
    assert sizes["hills"] == pytest.approx([4, 2, 1], abs=1e-2)
    assert found.patches[0].size == (1.0, 2.0)
    hull, mesh = shapes["hull"][0], shapes["mesh"][0]
    assert isinstance(hull, scene_data.MeshShape)
    assert isinstance(mesh, scene_data.MeshShape)
    assert len(found.meshes[hull.mesh].triangles) == len(found.meshes[mesh.mesh].triangles) == 36


def test_meshes_that_collide_are_seen_as_their_hulls(tmp_path: Path) -> None:
    seen(tmp_path)
    touched = ROBOT.replace('<box size="1 1 1"/>', '<mesh filename="box.stl"/>').format(base="", hand="")
    (tmp_path / "robot.urdf").write_text(touched)
    for _ in range(2):  # found, and found again
        found = scenery(build_scene(load(tmp_path, (tmp_path / "s.sim.yml").read_text())), [])
        (shape,) = found.links[0].shapes
        assert isinstance(shape, scene_data.MeshShape)
        # The engine puts a margin of 1 mm around.
        assert extents(found.meshes[shape.mesh]) == pytest.approx([2 * half - 0.002 for half in HALF], abs=2e-3)


def notes(folder: Path) -> tuple[str, ...]:
    return scenery(build_scene(load(folder, (folder / "s.sim.yml").read_text())), []).notes


def test_meshes_that_cannot_be_read_have_the_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert seen(tmp_path, MESH.format(material=""), BOX.format(material="")).notes == ()
    seen(tmp_path, MESH.format(material=""), BOX.format(material=""))
    (tmp_path / "box.stl").write_bytes(b"")
    (note,) = notes(tmp_path)
    assert note.startswith("1 of 2 links are drawn as their collision shapes: box.stl ")
    assert len(note) > len("1 of 2 links are drawn as their collision shapes: box.stl ")
    # A file that is too large is named.
    monkeypatch.setattr("sim_action.recording.replay.visual_meshes._MAX_BYTES", 100)
    found = seen(tmp_path, MESH.format(material=""))
    assert "box.stl has 0 MB; meshes are drawn up to 0 MB" in found.notes[0]


def test_a_body_with_a_mass_is_its_convex_hull(tmp_path: Path) -> None:
    seen(tmp_path)
    scenario = tmp_path / "s.sim.yml"
    world = "world: {objects: [{name: crate, mesh: {file: box.stl}, mass: 1, pose: {x: 9}}]}\n"
    scenario.write_text(world + scenario.read_text())
    assert notes(tmp_path) == ("Drawn as convex hulls, which is what collides: crate",)


def test_meshes_that_lose_most_of_their_triangles_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen(tmp_path, MESH.format(material=""))
    (tmp_path / "box.stl").write_bytes(stl(*ball()))
    assert notes(tmp_path) == ()
    monkeypatch.setattr("sim_action.recording.replay.scenery.ROBOT_BUDGET", Budget(2_400, 100))
    (note,) = notes(tmp_path)
    assert re.fullmatch(r"Meshes are drawn with \d\d of their 1,516 triangles", note)

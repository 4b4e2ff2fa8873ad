"""What collides is what is seen."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.geometry import Pose
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_model import Link, RobotModel, Shape
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.sensors.rendering import PALETTE, ROBOT
from sim_action.sensors.rendering.appearance import Part, robot_parts, world_parts
from sim_action.sensors.rendering.solids import Capsule, Cylinder, Ellipsoid, Polyhedron
from sim_action.world import Body, Physics, Sphere, World
from sim_action.world.scene import Scene
from tests.mesh_files import obj

BODY = """\
<robot name="it"><link name="body">
  <inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><geometry><sphere radius="9"/></geometry></visual>
  <collision><origin xyz="1 2 3"/><geometry>{}</geometry></collision>
</link></robot>
"""


NO_ROBOT = RobotModel("it", "it.urdf", (), (), urdf="")


def only_part(folder: Path, shape: str) -> Part:
    (folder / "box.obj").write_bytes(obj())
    (folder / "it.urdf").write_text(BODY.format(shape))
    (part,) = robot_parts(read_urdf(folder / "it.urdf"))
    assert (part.owner, part.pose, part.colour) == ("body", Pose((1, 2, 3)), ROBOT)
    return part


@pytest.mark.parametrize(
    ("shape", "solid"),
    [
        ('<sphere radius="0.3"/>', Ellipsoid((0.3, 0.3, 0.3))),
        ('<cylinder radius="0.25" length="1"/>', Cylinder(0.25, 0.5)),
        ('<capsule radius="0.25" length="1"/>', Capsule(0.25, 0.5)),
    ],
)
def test_links_look_as_they_collide(shape: str, solid: object, tmp_path: Path) -> None:
    assert only_part(tmp_path, shape).solid == solid


@pytest.mark.parametrize("shape", ['<box size="0.2 0.4 0.6"/>', '<mesh filename="box.obj"/>'])
def test_a_box_looks_the_same_as_a_mesh_of_it(shape: str, tmp_path: Path) -> None:
    solid = only_part(tmp_path, shape).solid
    assert isinstance(solid, Polyhedron)
    planes = {(*normal, round(offset, 9)) for normal, offset in zip(solid.normals, solid.offsets, strict=True)}
    assert planes == {(1, 0, 0, 0.1), (-1, 0, 0, 0.1), (0, 1, 0, 0.2), (0, -1, 0, 0.2), (0, 0, 1, 0.3), (0, 0, -1, 0.3)}


def test_other_shapes_are_seen_as_boxes_and_planes_not_at_all() -> None:
    shapes = [Shape(kind, Pose((1, 0, 0)), upper_xyz=(2.0, 4.0, 6.0)) for kind in ("mesh", "plane")]
    (part,) = robot_parts(RobotModel("it", "it.xml", (Link("body", 1.0, tuple(shapes)),), (), urdf=""))
    assert part.pose.position_xyz == (2, 2, 3)
    assert isinstance(part.solid, Polyhedron)
    assert part.solid.offsets.tolist() == [1, 2, 3, 1, 2, 3]


def test_bodies_have_their_own_colour_or_one_of_a_row() -> None:
    bodies = [Body(name=f"b{number}", sphere=Sphere(radius=1)) for number in range(8)]
    bodies[1] = Body(name="red", sphere=Sphere(radius=1), color=(1, 0, 0))
    world, here = World(objects=tuple(bodies)), Workspace(Path(), Path())
    parts = list(world_parts(Scene(Robot(model="it"), NO_ROBOT, world, Physics(), here)))
    assert [part.colour for part in parts[:3]] == [PALETTE[0], (1, 0, 0), PALETTE[2]]
    assert parts[6].colour == PALETTE[0]
    assert [part.owner for part in parts[:2]] == ["b0", "red"]


def test_nothing_is_red_that_was_not_meant_to_be() -> None:
    assert [colour for colour in (ROBOT, *PALETTE) if colour[0] > 1.5 * max(colour[1:])] == []

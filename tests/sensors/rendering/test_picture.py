"""What is drawn: the nearest, in its colour, within the bounds of the camera."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_model import Link, RobotModel, Shape
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.sensors.rendering import GROUND, PALETTE, ROBOT, SKY
from sim_action.sensors.rendering.picture import Part, Placed, draw, robot_parts, world_parts
from sim_action.sensors.rendering.solids import Capsule, Cylinder, Ellipsoid, Pinhole, Polyhedron
from sim_action.world import Body, Physics, Sphere, World
from sim_action.world.scene import Scene
from tests.mesh_files import obj

EYE = Pose((0, 0, 1))
PINHOLE = Pinhole(width=64, height=48, field_of_view=math.radians(60), near=0.1, far=8.0)
RED = (1.0, 0.0, 0.0)
GREEN = (0.0, 1.0, 0.0)


def ball(x: float, colour: tuple[float, float, float] = RED, radius: float = 0.3, y: float = 0.0) -> Placed:
    return Placed(Ellipsoid((radius,) * 3), Pose((x, y, 1)), colour)


def test_an_empty_world_is_ground_and_sky() -> None:
    picture = draw(PINHOLE, EYE, [])
    sky = np.array([round(255 * part) for part in SKY])
    assert (picture.rgb[:24] == sky).all()
    assert np.isinf(picture.depth[:24]).all()
    below = 1 / -PINHOLE.up[24:, 0]
    seen = below <= PINHOLE.far
    assert picture.depth[24:][seen] == pytest.approx(np.repeat(below[seen, None], 64, axis=1), rel=1e-6)
    assert np.isinf(picture.depth[24:][~seen]).all()
    assert len(np.unique(picture.rgb[24:][seen].reshape(-1, 3), axis=0)) == len(GROUND)
    for array in (picture.rgb, picture.depth):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    # From below the ground, it is not there.
    assert np.isinf(draw(PINHOLE, Pose((0, 0, -1)), []).depth).all()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_what_is_nearer_hides_what_is_behind(order: tuple[int, int]) -> None:
    both = ball(2.0), ball(5.0, GREEN, radius=1.5)
    picture = draw(PINHOLE, EYE, [both[number] for number in order])
    red, green, _ = np.moveaxis(picture.rgb, 2, 0)
    assert red[24, 32] > 0 == green[24, 32]
    assert picture.depth[24, 32] == pytest.approx(1.7, abs=1e-3)
    assert green[24, 16] > 0 == red[24, 16]


def test_light_falls_from_above_and_does_not_turn_with_what_it_falls_on() -> None:
    red = draw(PINHOLE, EYE, [ball(2.0, radius=0.5)]).rgb[..., 0]
    assert red[16, 32] > 1.2 * red[32, 32] > 0
    still = draw(PINHOLE, EYE, [ball(2.0)])
    for turn in (0.0, 1.0, 3.0):
        turned = Placed(Ellipsoid((0.3,) * 3), Pose((2, 0, 1), quaternion_from_rpy(turn, turn, turn)), RED)
        picture = draw(PINHOLE, EYE, [turned])
        assert np.abs(picture.rgb.astype(int) - still.rgb).max() <= 1


def test_what_is_around_the_camera_or_beyond_its_bounds_is_not_seen() -> None:
    nothing = draw(PINHOLE, EYE, []).rgb
    around = Placed(Polyhedron.box((0.5, 0.5, 0.5)), EYE, RED)
    for unseen in (around, ball(0.35), ball(8.5), ball(-2.0), ball(2.0, y=4.0)):
        assert np.array_equal(draw(PINHOLE, EYE, [unseen]).rgb, nothing)


def test_a_camera_that_is_nowhere_sees_the_sky() -> None:
    nowhere = Pose((math.nan,) * 3, (math.nan,) * 4)
    for picture in (draw(PINHOLE, nowhere, [ball(2.0)]), draw(PINHOLE, EYE, [Placed(ball(2.0).solid, nowhere, RED)])):
        assert np.isinf(picture.depth[:24]).all()


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
    # Nothing is red that was not meant to be.
    assert [colour for colour in (ROBOT, *PALETTE) if colour[0] > 1.5 * max(colour[1:])] == []

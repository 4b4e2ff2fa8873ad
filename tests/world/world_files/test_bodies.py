"""Bodies from Gazebo's models, and the losses of each."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sim_action.core.errors import RefusedModel
from sim_action.core.workspace import Workspace
from sim_action.robot.documents.packages import Packages
from sim_action.world import Body, Inertia, Sphere
from sim_action.world.parts import GridPart, HullPart, SurfacePart, grid_surface
from sim_action.world.world_files import WorldFile, read_world_file
from sim_action.world.world_files.world_bodies import MAX_TRIANGLES, simplified
from tests.mesh_files import dae
from tests.ros_workspace import written

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
# Two tetrahedra that meet in a corner.
CONCAVE = f"{TETRAHEDRON}v -1 0 0\nv 0 -1 0\nv 0 0 -1\nf 1 5 6\nf 1 7 5\nf 1 6 7\nf 5 7 6\n"


def shaped(geometry: str, *, more: str = "", static: bool = True) -> str:
    collision = f"<collision name='c'><geometry>{geometry}</geometry>{more}</collision>"
    return f"<model name='m'><static>{static}</static><link name='l'>{collision}</link></model>"


def world_file(folder: Path, inside: str, version: str = "1.9") -> WorldFile:
    path = folder / "a.world"
    path.write_text(f'<?xml version="1.0"?>\n<sdf version="{version}">\n<world name="w">\n{inside}\n</world></sdf>')
    return read_world_file(path, Packages(Workspace(folder, folder), environment={}), lambda _: False)


def read(text: str, folder: Path) -> tuple[list[Body], list[str]]:
    found = world_file(folder, text)
    return list(found.world.objects), [loss.message for loss in found.losses if not loss.is_remark]


@pytest.mark.parametrize(
    "uri", ["model://rock/meshes/rock.obj", "rock/meshes/rock.obj", "file://{folder}/rock/meshes/rock.obj"]
)
@pytest.mark.parametrize(("scale", "factor"), [("2 2 2", 2.0), ("1 2 3", (1.0, 2.0, 3.0))])
def test_a_mesh_collides(uri: str, scale: str, factor: object, tmp_path: Path) -> None:
    written(tmp_path / "rock/meshes/rock.obj", TETRAHEDRON)
    written(tmp_path / "rock/model.config", "<model><name>rock</name></model>")
    stated = uri.format(folder=tmp_path)
    found = world_file(tmp_path, shaped(f"<mesh><uri>{stated}</uri><scale>{scale}</scale></mesh>"))
    (body,) = found.world.objects
    assert body.mesh is not None
    assert (body.mesh.file, body.mesh.scale) == (str(tmp_path / "rock/meshes/rock.obj"), factor)
    (hull,) = found.parts["m"]
    assert isinstance(hull, HullPart)
    assert max(z for _, _, z in hull.points_xyz) == pytest.approx(float(scale.split()[2]))
    assert found.losses == ()


@pytest.mark.parametrize(
    ("inside", "file", "message"),
    [
        ("<uri>model://no/none.obj</uri>", TETRAHEDRON, "was not found; it is left out"),
        ("<uri>rock.obj</uri><scale>1 1 -2</scale>", TETRAHEDRON, "has the scale 1 1 -2; only positive numbers"),
        ("<uri>rock.obj</uri>", "v nothing\n", "cannot be used"),
        ("<uri>../../rock.obj</uri>", TETRAHEDRON, "is outside the workspace"),
        ("<uri>rock.obj</uri><submesh><name>a</name></submesh>", TETRAHEDRON, "<submesh> is not simulated"),
    ],
)
def test_a_mesh_that_cannot_collide_is_lost(inside: str, file: str, message: str, tmp_path: Path) -> None:
    written(tmp_path / "rock.obj", file)
    _, lost = read(shaped(f"<mesh>{inside}</mesh>"), tmp_path)
    assert any(message in each for each in lost), lost


def test_a_moving_mesh_that_is_not_convex_is_lost(tmp_path: Path) -> None:
    written(tmp_path / "a.obj", TETRAHEDRON)
    written(tmp_path / "b.obj", CONCAVE)
    for name, losses in (("a", []), ("b", ["'m' moves and is not convex: its convex hull collides"])):
        bodies, lost = read(shaped(f"<mesh><uri>{name}.obj</uri></mesh>", static=False), tmp_path)
        assert (len(bodies), lost) == (1, losses)


def test_a_mesh_whose_up_axis_is_ignored_has_a_remark(tmp_path: Path) -> None:
    for axis, count in (("Z_UP", 0), ("Y_UP", 1)):
        (tmp_path / "a.dae").write_bytes(dae(asset=f"<up_axis>{axis}</up_axis>"))
        losses = world_file(tmp_path, shaped("<mesh><uri>a.dae</uri></mesh>")).losses
        message = "the <up_axis> of a mesh is ignored, as in Gazebo and RViz: Y_UP of 'a.dae'"
        assert [(loss.message, loss.is_remark) for loss in losses] == [(message, True)] * count


@pytest.mark.parametrize("kind", ["heightmap", "polyline", "image", "cone", "dodecahedron"])
def test_another_shape_is_lost(kind: str, tmp_path: Path) -> None:
    bodies, lost = read(shaped(f"<{kind}/>"), tmp_path)
    assert bodies == []
    assert lost == [f"a <{kind}> of 'm' is neither box, cylinder, sphere, capsule nor mesh; it is left out"]


def test_capsules_balls_and_marks_on_the_floor(tmp_path: Path) -> None:
    (body,), lost = read(shaped("<capsule><radius>0.1</radius><length>0.4</length></capsule>"), tmp_path)
    places = [(shape.kind, shape.pose.pose.position_xyz) for shape in body.shapes or ()]
    assert places == [("cylinder", (0, 0, 0)), ("sphere", (0, 0, -0.2)), ("sphere", (0, 0, 0.2))]
    assert lost == []
    (body,), _ = read(shaped("<ellipsoid><radii>0.2 0.2 0.2</radii></ellipsoid>"), tmp_path)
    assert body.sphere == Sphere(radius=0.2)
    # A mark is as thin as engines resolve.
    marks = "<cylinder><radius>1</radius><length>0.00001</length></cylinder>", "<box><size>1 2 0.00001</size></box>"
    assert [(len(bodies), lost) for bodies, lost in (read(shaped(mark), tmp_path) for mark in marks)] == [(1, [])] * 2


@pytest.mark.parametrize(
    ("pose", "normal", "lost"),
    [
        ("0 0 0 0 0 0", "0 0 1", 0),
        ("0 0 1 0 0 0", "0 0 1", 1),
        ("0 0 0 0 0 0", "1 0 0", 1),
        ("0 0 0 0.5 0 0", "0 0 1", 1),
    ],
)
def test_only_a_plane_on_the_ground_is_the_ground(pose: str, normal: str, lost: int, tmp_path: Path) -> None:
    more = f"<pose>{pose}</pose>"
    bodies, losses = read(shaped(f"<plane><normal>{normal}</normal></plane>", more=more), tmp_path)
    assert (bodies, len(losses)) == ([], lost)


SURFACE = "<surface><friction><ode>{}</ode></friction></surface>"


@pytest.mark.parametrize(
    ("ode", "friction", "lost"),
    [
        ("", 1.0, 0),
        ("<mu>0.2</mu>", 0.2, 0),
        ("<mu>0.2</mu><mu2>0.2</mu2>", 0.2, 0),
        ("<mu>100</mu><mu2>50</mu2>", 1.0, 0),
        ("<mu>0.2</mu><mu2>0.4</mu2>", 0.2, 1),
        ("<mu>-1</mu>", 1.0, 0),
        ("<slip1>0.1</slip1>", 1.0, 1),
        ("<slip1>0.0</slip1>", 1.0, 0),
    ],
)
def test_the_friction_of_a_body_is_that_of_its_collision(ode: str, friction: float, lost: int, tmp_path: Path) -> None:
    bodies, losses = read(shaped("<box><size>1 1 1</size></box>", more=SURFACE.format(ode)), tmp_path)
    assert [body.friction for body in bodies] == [friction]
    assert len(losses) == lost, losses


BOX = """
<model name="m"><link name="l"><inertial>{pose}<mass>3</mass><inertia><ixx>{ixx}</ixx><iyy>0.5</iyy><izz>0.5</izz>
<ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial>
<collision name="c"><geometry><box><size>1 1 1</size></box></geometry></collision></link></model>
"""


@pytest.mark.parametrize(
    ("pose", "ixx", "centre", "message"),
    [
        ("", 0.5, (0.0, 0.0, 0.0), None),
        ("<pose>0 0 0.3 0 0 0</pose>", 0.4, (0.0, 0.0, 0.3), None),
        ("", 2.0, (0.0, 0.0, 0.0), "the inertia of 'm' is that of uniform density: "),
    ],
)
def test_a_moving_body_has_its_stated_inertia(
    pose: str, ixx: float, centre: tuple[float, ...], message: str | None, tmp_path: Path
) -> None:
    bodies, lost = read(BOX.format(pose=pose, ixx=ixx), tmp_path)
    (body,) = bodies
    assert body.mass == 3.0
    assert body.center_of_mass == pytest.approx(centre)
    assert body.inertia == (Inertia(ixx=ixx, iyy=0.5, izz=0.5) if message is None else None)
    assert [each.startswith(message or "") for each in lost] == [True] * (message is not None)


def test_a_body_without_an_inertia_has_the_defaults_of_gazebo(tmp_path: Path) -> None:
    """SDFormat: a mass or a moment that is not stated is 1, at the pose of the <inertial>, whatever the shapes are."""
    placed = "<inertial><pose>0 0 2 0 0 0</pose><mass>3</mass></inertial>"
    for inertial, mass, z, absent in (("", 1, 0, "mass, inertia/ixx, "), (placed, 3, 2, "inertia/ixx, inertia/iyy, ")):
        found = world_file(tmp_path, AUTO.replace(AUTO_INERTIAL, inertial).format("<box><size>1 2 1</size></box>"))
        (body,), (loss,) = found.world.objects, found.losses
        assert (body.mass, body.center_of_mass, body.inertia) == (mass, (0, 0, z), Inertia(ixx=1.0, iyy=1.0, izz=1.0))
        assert (loss.message.startswith(f"'m' has no {absent}"), loss.is_remark) == (True, True)


AUTO_INERTIAL = '<inertial auto="true"><density>500</density></inertial>'
AUTO = f"""<model name="m"><link name="l">{AUTO_INERTIAL}
<collision name="c"><pose>0 0 1 0 0 0</pose><geometry>{{}}</geometry></collision></link></model>"""


def test_an_automatic_inertia_is_that_of_the_shapes(tmp_path: Path) -> None:
    (body,), lost = read(AUTO.format("<box><size>1 2 1</size></box>"), tmp_path)
    assert (body.mass, body.center_of_mass) == (1000, (0, 0, 1))
    assert body.inertia is not None
    moments = body.inertia.ixx, body.inertia.iyy, body.inertia.izz
    assert moments == pytest.approx((5000 / 12, 2000 / 12, 5000 / 12))
    assert lost == []


def test_an_inertia_that_cannot_be_computed_or_that_no_body_has_is_noted(tmp_path: Path) -> None:
    written(tmp_path / "a.obj", TETRAHEDRON)
    (body,), (lost,) = read(AUTO.format("<mesh><uri>a.obj</uri></mesh>"), tmp_path)
    assert body.mass == 1
    assert "cannot be computed from <mesh>" in lost
    (body,), (lost,) = read(BOX.format(pose="", ixx=0.5).replace("<ixy>0<", "<ixy>0.6<"), tmp_path)
    assert body.inertia is None
    assert "no body has the principal moments -0.1 0.5 1.1" in lost


def test_the_axes_of_an_inertia_turn_with_its_pose(tmp_path: Path) -> None:
    """A positive turn about z by 30 degrees makes a negative ixy of moments with ixx < iyy."""
    pose = f"<pose>0 0 0 0 0 {math.pi / 6}</pose>"
    bodies, lost = read(BOX.format(pose=pose, ixx=0.2), tmp_path)
    (body,) = bodies
    assert body.inertia is not None
    moments = body.inertia.ixx, body.inertia.iyy, body.inertia.ixy
    assert moments == pytest.approx((0.275, 0.425, -0.3 * math.sqrt(3) / 4))
    assert lost == []


def test_the_smallest_friction_of_several_shapes_counts(tmp_path: Path) -> None:
    rough = SURFACE.format("<mu>0.3</mu><mu2>0.3</mu2>")
    smooth = SURFACE.format("<mu>0.1</mu><mu2>0.1</mu2>")
    shapes = "".join(
        f"<collision name='{name}'><geometry><sphere><radius>1</radius></sphere></geometry>{more}</collision>"
        for name, more in (("a", rough), ("b", smooth), ("c", rough))
    )
    bodies, lost = read(f"<model name='m'><static>1</static><link name='l'>{shapes}</link></model>", tmp_path)
    assert [body.friction for body in bodies] == [0.1]
    assert lost == ["'m' has shapes of one body with different friction: the smallest is used for all"]


LINK = """<link name="{name}"><pose>{x} 0 1 0 0 0</pose><inertial><mass>{mass}</mass></inertial>
<collision name="c"><geometry><box><size>0.2 0.2 0.2</size></box></geometry></collision></link>"""
TWO = LINK.format(name="a", x=0, mass=1) + LINK.format(name="b", x=1, mass=3)
JOINT = "<joint name='j' type='{kind}'><parent>{parent}</parent><child>{child}</child></joint>"


def test_links_that_are_not_joined_are_bodies_of_their_own(tmp_path: Path) -> None:
    bodies, lost = read(f"<model name='m'>{TWO}</model>", tmp_path)
    assert [(body.name, body.mass, body.pose.x, body.pose.z) for body in bodies] == [("m/a", 1, 0, 1), ("m/b", 3, 1, 1)]
    assert lost == []


@pytest.mark.parametrize(("kind", "lost"), [("fixed", 0), ("revolute", 1)])
def test_links_that_are_joined_are_one_body(kind: str, lost: int, tmp_path: Path) -> None:
    joint = JOINT.format(kind=kind, parent="a", child="b")
    bodies, losses = read(f"<model name='m'><pose>5 0 0 0 0 0</pose>{TWO}{joint}</model>", tmp_path)
    (body,) = bodies
    assert (body.name, body.mass, body.pose.x) == ("m", 4, 5)
    assert body.center_of_mass == pytest.approx((0.75, 0, 1))
    assert body.inertia is not None
    # Two links of 1 kg m^2, and their distances of 0.75 m and 0.25 m from the centre of mass.
    assert body.inertia.izz == pytest.approx(2 + 0.75**2 + 3 * 0.25**2)
    assert losses == ["<joint> is not simulated: the links that it joins move as one body ('m')"] * lost


@pytest.mark.parametrize("end", ["s", "f"])
def test_a_joint_to_a_model_or_a_frame_leads_to_its_link(end: str, tmp_path: Path) -> None:
    """SDFormat: the canonical link of a model is that of `canonical_link`, by default its first one."""
    parts = f"<model name='s' canonical_link='b'>{TWO}</model><frame name='f' attached_to='s'/>"
    joint = JOINT.format(kind="fixed", parent="base", child=end)
    bodies, _ = read(f"<model name='m'>{LINK.format(name='base', x=5, mass=7)}{parts}{joint}</model>", tmp_path)
    assert [(body.name, body.mass) for body in bodies] == [("m/base", 7 + 3), ("m/s/a", 1)]


def test_a_model_that_is_joined_to_the_world_is_fixed(tmp_path: Path) -> None:
    joint = JOINT.format(kind="fixed", parent="world", child="a") + JOINT.format(kind="revolute", parent="a", child="b")
    bodies, _ = read(f"<model name='door'>{TWO}{joint.replace(repr('j'), repr('k'), 1)}</model>", tmp_path)
    assert [(body.name, body.mass) for body in bodies] == [("door", None)]


def test_a_pose_can_be_relative_to_another_model_and_in_degrees(tmp_path: Path) -> None:
    other = shaped("<box><size>1 1 1</size></box>").replace("'m'", "'other'")
    pose = "<pose relative_to='other' degrees='true'>1 0 0 0 0 90</pose>"
    turned = other.replace("<link", "<pose>0 2 0 0 0 0</pose><link").replace("other", "first", 1)
    model = shaped("<sphere><radius>1</radius></sphere>").replace("<link", f"{pose.replace('other', 'first')}<link", 1)
    bodies, lost = read(turned + model, tmp_path)
    at = bodies[1].pose
    assert (at.x, at.y, at.z, at.yaw) == pytest.approx((1, 2, 0, math.pi / 2))
    assert lost == []


def test_static_links_of_a_moving_model_are_one_fixed_body(tmp_path: Path) -> None:
    inner = f"<model name='base'><static>true</static>{TWO}</model>"
    bodies, _ = read(f"<model name='m'>{LINK.format(name='a', x=3, mass=1)}{inner}</model>", tmp_path)
    assert [(body.name, body.mass) for body in bodies] == [("m/a", 1), ("m/base/a", None)]


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("0.2 0.2 0.2", "0.2 wide", 5, "<size> is '0.2 wide': expected 3 finite numbers"),
        ("0.2 0.2 0.2", "0.2 0.2 -1", 5, "should be greater than or equal to"),
        ("<mass>1<", "<mass>0<", 4, "<mass> of 'm' is 0: expected more than 0"),
        ("<pose>0 0 1", "<pose relative_to='nothing'>0 0 1", 4, "<pose> refers to 'nothing', which does not exist"),
        ("<box><size>0.2 0.2 0.2</size></box>", "", 5, None),
    ],
)
def test_bad_values_have_their_line(old: str, new: str, line: int, message: str | None, tmp_path: Path) -> None:
    text = f"<model name='m'>{TWO}</model>"
    assert old in text
    if message is None:
        assert len(read(text.replace(old, new), tmp_path)[0]) == 0
        return
    with pytest.raises(RefusedModel) as error:
        read(text.replace(old, new, 1), tmp_path)
    assert message in str(error.value)
    assert [problem.location.line for problem in error.value.problems] == [line]


@pytest.mark.parametrize(
    ("inside", "message"),
    [
        (
            "<wind><linear_velocity>30 0 0</linear_velocity></wind>",
            "<wind> is not simulated: there is no wind of 30 0 0",
        ),
        ("<wind><linear_velocity>0 0 0</linear_velocity></wind><wind/>", None),
        (
            "<model name='m'><link name='l'><sensor name='s' type='camera'/></link></model>",
            "only the robot has sensors",
        ),
        ("<road name='r'/>", None),
    ],
)
def test_parts_without_an_effect_on_bodies_are_remarks(inside: str, message: str | None, tmp_path: Path) -> None:
    found = world_file(tmp_path, inside).losses
    assert all(loss.is_remark for loss in found)
    assert [message is not None and message in loss.message for loss in found] == ([True] if message else [])


def test_a_newer_version_is_a_remark(tmp_path: Path) -> None:
    (loss,) = world_file(tmp_path, "", "1.99").losses
    assert loss.message.startswith("SDF 1.99 is newer than 1.")


def bumpy(samples: int, size: float) -> SurfacePart:
    along = np.linspace(0.0, 3.0, samples)
    return grid_surface(GridPart((size, size), 0.02 * size * np.outer(np.sin(along), np.cos(along))))


def test_a_surface_of_many_triangles_keeps_its_place_and_others_stay() -> None:
    surface = bumpy(120, 0.4)
    found = simplified(surface)
    assert found is not None
    simple, way = found
    assert 100 < len(simple.triangles) <= MAX_TRIANGLES
    assert 0 < way < 0.02 * 3**0.5
    for corner in (np.min, np.max):
        assert np.abs(corner(simple.points_xyz, axis=0) - corner(surface.points_xyz, axis=0)).max() <= way
    few = bumpy(10, 1.0)
    assert simplified(few) == (few, 0.0)
    # It is too large for small cells.
    assert simplified(bumpy(120, 40.0)) is None


@pytest.mark.parametrize(
    ("one", "other", "static", "lost"),
    [
        ("", "", False, 0),
        ("<collide_bitmask>0x01</collide_bitmask>", "", False, 0),
        ("<collide_bitmask>0x01</collide_bitmask>", "<collide_bitmask>3</collide_bitmask>", False, 0),
        ("<collide_bitmask>0x01</collide_bitmask>", "<collide_bitmask>0x02</collide_bitmask>", False, 2),
        ("<collide_bitmask>0x01</collide_bitmask>", "<collide_bitmask>0x02</collide_bitmask>", True, 0),
        (
            "<collide_bitmask>1</collide_bitmask><category_bitmask>2</category_bitmask>",
            "<collide_bitmask>2</collide_bitmask>",
            False,
            0,
        ),
        ("<collide_bitmask>0</collide_bitmask>", "", True, 1),
        ("<collide_bitmask>0x10000</collide_bitmask>", "", False, 2),
    ],
)
def test_bitmasks_are_losses_if_they_keep_shapes_apart(
    one: str, other: str, static: bool, lost: int, tmp_path: Path
) -> None:
    box, surface = "<box><size>1 1 1</size></box>", "<surface><contact>{}</contact></surface>"
    models = [shaped(box, more=surface.format(contact), static=static) for contact in (one, other)]
    _, losses = read(models[0].replace("'m'", "'a'") + models[1].replace("'m'", "'b'"), tmp_path)
    message = "the bitmask of a <contact> is not simulated: the shape collides with every other one"
    assert [loss for loss in losses if "bitmask" in loss] == [f"{message} ('{name}')" for name in "ab"[:lost]]

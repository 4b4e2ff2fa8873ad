"""Bodies from Gazebo's models, and the losses of each."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from sim_action.core.geometry import Pose
from sim_action.ros.ros1.model_bodies import (
    BadWorld,
    PlacedModel,
    Sources,
    bodies_of,
    body_of,
    is_static,
    model_folders,
)
from sim_action.world import Body
from tests.ros.ros1.test_gazebo_worlds import WALL
from tests.ros_workspace import written

TETRAHEDRON = """\
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""
# Two tetrahedra that meet in a corner.
CONCAVE = (
    TETRAHEDRON
    + """\
v -1 0 0
v 0 -1 0
v 0 0 -1
f 1 5 6
f 1 7 5
f 1 6 7
f 5 7 6
"""
)


def shaped(geometry: str, *, more: str = "", static: bool = True) -> str:
    collision = f"<collision name='c'><geometry>{geometry}</geometry>{more}</collision>"
    return f"<model name='m'><static>{static}</static><link name='l'>{collision}</link></model>"


def read(text: str, file: Path, *folders: Path) -> tuple[list[Body], list[str]]:
    sources, model = Sources(folders), ET.fromstring(text)
    bodies = list(bodies_of(PlacedModel(model, "m", Pose(), file, is_static(model)), sources))
    return bodies, [loss.message for loss in sources.losses]


@pytest.mark.parametrize(
    "uri", ["model://rock/meshes/rock.obj", "meshes/rock.obj", "file://{folder}/rock/meshes/rock.obj"]
)
def test_a_mesh_collides(uri: str, tmp_path: Path) -> None:
    written(tmp_path / "rock/meshes/rock.obj", TETRAHEDRON)
    stated = uri.format(folder=tmp_path)
    bodies, lost = read(
        shaped(f"<mesh><uri>{stated}</uri><scale>2 2 2</scale></mesh>"), tmp_path / "rock/model.sdf", tmp_path
    )

    (body,) = bodies
    assert body.mesh is not None
    assert (body.mesh.file, body.mesh.scale) == (str(tmp_path / "rock/meshes/rock.obj"), 2.0)
    assert lost == []


@pytest.mark.parametrize(
    ("inside", "file", "message"),
    [
        ("<uri>model://no/rock.obj</uri>", TETRAHEDRON, "was not found; it is left out"),
        ("<uri>rock.obj</uri><scale>1 1 2</scale>", TETRAHEDRON, "has the scale 1 1 2; only equal positive numbers"),
        ("<uri>rock.obj</uri>", "v nothing\n", "cannot be used"),
        ("<uri>rock.obj</uri><submesh><name>a</name></submesh>", TETRAHEDRON, "<submesh> is not simulated"),
    ],
)
def test_a_mesh_that_cannot_collide_is_lost(inside: str, file: str, message: str, tmp_path: Path) -> None:
    written(tmp_path / "rock.obj", file)
    _, lost = read(shaped(f"<mesh>{inside}</mesh>"), tmp_path / "model.sdf")

    assert any(message in each for each in lost), lost


def test_a_moving_mesh_that_is_not_convex_is_lost(tmp_path: Path) -> None:
    written(tmp_path / "a.obj", TETRAHEDRON)
    written(tmp_path / "b.obj", CONCAVE)

    for name, losses in (("a", []), ("b", ["'m' moves and is not convex: its convex hull collides"])):
        bodies, lost = read(shaped(f"<mesh><uri>{name}.obj</uri></mesh>", static=False), tmp_path / "model.sdf")
        assert (len(bodies), lost) == (1, losses)


@pytest.mark.parametrize("kind", ["heightmap", "polyline", "image", "capsule", "ellipsoid", "dodecahedron"])
def test_another_shape_is_lost(kind: str) -> None:
    bodies, lost = read(shaped(f"<{kind}/>"), Path("m.sdf"))

    assert bodies == []
    assert lost == [f"a <{kind}> of 'm' is neither box, cylinder, sphere nor mesh; it is left out"]


@pytest.mark.parametrize(
    ("pose", "normal", "lost"),
    [
        ("0 0 0 0 0 0", "0 0 1", 0),
        ("0 0 1 0 0 0", "0 0 1", 1),
        ("0 0 0 0 0 0", "1 0 0", 1),
        ("0 0 0 0.5 0 0", "0 0 1", 1),
    ],
)
def test_only_a_plane_on_the_ground_is_the_ground(pose: str, normal: str, lost: int) -> None:
    more = f"<pose>{pose}</pose>"
    bodies, losses = read(shaped(f"<plane><normal>{normal}</normal></plane>", more=more), Path("m.sdf"))

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
        ("<slip1>0.1</slip1>", 1.0, 1),
        ("<slip1>0.0</slip1>", 1.0, 0),
    ],
)
def test_the_friction_of_a_body_is_that_of_its_collision(ode: str, friction: float, lost: int) -> None:
    bodies, losses = read(shaped("<box><size>1 1 1</size></box>", more=SURFACE.format(ode)), Path("m.sdf"))

    assert [body.friction for body in bodies] == [friction]
    assert len(losses) == lost, losses


BOX = """
<model name="m"><link name="l"><inertial>{pose}<mass>3</mass><inertia><ixx>{ixx}</ixx><iyy>0.5</iyy><izz>0.5</izz>
<ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial>
<collision name="c"><geometry><box><size>1 1 1</size></box></geometry></collision></link></model>
"""


@pytest.mark.parametrize(
    ("pose", "ixx", "message"),
    [
        ("", 0.5, None),
        (
            "",
            2.0,
            "the inertia 2 0.5 0.5 of 'm' is not simulated: it is that of a body of uniform density, 0.5 0.5 0.5",
        ),
        ("<pose>0 0 0.3 0 0 0</pose>", 0.5, "the centre of mass of 'm' is that of a body of uniform density"),
    ],
)
def test_a_moving_body_has_uniform_density(pose: str, ixx: float, message: str | None) -> None:
    bodies, lost = read(BOX.format(pose=pose, ixx=ixx), Path("m.sdf"))

    assert [body.mass for body in bodies] == [3.0]
    assert lost == ([] if message is None else [message])


def test_a_body_that_is_spawned_is_where_it_was_asked_for() -> None:
    body, losses = body_of("wall_1", f'<sdf version="1.6">{WALL}</sdf>', Pose((4.0, 1.0, 0.5)))

    assert losses == ()
    assert (body.name, body.pose.x, body.pose.y, body.pose.z, body.pose.yaw) == ("wall_1", 4, 1, 0.5, 0)


@pytest.mark.parametrize("text", ["<sdf/>", "<sdf><model name='m'/></sdf>", "<sdf", WALL.replace("0.1 3 1", "wide")])
def test_what_cannot_be_spawned_is_refused(text: str) -> None:
    with pytest.raises(BadWorld):
        body_of("wall", text, Pose())


def test_folders_of_models(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GAZEBO_MODEL_PATH", "/a::/b")

    assert model_folders() == (Path("/a"), Path("/b"))

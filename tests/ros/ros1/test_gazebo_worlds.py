"""Gazebo worlds, read from files."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from sim_action.core.geometry import Pose, compose
from sim_action.ros.ros1.gazebo_plugins import plugins_of
from sim_action.ros.ros1.gazebo_worlds import BadWorld, MissingWorld, body_of, find_world, flat_robot, read_world
from sim_action.ros.ros1.node.world_models import description_of
from sim_action.world import World, placed
from sim_action.world.parts import CylinderPart
from sim_action.world.world_files import WorldFile
from tests.ros_workspace import written

WALL = """
<model name="wall"><static>true</static><pose>2 0 0.5 0 0 1.5</pose>
  <link name="link"><collision name="c"><geometry><box><size>0.1 3 1</size></box></geometry></collision></link>
</model>
"""


@pytest.fixture(autouse=True)
def models(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "models"
    monkeypatch.setenv("GAZEBO_MODEL_PATH", str(folder))
    return folder


def file_of(folder: Path, inside: str) -> WorldFile:
    path = folder / "a.world"
    path.write_text(f'<?xml version="1.0"?><sdf version="1.6"><world name="default">{inside}</world></sdf>')
    return read_world(path)


def add_model(folder: Path, name: str, text: str) -> None:
    written(folder / f"models/{name}/model.sdf", f'<sdf version="1.6">{text}</sdf>')


def read(folder: Path, inside: str) -> tuple[World, list[str]]:
    found = file_of(folder, inside)
    return found.world, [loss.message for loss in found.losses if not loss.is_remark]


def test_poses_of_model_link_and_collision_are_put_together(tmp_path: Path) -> None:
    turned = math.pi / 2
    world, _ = read(
        tmp_path,
        f"""<model name="pole"><pose>1 2 0 0 0 {turned}</pose><link name="l"><pose>1 0 0 0 0 0</pose>
        <inertial><mass>3</mass></inertial>
        <collision name="c"><pose>0 0 0.4 0 0 0</pose>
        <geometry><cylinder><radius>0.1</radius><length>0.8</length></cylinder></geometry></collision></link></model>""",
    )
    (pole,) = world.objects
    assert (pole.pose.x, pole.pose.y, pole.pose.z, pole.mass) == (1, 2, 0, 3)
    (part,) = pole.parts()
    assert isinstance(part, CylinderPart)
    assert compose(placed(pole, (part,)), part.pose).position_xyz == pytest.approx((1, 3, 0.4))
    assert (part.radius, part.height) == (0.1, 0.8)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<sdf/>", "has no <world>"),
        ("<sdf", "a.world"),
        (f"<world>{WALL.replace('0.1 3 1', 'wide')}</world>", "a.world"),
    ],
)
def test_what_cannot_be_read_is_said_with_its_file(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "a.world"
    path.write_text(text)
    with pytest.raises(BadWorld, match=re.escape(message)):
        read_world(path)


def test_a_world_is_found_by_its_path_or_in_the_folders_of_gazebo(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "worlds/yard.world"
    path.parent.mkdir()
    path.touch()
    monkeypatch.setenv("GAZEBO_RESOURCE_PATH", f":{tmp_path}")
    assert find_world(str(path)) == path
    assert find_world("worlds/yard.world") == path
    assert find_world("worlds/empty.world") is None
    assert find_world("/usr/share/gazebo-11/worlds/empty.world") is None


@pytest.mark.parametrize(
    ("stated", "parts"),
    [
        ("{folder}/yrad.world", ["yrad.world' does not exist", "did you mean 'yard.world'?", "add the file"]),
        ("{folder}/empty.world", ["empty.world' does not exist"]),
        ("worlds/willowgarage.world", ["has only worlds/empty.world", "$(find PACKAGE)"]),
    ],
)
def test_a_world_that_does_not_exist_is_an_error_with_the_nearest(
    stated: str, parts: list[str], tmp_path: Path
) -> None:
    (tmp_path / "yard.world").touch()
    with pytest.raises(MissingWorld) as error:
        find_world(stated.format(folder=tmp_path))
    assert all(part in str(error.value) for part in parts), str(error.value)


ROVER = """
<model name="rover"><pose>1 0 0 0 0 0</pose><link name="base"/>
  <link name="wheel"/><joint name="j" type="revolute"><parent>base</parent><child>wheel</child></joint>
  <plugin name="d" filename="libgazebo_ros_diff_drive.so"/></model>
"""


def test_a_model_with_a_plugin_that_drives_is_the_robot_also_if_it_is_included(tmp_path: Path) -> None:
    found = file_of(tmp_path, f"{WALL}{ROVER}")
    assert [body.name for body in found.world.objects] == ["wall"]
    assert found.robot is not None
    assert (found.robot.name, found.robot.pose.position_xyz) == ("rover", (1, 0, 0))
    assert found.losses == ()
    add_model(tmp_path, "rover", ROVER)
    include = "<include><uri>model://rover</uri><name>one</name><pose>0 2 0 0 0 0</pose></include>"
    robot = file_of(tmp_path, include).robot
    assert robot is not None
    assert (robot.name, robot.pose.position_xyz) == ("one", (0, 2, 0))


def test_what_plugins_cannot_do_is_told(tmp_path: Path) -> None:
    other = ROVER.replace('name="rover"', 'name="second"')
    _, notes = read(tmp_path, f'{ROVER}{other}<plugin name="s" filename="libsky.so"/>')
    second = "'second' is simulated as a body, not as a robot; its plugins have no effect: gazebo_ros_diff_drive"
    assert notes[0] == second
    assert notes[-1] == "the plugin sky of the world is not supported and has no effect"


def test_a_loss_has_its_place_also_in_an_included_file(tmp_path: Path) -> None:
    add_model(tmp_path, "pole", '\n<model name="pole"><link name="l">\n<kinematic>1</kinematic></link></model>')
    losses = file_of(tmp_path, '\n<actor name="a"/>\n<include><uri>model://pole</uri></include>').losses
    places = [(Path(loss.location.file).name, loss.location.line) for loss in losses if loss.location]
    assert places == [("a.world", 2), ("model.sdf", 3)]


def test_old_worlds_have_gravity_in_physics(tmp_path: Path) -> None:
    assert read(tmp_path, "<physics type='ode'><gravity>0 0 -1.6</gravity></physics>")[0].gravity == (0, 0, -1.6)


STATE = """
<state world_name="default"><sim_time>10 0</sim_time><real_time>1 0</real_time><iterations>3</iterations>
  <model name="wall"><pose>4 1 0.5 0 0 0</pose><scale>1 1 1</scale>
    <link name="link"><pose>4 1 {z} 0 0 0</pose><velocity>0 0 0.009 0 -0.019 0</velocity>
    <wrench>0 0 -9.8 0 0 0</wrench></link>
  </model><light name="sun"><pose>0 0 10 0 0 0</pose></light>{more}</state>
"""


def test_the_state_of_a_world_places_its_models_and_links(tmp_path: Path) -> None:
    world, lost = read(tmp_path, WALL + STATE.format(z=0.7, more=""))
    (wall,) = world.objects
    assert (wall.pose.x, wall.pose.y, wall.pose.z, wall.pose.yaw) == pytest.approx((4, 1, 0.7, 0))
    assert lost == []
    # A state that moves or deletes is lost.
    text = STATE.format(z=0.5, more="<deletions><name>wall</name></deletions>")
    _, lost = read(tmp_path, WALL + text.replace("0 0 0.009 0 -0.019 0", "1 0 0 0 0 0"))
    assert lost == [
        "<deletions> is not simulated: its models still exist",
        "<velocity>1 0 0 0 0 0</velocity> is not simulated: the link starts at rest",
    ]


def test_a_model_that_includes_another_has_its_shapes(tmp_path: Path) -> None:
    add_model(tmp_path, "wall", WALL)
    include = "<include><uri>model://wall</uri><pose>0 2 0 0 0 0</pose></include>"
    nested = "<model name='n'><pose>0 0 1 0 0 0</pose><link name='l'><collision name='c'><geometry><sphere><radius>0.1"
    nested += "</radius></sphere></geometry></collision></link></model>"
    model = f"<model name='yard'><static>1</static><pose>1 0 0 0 0 0</pose>{include}{nested}</model>"
    world, lost = read(tmp_path, model)
    assert lost == []
    (yard,) = world.objects
    assert (yard.name, yard.pose.x, yard.pose.y, yard.pose.z) == ("yard", 1.0, 0.0, 0.0)
    places = {shape.kind: shape.pose.pose.position_xyz for shape in yard.shapes or ()}
    assert places == {"sphere": (0.0, 0.0, 1.0), "box": (0.0, 2.0, 0.0)}


def test_an_include_can_fix_a_model(tmp_path: Path) -> None:
    add_model(tmp_path, "wall", WALL.replace("<static>true</static>", ""))
    include = "<include><uri>model://wall</uri><static>{}</static></include>"
    for stated, mass in (("true", None), ("false", 1.0)):
        world, _ = read(tmp_path, include.format(stated))
        assert [body.mass for body in world.objects] == [mass]


def test_a_body_that_is_spawned_is_where_it_was_asked_for() -> None:
    body, losses = body_of("wall_1", f'<sdf version="1.6">{WALL}</sdf>', Pose((4.0, 1.0, 0.5)))
    assert losses == ()
    assert (body.name, body.pose.x, body.pose.y, body.pose.z, body.pose.yaw) == ("wall_1", 4, 1, 0.5, 0)
    # What needs no permission is still said.
    (remark,) = body_of("wall_1", WALL.replace("<static>true</static>", ""), Pose())[1]
    assert (remark.is_remark, "SDF's defaults are used" in remark.message) == (True, True)


@pytest.mark.parametrize("text", ["<sdf/>", "<sdf><model name='m'/></sdf>", "<sdf", WALL.replace("0.1 3 1", "wide")])
def test_what_cannot_be_spawned_is_refused(text: str) -> None:
    with pytest.raises(BadWorld):
        body_of("wall", text, Pose())


LASER = """<model name="laser"><link name="eye"><sensor name="s" type="ray">
<plugin name="p" filename="libgazebo_ros_laser.so"/></sensor></link>
<plugin name="x" filename="libunknown.so"/></model>"""
SCOUT = """<model name="scout"><link name="base"/><include><uri>model://laser</uri><name>front</name></include>
<joint name="j" type="fixed"><parent>base</parent><child>front::eye</child></joint>
<plugin name="d" filename="libgazebo_ros_diff_drive.so"/></model>"""


def test_plugins_of_models_in_a_robot_are_its_own(tmp_path: Path) -> None:
    add_model(tmp_path, "laser", LASER)
    robot = file_of(tmp_path, SCOUT).robot
    assert robot is not None
    spawned = f'<sdf version="1.6">{SCOUT}</sdf>'
    for root in (robot.entry.flat_model, flat_robot(description_of(spawned), spawned)):
        plugins = [(plugin.name, plugin.link) for plugin in plugins_of(root)]
        assert plugins == [("gazebo_ros_diff_drive", ""), ("unknown", ""), ("gazebo_ros_laser", "front::eye")]

"""Robots in MuJoCo's own format: what is read of them, and how what cannot be is refused."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from sim_action.core.errors import ModelError
from sim_action.core.workspace import Workspace
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import FloorLook, Motor, RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from tests.mesh_files import CORNERS, obj, stl

pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")

ROVER = """\
<mujoco model="rover">
  <compiler angle="degree"/>
  <default>
    <geom friction="0.8"/>
    <default class="look"><geom contype="0" conaffinity="0" mass="0"/></default>
  </default>
  <asset><texture name="paint" type="2d" file="absent.png"/><material name="red" texture="paint"/></asset>
  <worldbody>
    <light pos="0 0 3"/>
    <geom type="plane" size="5 5 0.1" material="red"/>
    <body name="chassis" pos="0 0 0.1">
      <freejoint/>
      <geom type="box" size="0.2 0.1 0.05" mass="4" material="red"/>
      <geom class="look" type="sphere" size="0.5"/>
      <geom name="caster" type="sphere" pos="-0.15 0 -0.05" size="0.05" mass="0.1" friction="0"/>
      <body name="left_wheel" pos="0.1 0.15 0">
        <joint name="left" axis="0 1 0" damping="0.01" armature="0.001"/>
        <geom type="cylinder" size="0.1 0.005" euler="90 0 0" mass="0.5"/>
      </body>
      <body name="right_wheel" pos="0.1 -0.15 0">
        <joint name="right" axis="0 1 0" damping="0.01" armature="0.001"/>
        <geom type="cylinder" size="0.1 0.005" euler="90 0 0" mass="0.5"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <velocity joint="left" kv="10" forcerange="-3 3"/>
    <motor joint="right" gear="2" forcerange="-4 5" ctrlrange="-1 1"/>
  </actuator>
  <sensor><jointpos joint="left"/></sensor>
  <keyframe><key qpos="0 0 1 1 0 0 0 0 0"/></keyframe>
</mujoco>
"""

ARM = """\
<mujoco model="arm">
  <worldbody>
    <body name="base" pos="0 0 1">
      <geom type="box" size="0.1 0.1 0.1"/>
      <body name="upper" pos="0 0 0.1">
        <joint name="shoulder" axis="0 0 1" range="-90 120" actuatorfrcrange="-20 20"/>
        <joint name="lift" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.04"/>
        <body name="hand" pos="0.5 0 0">
          <geom type="sphere" size="0.06"/>
          <body><joint type="slide" axis="0 1 0" range="0 0.1"/><geom size="0.02"/></body>
          <body><joint name="other" type="slide" axis="0 -1 0" range="0 0.1"/><geom size="0.02"/></body>
        </body>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="other" joint2="shoulder" polycoef="0.01 0.02 0 0 0"/></equality>
</mujoco>
"""


def read(folder: Path, text: str) -> RobotModel:
    (folder / "robot.xml").write_text(text, encoding="utf-8")
    return load_model(Robot(model="robot.xml"), Workspace(folder, folder))


def test_a_free_robot_is_read_as_it_is_written(tmp_path: Path) -> None:
    model = read(tmp_path, ROVER)
    assert (model.name, model.root, model.urdf) == ("rover", "chassis", "")
    assert {link.name: link.mass for link in model.links} == {"chassis": 4.1, "left_wheel": 0.5, "right_wheel": 0.5}
    middle = model.links_by_name["chassis"].centre_of_mass_xyz
    assert middle == pytest.approx((-0.15 * 0.1 / 4.1, 0.0, -0.05 * 0.1 / 4.1))
    left, right = model.moving_joints
    assert (left.name, left.type, left.parent, left.child) == ("left", "continuous", "chassis", "left_wheel")
    assert (left.axis_xyz, left.origin.position_xyz) == ((0, 1, 0), (0.1, 0.15, 0))
    # The right one is limited by its range of control, 1, and not by that of its force, 5; both times its gear, 2.
    assert (left.max_effort, right.max_effort) == (3, 2)
    assert (left.motor, right.motor) == (Motor("actuator_0", "velocity"), Motor("actuator_1", "effort"))


def test_what_is_only_looked_at_is_no_shape_and_needs_no_file(tmp_path: Path) -> None:
    chassis, wheel, _ = read(tmp_path, ROVER).links
    assert [shape.kind for shape in chassis.collisions] == ["box", "sphere"]
    assert chassis.collisions[0].upper_xyz == pytest.approx((0.2, 0.1, 0.05))
    assert wheel.collisions[0].radius == pytest.approx(0.1)
    assert wheel.surface.friction == pytest.approx(0.8)


def test_a_robot_without_a_free_joint_hangs_on_the_world(tmp_path: Path) -> None:
    model = read(tmp_path, ARM)
    assert model.root == "world"
    joints = {joint.name: joint for joint in model.joints}
    assert joints["base_joint"].origin.position_xyz == (0, 0, 1)
    shoulder, lift, finger, other = model.moving_joints
    assert (shoulder.lower, shoulder.upper) == pytest.approx((math.radians(-90), math.radians(120)), rel=1e-5)
    assert (shoulder.max_effort, shoulder.child, lift.child, lift.type) == (20, "upper", "upper", "continuous")
    assert (finger.name, finger.type, finger.lower, finger.upper) == ("joint_2", "prismatic", 0, 0.1)
    assert other.mimic is not None
    assert (other.mimic.joint, other.mimic.multiplier, other.mimic.offset) == ("shoulder", 0.02, 0.01)


def test_included_files_and_meshes_become_part_of_the_text(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/box.stl").write_bytes(stl())
    (tmp_path / "parts/assets.xml").write_text('<mujoco><asset><mesh name="box" file="box.stl"/></asset></mujoco>')
    text = """<mujoco><include file="parts/assets.xml"/>
      <worldbody><body><freejoint/><geom type="mesh" mesh="box" density="1000"/></body></worldbody></mujoco>"""
    model = read(tmp_path, text)
    assert model.mass == pytest.approx(1000 * 0.2 * 0.4 * 0.6, rel=1e-5)
    assert model.mjcf is not None
    assert re.findall('file="(.*?)"', model.mjcf.text) == ["sim-action-1.stl"]
    assert set(model.mjcf.meshes) == {"box"}
    assert [shape.kind for link in model.links for shape in link.collisions] == ["mesh"]


@pytest.mark.parametrize(("name", "used"), [("", "box"), ('name="crate"', "crate")])
def test_meshes_are_found_below_the_folder_that_the_file_names(name: str, used: str, tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/box.stl").write_bytes(stl())
    text = f"""<mujoco><compiler meshdir="parts"/><asset><mesh {name} file="box.stl" scale="2 1 1"/></asset>
      <worldbody><body><freejoint/><geom type="mesh" mesh="{used}" density="1000"/></body></worldbody></mujoco>"""
    assert read(tmp_path, text).mass == pytest.approx(2000 * 0.2 * 0.4 * 0.6, rel=1e-5)


def test_the_surfaces_of_all_meshes_are_there_to_be_seen(tmp_path: Path) -> None:
    (tmp_path / "box.stl").write_bytes(stl())
    (tmp_path / "wedge.obj").write_bytes(
        obj(CORNERS[:6], [(0, 1, 3), (0, 3, 2), (0, 4, 5), (0, 5, 1), (2, 3, 5), (2, 5, 4)])
    )
    text = """<mujoco>
      <asset><mesh name="box" file="box.stl"/><mesh name="wedge" file="wedge.obj" inertia="shell"/></asset>
      <worldbody><body><freejoint/><geom type="mesh" mesh="box"/><geom type="mesh" mesh="wedge"/></body></worldbody>
      </mujoco>"""
    from sim_action.robot.reading.mjcf.mujoco_spec import surfaces_of

    mjcf = read(tmp_path, text).mjcf
    assert mjcf is not None
    found = surfaces_of(mjcf)
    counts = {name: (len(points), len(faces)) for name, (points, faces) in found.items()}
    assert counts == {"box": (8, 12), "wedge": (6, 6)}
    for name, corners in (("box", CORNERS), ("wedge", CORNERS[:6])):
        points, faces = found[name]
        assert sorted({*faces.ravel().tolist()}) == list(range(len(corners)))
        # MuJoCo moves and turns a mesh, and keeps its size.
        apart = [math.dist(one, other) for one in points for other in points]
        assert sorted(apart) == pytest.approx(sorted(math.dist(one, other) for one in corners for other in corners))


def rules(model: RobotModel) -> set[str]:
    """Return the rules of a model's findings; the floor, the light and the sensor of ROVER are "passed-over"."""
    return {finding.rule for finding in model.findings}


UNREAD = "robot.xml:2: MuJoCo cannot read the model:"
BODY = "<worldbody><body><freejoint/><geom size='1'/></body></worldbody>"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "robot.xml:1: not well-formed XML"),
        ("<mujoco/>", "a robot must be one body with its children, but the model has 0 bodies in its world"),
        (f"<mujoco>{BODY}{BODY}</mujoco>", "children, but the model has 2 bodies in its world"),
        ("<mujoco>\n<worldbody><body typ='x'/></worldbody></mujoco>", f"{UNREAD} XML Error"),
        ("<mujoco>\n<worldbody><body><freejoint/></body></worldbody></mujoco>", f"{UNREAD} Error: mass"),
        (f"<mujoco>{BODY}</mujoco>".replace("'1'", "'1' friction='nan'"), "MuJoCo warns: XML contains a 'NaN'"),
        (f"<mujoco>{BODY}\n<include file='absent.xml'/></mujoco>", "robot.xml:2: 'absent.xml' does not exist"),
        (f"<mujoco>{BODY}<asset><mesh file='robot.xml'/></asset></mujoco>", "'.xml' files are not supported"),
    ],
)
def test_what_cannot_be_read_is_refused_in_words(
    text: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "inside"
    folder.mkdir()
    monkeypatch.chdir(folder)
    with pytest.raises(ModelError) as refused:
        read(folder, text)
    assert message in str(refused.value)
    assert str(refused.value).isprintable()
    assert [path.name for path in folder.iterdir()] == ["robot.xml"]


def test_a_ball_joint_in_series_with_others_is_refused_by_name(tmp_path: Path) -> None:
    """The poses of links below it would be wrong: the position of such a joint is not recorded."""
    joints = '<joint name="lift" type="slide"/>\n<joint name="shoulder" type="ball"/>'
    text = f'<mujoco><worldbody>\n<body name="arm">\n{joints}<geom size="0.1"/></body></worldbody></mujoco>'
    with pytest.raises(ModelError) as refused:
        read(tmp_path, text)
    message = "body 'arm' has the ball joint 'shoulder' and other joints, which is not supported: put 'shoulder' on a"
    assert message in str(refused.value)
    assert "robot.xml:4" in str(refused.value)
    assert len(read(tmp_path, text.replace('<joint name="lift" type="slide"/>', "")).moving_joints) == 3


@pytest.mark.parametrize(
    ("solref", "restitution"),
    [
        ("-1000 0", "1"),
        ("-1000 -6.32456", "0.73"),
        ("-1000 -63.2456", None),
        ("0.02 0.3", "0.37"),
        ("0.02 0.7", None),
        ("0.02 1", None),
        ("0.004 1", None),
    ],
)
def test_contacts_that_bounce_are_refused_unless_they_are_allowed(
    solref: str, restitution: str | None, tmp_path: Path
) -> None:
    text = ROVER.replace('name="caster"', f'name="caster" solref="{solref}"')
    assert text != ROVER
    if restitution is None:
        assert rules(read(tmp_path, text)) == {"passed-over"}
        return
    with pytest.raises(ModelError, match=f"a restitution of about {restitution}, but nothing bounces") as refused:
        read(tmp_path, text)
    remedy = "give 'solref' a damping ratio of 1, such as solref=\"0.02 1\", or ignore it by robot.allow [restitution]"
    assert remedy in str(refused.value)
    assert "set it to 0" not in str(refused.value)
    allowed = load_model(Robot(model="robot.xml", allow=("restitution",)), Workspace(tmp_path, tmp_path))
    found = allowed.findings[0]
    assert rules(allowed) == {"restitution", "passed-over"}
    assert found.rule == "restitution"
    assert str(found.location).endswith("robot.xml:15")
    # What is only looked at may bounce.
    visual = '<geom type="sphere" solref="-1000 0" contype="0" conaffinity="0" size="0.01"/>'
    text = ROVER.replace('<geom name="caster"', f'{visual}<geom name="caster"')
    assert rules(read(tmp_path, text)) == {"passed-over"}


DEFAULTS = """\
<mujoco model="boxy">
  <asset>
    <texture name="wood" type="2d" builtin="flat" width="8" height="8"/>
    <material name="self" texture="wood" rgba=".7 .5 .3 .25"/><material name="green" rgba="0 1 0 1"/>
    <mesh name="wedge" file="wedge.stl"/>
  </asset>
  <default>
    <material texture="wood"/>
    <geom material="self"/>
    <default class="part"><default class="look"><geom type="mesh" mesh="wedge" contype="0" conaffinity="0" mass="0"/>
    </default><geom rgba="0 0 1 1"/></default>
  </default>
  <worldbody>
    <camera name="eye"/><light/><light/>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="base" pos="0 0 .2"><freejoint/><geom type="box" size=".1 .1 .1"/>
      <frame pos="0 0 0.5" childclass="part"><geom size="0.1"/><geom class="look" material="green" pos="1 0 0"/></frame>
    </body>
  </worldbody>
  <sensor><gyro site="s"/><accelerometer site="s"/></sensor>
</mujoco>
"""


def test_materials_and_meshes_of_default_classes_reach_their_geoms(tmp_path: Path) -> None:
    (tmp_path / "wedge.stl").write_bytes(stl())
    (base,) = read(tmp_path, DEFAULTS.replace('site="s"', 'site="missing"')).links
    colours = [pytest.approx((0.7, 0.5, 0.3)), (0, 0, 1), pytest.approx((0, 0, 1))]
    assert [visual.color for visual in base.visuals] == colours
    assert [visual.opacity for visual in base.visuals] == [0.25, 1, 1]
    drawn = base.visuals[2]
    assert (drawn.kind, drawn.file, drawn.scale) == ("mesh", str(tmp_path / "wedge.stl"), (1, 1, 1))
    # The frame of the file, not that of MuJoCo, which lies at the centre of mass.
    assert drawn.pose.position_xyz == pytest.approx((1, 0, 0.5))
    assert drawn.pose.orientation_xyzw == pytest.approx((0, 0, 0, 1))


def test_each_kind_that_is_left_out_is_one_note_with_a_line(tmp_path: Path) -> None:
    (tmp_path / "wedge.stl").write_bytes(stl())
    notes = {finding.message: finding.location.line for finding in read(tmp_path, DEFAULTS).findings}
    left_out = ["<light>, <camera> and <skin>", "<sensor>", "a <geom> of <worldbody>"]
    assert [message.split(" is left out")[0].split(" are left out")[0] for message in notes] == left_out
    assert list(notes.values()) == [14, 20, 15]
    assert [message.rpartition(" (")[2] for message in notes][:2] == ["3 of them; line 14)", "2 of them; line 20)"]


def test_the_robot_of_a_scene_is_found_among_other_bodies(tmp_path: Path) -> None:
    others = """<body name="table"><geom size="1 1 1" type="box"/></body>
      <body name="cube"><freejoint name="cube"/><geom size="0.1"/></body>
      <body name="target" mocap="true"><geom size="0.1"/></body><body name="chassis\""""
    scene = ROVER.replace('<body name="chassis"', others).replace("0 0 1 1 0 0 0 0 0", "")
    scene = scene.replace("</worldbody>", "</worldbody><equality><weld body1='target' body2='cube'/></equality>")
    model = read(tmp_path, scene)
    assert (model.root, [link.name for link in model.links]) == ("chassis", ["chassis", "left_wheel", "right_wheel"])
    (note,) = (finding.message for finding in model.findings if "not a part of the robot" in finding.message)
    assert "the file also has body 'table', 'cube', 'target': left out" in note


def test_geoms_that_the_file_pairs_with_its_floor_collide(tmp_path: Path) -> None:
    text = """<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>
      <geom name="floor" type="plane" size="1 1 1"/>
      <body><freejoint/><geom name="foot" size="0.1"/><geom name="head" size="0.2"/><geom name="tail" size="0.3"/>
      </body></worldbody>
      <contact><pair geom1="foot" geom2="floor"/><pair geom1="head" geom2="tail"/></contact></mujoco>"""
    model = read(tmp_path, text)
    assert [shape.radius for link in model.links for shape in link.collisions] == [0.1]
    assert [finding.message.split()[0] for finding in model.findings] == ["<pair>", "a"]


def test_two_arms_on_the_ground_are_one_robot(tmp_path: Path) -> None:
    arm = '<body name="{0}" pos="0 {1} 0"><joint name="{0}_joint" axis="0 0 1"/><geom size="0.1"/></body>'
    model = read(tmp_path, f"<mujoco><worldbody>{arm.format('left', 1)}{arm.format('right', -1)}</worldbody></mujoco>")
    assert (model.root, [joint.parent for joint in model.joints]) == ("world", ["world", "world"])


def test_links_of_joints_with_a_reference_are_where_mujoco_has_them(tmp_path: Path) -> None:
    import mujoco

    text = """<mujoco><compiler angle="radian"/><worldbody><body name="base"><freejoint/><geom size="0.1"/>
      <body name="a" pos="0.1 0.2 0.3" euler="0.1 0.2 0.3">
        <joint name="one" axis="0 1 0.5" ref="0.4" pos="0.1 0 0"/>
        <joint name="two" axis="1 0 0" ref="-0.7" pos="0 0.2 0"/>
        <joint name="three" type="slide" axis="0 1 1" ref="0.2"/><geom size="0.1"/>
        <body name="b" pos="0.5 0 0"><joint name="four" axis="0 0 1" ref="1" range="0.5 2"/><geom size="0.1"/></body>
      </body></body></worldbody></mujoco>"""
    model = read(tmp_path, text)
    assert [joint.home for joint in model.moving_joints] == pytest.approx([0.4, -0.7, 0.2, 1])
    reference = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(reference)
    positions = {"one": 0.9, "two": 0.3, "three": -0.4, "four": 1.2}
    for name, position in positions.items():
        data.joint(name).qpos = position
    mujoco.mj_kinematics(reference, data)
    poses = link_poses(model, positions)
    for link in ("a", "b"):
        assert poses[link].position_xyz == pytest.approx(tuple(data.body(link).xpos), abs=1e-12)
        x, y, z, w = poses[link].orientation_xyzw
        assert abs(np.dot((w, x, y, z), data.body(link).xquat)) == pytest.approx(1)


def test_what_is_ignored_of_options_and_contacts_is_one_note_each(tmp_path: Path) -> None:
    text = ROVER.replace(
        "<default>", '<option density="1.2" timestep="0.01"><flag contact="disable"/></option><default>', 1
    )
    text = text.replace('<geom friction="0.8"/>', '<geom friction="0.8" condim="4" solref="0.02 1"/>')
    notes = {finding.message.split(" (")[0]: finding.location.line for finding in read(tmp_path, text).findings}
    ignored = {message: line for message, line in notes.items() if "ignored" in message}
    assert [message.split()[0] for message in ignored] == ["density", "<option", "contact", "condim,"]
    assert list(ignored.values()) == [3, 3, 3, 4]
    assert "<option timestep> is ignored; for the same steps, state physics: {rate: 100 Hz}" in ignored


HOIST = """<body name="arm" pos="0 0 1"><geom size=".05"/><body name="upper"><joint name="lift" axis="0 1 0"/>
  <geom name="tip" type="capsule" fromto="0 0 0 .3 0 0" size=".02"/></body></body>"""
LID = '<geom size=".1"/><body name="lid" pos="0 0 .2"><joint name="lid" axis="0 1 0"/><geom size=".01"/></body></body>'
BOX = f'<body name="box" pos="1 0 .2"><freejoint/>{LID}'
CABINET = f'<body name="cabinet" pos="1 0 .2">{LID}'
MOTOR = '<actuator><motor joint="lift"/></actuator>'
FLOOR = '<geom name="floor" type="plane" size="5 5 .1"/>'
KEY = '<keyframe><key name="home" qpos="0 0 .5 1 0 0 0 0" ctrl="0"/></keyframe>'


def model(folder: Path, worldbody: str, others: str = "", before: str = "") -> RobotModel:
    return read(folder, f"<mujoco>{before}<worldbody>{worldbody}</worldbody>{others}</mujoco>")


def notes(found: RobotModel) -> list[str]:
    return [finding.message for finding in found.findings]


def test_what_joins_the_robot_to_a_body_that_is_left_out_is_noted(tmp_path: Path) -> None:
    hoist = HOIST.replace("<geom name=", '<site name="end"/><geom name=')
    target = """<body name="target" mocap="true" pos=".3 0 1"><site name="hook"/><geom name="ball" size=".01"/></body>
      <body name="shelf"><geom size=".1"/></body>"""
    joined = """<tendon><spatial><site site="hook"/><site site="end"/></spatial></tendon>
      <equality><weld body1="target" body2="upper"/>
      <weld body1="shelf"/></equality>"""
    noted = {finding.message: finding.location.line for finding in model(tmp_path, hoist + target, joined).findings}
    kinds = [(message.split(" that ")[0], line) for message, line in noted.items()]
    assert kinds[1:] == [("a <tendon>", 3), ("an <equality>", 4)]


def test_the_tree_with_actuators_is_the_robot_with_trees_that_equalities_or_tendons_couple_to_it(
    tmp_path: Path,
) -> None:
    for name, other in (("box", BOX), ("cabinet", CABINET)):
        found = model(tmp_path, HOIST + other, MOTOR)
        assert [joint.name for joint in found.moving_joints] == ["lift"]
        assert f"the file also has body '{name}'" in notes(found)[0]
    fixed = '<fixed name="rope"><joint joint="lift" coef="1"/><joint joint="lid" coef="1"/></fixed>'
    equality = '<equality><connect body1="lid" body2="upper" anchor="0 0 0"/></equality>'
    for coupled in (equality, f"<tendon>{fixed}</tendon>"):
        found = model(tmp_path, HOIST + CABINET, MOTOR + coupled)
        assert [joint.name for joint in found.moving_joints] == ["lift", "lid"]


def test_without_actuators_bodies_fixed_to_the_world_are_one_robot_and_free_ones_are_ambiguous(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="has 2 bodies in its world, 'arm', 'box': move the others"):
        model(tmp_path, HOIST + BOX)
    found = model(tmp_path, HOIST + CABINET)
    assert [joint.name for joint in found.moving_joints] == ["lift", "lid"]
    (note,) = notes(found)
    assert note == "the bodies 'arm', 'cabinet' of <worldbody> are one robot: no <actuator> acts on a part of it only"


def test_a_keyframe_leaves_out_the_controls_of_other_bodies(tmp_path: Path) -> None:
    others = '<actuator><motor name="m" joint="lift"/><motor name="off" joint="lift" group="3"/></actuator>'
    key = '<keyframe><key name="home" qpos="0.5" ctrl="1 2"/></keyframe>'
    found = model(tmp_path, HOIST, others + key, '<option actuatorgroupdisable="3"/>')
    assert found.keyframes["home"].controls == {"m": (1,)}
    assert found.mjcf is not None
    assert found.mjcf.actuators == ("m",)
    assert notes(found) == ["an <actuator> is left out, because <option actuatorgroupdisable> disables its group"]


@pytest.mark.parametrize(
    ("planes", "floor"),
    [
        (FLOOR, 0.0),
        (FLOOR + '<geom type="plane" size="5 5 .1" pos="5 0 2" euler="0 -90 0"/>', 0.0),
        (FLOOR + '<geom type="plane" size="5 5 .1" pos="0 0 3" contype="0" conaffinity="0"/>', 0.0),
        (FLOOR + '<geom type="plane" size="5 5 .1" pos="0 0 3" quat="0 1 0 0"/>', 0.0),
        (FLOOR + '<frame pos="0 0 1" euler="0 30 0"><geom type="plane" size="1 1 1" pos="2 0 0"/></frame>', 0.0),
        ('<frame pos="0 0 1" euler="0 90 0"><geom type="plane" size="1 1 1" pos="2 0 0" euler="0 -90 0"/></frame>', -1),
    ],
)
def test_level_planes_that_collide_are_the_floor(planes: str, floor: float, tmp_path: Path) -> None:
    found = model(tmp_path, planes + HOIST)
    assert found.mjcf is not None
    assert found.mjcf.floor == pytest.approx(floor)
    assert not any("is the ground" in note for note in notes(found))


def test_the_highest_of_several_floors_is_the_ground_with_a_note_and_so_is_the_friction_of_a_pair(
    tmp_path: Path,
) -> None:
    found = model(tmp_path, FLOOR + '<geom name="stage" type="plane" size="1 1 .1" pos="0 0 .25"/>' + HOIST)
    assert found.mjcf is not None
    assert found.mjcf.floor == 0.25
    assert "geom 'stage' at z = 0.25 m is the ground: it is the highest of 2 level planes" in notes(found)[0]
    pair = '<contact><pair geom1="floor" geom2="tip" friction="0.1 0.1 0.1 0.1 0.1"/></contact>'
    found = model(tmp_path, FLOOR + HOIST, pair)
    assert [note for note in notes(found) if note.startswith("friction, condim, ") and "of <pair> are ignored" in note]


@pytest.mark.parametrize(
    ("option", "start"),
    [
        ('wind="1 0 0"', "wind of <option> is ignored: air and water are not simulated"),
        ('viscosity="1" density="2"', "viscosity, density of <option> is ignored"),
        ('gravity="0 0 -1"', "gravity of <option> is ignored: 'world.gravity'"),
    ],
)
def test_ignored_options_are_named(option: str, start: str, tmp_path: Path) -> None:
    assert notes(model(tmp_path, HOIST, before=f"<option {option}/>"))[0].startswith(start)


@pytest.mark.parametrize(
    ("actuator", "reason"),
    [
        ('<general joint="lift" dyntype="integrator"/>', "acts on the integral of its control"),
        ('<damper joint="lift" ctrlrange="0 1"/>', "is neither a motor nor a servo"),
        ('<motor tendon="pull"/>', "acts on a fixed tendon and is not a position servo"),
        ('<adhesion body="upper" ctrlrange="0 1"/>', "acts on a body"),
        ('<muscle joint="lift" lengthrange="0 1"/>', "is a muscle"),
        ('<position joint="lift"/><motor joint="lift"/>', "shares its joint with one that is"),
    ],
)
def test_the_reason_why_an_actuator_cannot_be_commanded_is_that_of_the_actuator(
    actuator: str, reason: str, tmp_path: Path
) -> None:
    tendon = '<tendon><fixed name="pull"><joint joint="lift" coef="1"/></fixed></tendon>'
    found = model(tmp_path, HOIST, f"{tendon}<actuator>{actuator}</actuator>")
    assert [f"because it {reason}" in note for note in notes(found)] == [True]


TEXTURE = '<texture name="t" type="2d" builtin="{kind}" rgb1="{color}" rgb2="0 0.5 1" width="8" height="8"/>'
MATERIAL = '<material name="m" texture="t" texrepeat="5 5" {more}/>'
FLOORED = '<body name="b" pos="0 0 1"><freejoint/><geom size=".1"/></body>'


def look(folder: Path, floor: str, more: str, kind: str = "checker", color: str = ".2 .4 .6") -> FloorLook | None:
    asset = f"<asset>{TEXTURE.format(kind=kind, color=color)}{MATERIAL.format(more=more)}</asset>"
    size = "" if "size" in floor else 'size="2 2 .1"'
    plane = f'<geom name="floor" type="plane" {size} {floor}/>'
    found = read(folder, f"<mujoco>{asset}<worldbody>{plane}{FLOORED}</worldbody></mujoco>")
    assert found.mjcf is not None
    return found.mjcf.floor_look


@pytest.mark.parametrize(
    ("stated", "expected"),  # of the plane, the material, the kind and the first colour of the texture
    [
        (('material="m"', ""), FloorLook((0.2, 0.4, 0.6), (0, 0.5, 1), 0.4)),
        (('material="m"', 'rgba="1 0.5 0 1"'), FloorLook((0.2, 0.2, 0), (0, 0.25, 0), 0.4)),
        # The plane's own colour replaces that of its material.
        (('material="m" rgba="0 0 1 1"', 'rgba="1 1 0 1"'), FloorLook((0, 0, 0.6), (0, 0, 1), 0.4)),
        (('rgba=".3 .2 .1 1"', ""), FloorLook((0.3, 0.2, 0.1))),
        (('material="m"', "", "flat"), FloorLook((0.2, 0.4, 0.6))),
        (("", "", "none"), None),
        (('material="m"', "", "none"), None),
        # Colours that are none are those of MuJoCo, and those beyond white are white.
        *(
            (('material="m"', "", "checker", numbers), FloorLook((0.8, 0.8, 0.8), (0, 0.5, 1), 0.4))
            for numbers in ("", "1 2", "nan 0 0", "red green blue", "1e400 0 0")
        ),
        (('material="m"', "", "checker", "7 -3 0.5"), FloorLook((1, 0, 0.5), (0, 0.5, 1), 0.4)),
    ],
)
def test_a_floor_has_the_colours_of_its_material(
    stated: tuple[str, ...], expected: FloorLook | None, tmp_path: Path
) -> None:
    assert look(tmp_path, *stated) == expected


@pytest.mark.parametrize(
    ("floor", "more", "square"),
    [
        ('material="m"', 'texuniform="true"', 0.1),
        ('material="m" size="0 0 1"', "", 0.1),
        ('material="m" size="0.001 1 1"', "", 0.01),
        ('material="m" size="100000 1 1"', "", 1000),
    ],
)
def test_squares_have_the_size_in_which_mujoco_draws_them(floor: str, more: str, square: float, tmp_path: Path) -> None:
    found = look(tmp_path, floor, more)
    assert found is not None
    assert found.square == pytest.approx(square)

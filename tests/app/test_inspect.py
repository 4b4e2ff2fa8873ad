from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from sim_action.app import inspect as inspection
from sim_action.app.inspect import Inspection, inspection_text, losses_text, robot_block
from sim_action.core.errors import RefusedModel
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import read_document
from sim_action.drives.diff import DiffDrive
from sim_action.robot.model.robot_spec import Robot
from tests.robot.bad_models import GOOD

names = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), min_size=1, max_size=20)


def read(block: str) -> Any:
    data = read_document("it.sim.yml", block).data
    assert isinstance(data, dict)
    return data["robot"]


def test_only_what_differs_is_written_and_all_of_it() -> None:
    assert robot_block(Robot(model="robots/arm.urdf"), None) == "robot:\n  model: robots/arm.urdf\n"
    robot = Robot(
        model="my robots/arm.xacro",
        base="fixed",
        args={"lidar": "true", "mass": 3},
        packages={"a": "../a"},
        allow=("b",),
    )
    drive = DiffDrive(left=("l",), right=("r",), radius=0.05)
    assert robot_block(robot, drive, "base: free").splitlines() == [
        "robot:",
        '  model: "my robots/arm.xacro"',
        "  base: fixed",
        '  args: {lidar: "true", mass: 3}',
        "  packages: {a: ../a}",
        "  allow: [b]",
        "  drive: {diff: {left: [l], right: [r], radius: 0.05}}",
        "  # base: free",
    ]


@pytest.mark.parametrize(
    "name",
    [
        "on",
        "null",
        "~",
        "1e3",
        "0x1",
        "a: b",
        "#a",
        "[",
        "-",
        "'",
        '"',
        "\u2028",
        "🤖",
        ".5",
        ".1e3",
        ".5e-3",
        ".",
        "..",
        ".inf",
    ],
)
def test_names_that_yaml_would_take_for_something_else_are_quoted(name: str) -> None:
    for robot in ({"model": name}, {"model": "a.xacro", "args": {"a": name}}):
        block = robot_block(Robot.model_validate(robot), None)
        assert read(block) == robot
        assert yaml.safe_load(block) == {"robot": robot}


@pytest.mark.parametrize("name", ["./a.urdf", "../a.urdf", "/a.urdf", "_a", "a.b", "a-1"])
def test_paths_and_names_stand_as_they_are(name: str) -> None:
    assert robot_block(Robot(model=name), None) == f"robot:\n  model: {name}\n"


@given(names.map("{}.xacro".format), names, names)
def test_what_is_written_reads_back(model: str, left: str, right: str) -> None:
    robot = Robot(model=model, args={left: right}, packages={right: left})
    drive = DiffDrive(left=(left,), right=(right,))
    assert read(robot_block(robot, drive)) == {
        "model": model,
        "args": {left: right},
        "packages": {right: left},
        "drive": {"diff": {"left": (left,), "right": (right,)}},
    }


MESH = '<mesh filename="part.obj" scale="0.5 0.25 -2"/>'


def inspected(folder: Path, text: str = GOOD, model: str = "robot.urdf") -> Inspection:
    (folder / "robot.urdf").write_text(text, encoding="utf-8")
    return inspection.inspect_model(Robot(model=model), Workspace(folder, folder))


def test_the_burger_is_what_is_published(tmp_path: Path) -> None:
    found = inspected(tmp_path, model="turtlebot3_burger")
    assert found.mass == pytest.approx(1.002)
    assert found.height == pytest.approx(0.0, abs=1e-9)
    assert found.lower_xyz is not None
    assert found.upper_xyz is not None
    # ROBOTIS's e-Manual: 138 x 178 x 192 mm; wheels alone are 16 mm narrower than its mounted width.
    assert found.upper_xyz[0] - found.lower_xyz[0] == pytest.approx(0.138, abs=0.01)
    assert found.upper_xyz[2] - found.lower_xyz[2] == pytest.approx(0.192, abs=0.01)
    assert found.drive is not None
    assert "radius 0.033 m, separation 0.16 m" in found.drive
    assert found.robot == (
        "robot:\n  model: turtlebot3_burger\n  drive: {diff: {left: [wheel_left_joint], right: [wheel_right_joint]}}\n"
    )


def test_joints_and_boxes_are_where_the_model_has_them(tmp_path: Path) -> None:
    found = inspected(tmp_path)
    assert "base (2 kg)\n`- shoulder [revolute about z, -57.3 to 114.6 deg] -> upper (1 kg)" in (inspection_text(found))
    (joint,) = json.loads(found.model_dump_json())["joints"]
    assert (joint["name"], joint["lower"], joint["upper"], joint["axis_xyz"]) == ("shoulder", -1, 2, [0, 0, 1])
    found = inspected(tmp_path)
    assert (found.lower_xyz, found.upper_xyz) == ((0.5, 1.5, 2.5), (1.5, 2.5, 3.5))
    assert found.height == -2.5
    text = inspection_text(inspected(tmp_path))
    assert "standing, its base link 'base' is 2.5 m below the ground" in text


def test_several_joints_of_one_link_are_one_branch(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")
    (tmp_path / "robot.xml").write_text("""<mujoco model="cart"><worldbody><body name="cart">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/><geom size="0.1" mass="2"/>
      <body name="arm"><joint name="turn" axis="0 0 1"/><geom size="0.1" mass="1"/></body></body>
      <body name="other"><joint name="lift" type="slide" axis="0 0 1"/><geom size="0.1" mass="1"/></body>
    </worldbody></mujoco>""")
    text = inspection_text(inspected(tmp_path, model="robot.xml"))
    assert text.split("\n\n")[1].splitlines() == [
        "world",
        "|- x [prismatic along x]",
        "|  y [prismatic along y] -> cart (2 kg)",
        "|  `- turn [continuous about z] -> arm (1 kg)",
        "`- lift [prismatic along z] -> other (1 kg)",
    ]


def test_a_joint_says_whom_it_follows(tmp_path: Path) -> None:
    finger = (
        '<link name="finger"/><joint name="bend" type="continuous"><parent link="upper"/><child link="finger"/>'
        '<mimic joint="shoulder"/></joint></robot>'
    )
    found = inspected(tmp_path, GOOD.replace("</robot>", finger))
    assert [joint.mimics for joint in found.joints] == [None, "shoulder"]
    assert "bend [continuous about x, follows shoulder]" in inspection_text(found)


def test_the_block_holds_what_gazebos_plugin_says(tmp_path: Path) -> None:
    plugin = (
        '<gazebo><plugin filename="libgazebo_ros_diff_drive.so"><leftJoint>l</leftJoint><rightJoint>r</rightJoint>'
        "<legacyMode>false</legacyMode><wheelSeparation>0.25</wheelSeparation><wheelDiameter>0.1</wheelDiameter></plugin></gazebo></robot>"
    )
    wheels = "".join(
        f'<link name="{side}w"/>'
        f'<joint name="{side}" type="continuous"><parent link="base"/><child link="{side}w"/>'
        '<axis xyz="0 1 0"/></joint>'
        for side in "lr"
    )
    found = inspected(tmp_path, GOOD.replace("</robot>", f"{wheels}{plugin}"))
    assert "drive: {diff: {left: [l], right: [r], radius: 0.05, separation: 0.25}}" in found.robot
    assert found.drive_source is not None
    assert found.drive_source.startswith("plugin gazebo_ros_diff_drive at ")
    assert found.drive_source.endswith("robot.urdf:22")


def test_meshes_are_as_large_as_they_are_scaled(tmp_path: Path) -> None:
    (tmp_path / "part.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n")
    found = inspected(tmp_path, GOOD.replace('<sphere radius="0.5"/>', MESH))
    assert (found.lower_xyz, found.upper_xyz, found.height) == ((1, 2, 1), (1.5, 2.25, 3), -1)
    assert "fill 0.5 x 0.25 x 2 m" in inspection_text(found)


def test_a_base_that_is_the_world_is_at_its_origin(tmp_path: Path) -> None:
    bolted = GOOD.replace('"base"', '"world"')
    found = inspected(tmp_path, bolted)
    assert found.height == 0
    said = "bolted to the world, its base link 'world' is at the origin; its lowest shape is 2.5 m above the ground"
    assert said in " ".join(inspection_text(found).split())
    below = inspected(tmp_path, bolted.replace("1 2 3", "0 0 0.25"))
    assert "its lowest shape is 0.25 m below the ground" in " ".join(inspection_text(below).split())
    assert "standing" not in inspection_text(below)


def test_a_long_name_is_cut_and_no_name_acts(tmp_path: Path) -> None:
    text = inspection_text(inspected(tmp_path, GOOD.replace('"arm"', f'"{"a" * 5000}"')))
    assert text.startswith(f"{'a' * 60}...: 2 links")
    text = inspection_text(inspected(tmp_path, GOOD.replace('"arm"', '"::error::x ##[a]"')))
    assert not any(line.startswith("::") for line in text.splitlines())
    assert "##[" not in text
    model = GOOD.replace('"arm"', '"x&#10;INJECTED&#13;&#x85;"').replace('"upper"', '"y&#10;INJECTED"')
    text = inspection_text(inspected(tmp_path, model))
    assert "x\\nINJECTED\\r\\x85" in text
    assert "y\\nINJECTED" in text
    assert not any(line.startswith("INJECTED") for line in text.splitlines())


def test_nothing_is_said_of_the_size_of_what_has_none(tmp_path: Path) -> None:
    found = inspected(tmp_path, re.sub("(?s)<collision>.*</collision>", "", GOOD))
    assert (found.lower_xyz, found.upper_xyz, found.height, found.wheels) == (None, None, None, ())
    assert "standing" not in inspection_text(found)


def test_where_joints_begin_is_where_they_are_looked_at(tmp_path: Path) -> None:
    bent = GOOD.replace('lower="-1" upper="2"', 'lower="1" upper="2"')
    found = inspected(tmp_path, bent)
    assert found.joints[0].start == 1.5
    assert "57.3 to 114.6 deg, begins at 85.94 deg]" in inspection_text(found)


def cart(folder: Path, *wheels: str) -> Inspection:
    base = re.sub("(?s)<collision>.*</collision>", "", GOOD)
    return inspected(folder, base.replace("</robot>", f"{''.join(wheels)}</robot>"))


def wheel(name: str, xyz: str, *, parent: str = "base", kind: str = "continuous", axis: str = "0 0 1") -> str:
    return f"""
<link name="{name}"><collision><geometry><cylinder radius="0.1" length="0.05"/></geometry></collision></link>
<joint name="{name}_joint" type="{kind}"><parent link="{parent}"/><child link="{name}"/>
  <origin xyz="{xyz}" rpy="-1.5707963 0 0"/><axis xyz="{axis}"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
"""


FOUR = (wheel("a", "0.2 0.3 0"), wheel("b", "-0.2 0.3 0"), wheel("c", "0.2 -0.3 0"), wheel("d", "-0.2 -0.3 0"))


def test_wheels_are_listed_with_what_a_drive_has_to_say(tmp_path: Path) -> None:
    found = cart(tmp_path, *FOUR)
    assert [(entry.joint, entry.radius) for entry in found.wheels] == [(f"{name}_joint", 0.1) for name in "abcd"]
    assert found.wheels[0].position_xyz == pytest.approx((0.2, 0.3, 0))
    assert found.wheels[0].axis_xyz == pytest.approx((0, 1, 0), abs=1e-6)
    assert "wheel: c_joint, radius 0.1 m, at x = 0.2 m, y = -0.3 m\n" in inspection_text(found)
    assert "\n  drive: {skid: {left: [a_joint, b_joint], right: [c_joint, d_joint]}}\n" in found.robot
    assert found.drive_source == "geometry"
    assert "recognised from geometry: skid steer: left a_joint, b_joint; right c_joint," in inspection_text(found)


def test_a_drive_that_is_likely_is_offered_and_left_to_the_reader(tmp_path: Path) -> None:
    found = cart(tmp_path, FOUR[0], FOUR[2])
    assert found.drive is None
    assert "\n  # drive: {diff: {left: [a_joint], right: [c_joint]}}\n" in found.robot
    assert "no drive is recognised; if the robot has one, state it in robot.drive" in inspection_text(found)
    reason = "'a_joint', 'c_joint' stand on the ground, but their names do not show which is on the left"
    assert found.drive_reasons[0] == f"diff: {reason}"


def test_mecanum_wheels_by_name_are_offered_as_such(tmp_path: Path) -> None:
    found = cart(
        tmp_path,
        *(
            part.replace('link name="a"', 'link name="mecanum_a"').replace('link="a"', 'link="mecanum_a"')
            for part in FOUR
        ),
    )
    assert found.drive is None
    assert "\n  # drive: {mecanum: {left: [a_joint, b_joint], right: [c_joint, d_joint]}}\n" in found.robot


@pytest.mark.parametrize(
    "odd", [wheel("e", "0.5 0 -1", parent="upper"), wheel("e", "0.5 0 0")], ids=["steered", "in the middle"]
)
def test_no_drive_is_offered_that_may_be_wrong(odd: str, tmp_path: Path) -> None:
    found = cart(tmp_path, *FOUR, odd)
    assert len(found.wheels) == 5
    assert "drive" not in found.robot


@pytest.mark.parametrize(
    "other",
    [
        wheel("e", "0.5 0.3 0.02"),
        wheel("e", "0.5 0.3 0", kind="revolute"),
        wheel("e", "0.5 0.3 0", kind="fixed"),
        wheel("e", "0.5 0.3 0", axis="0 1 0"),
    ],
    ids=["in the air", "limited", "fixed", "upright"],
)
def test_not_all_that_is_round_is_a_wheel(other: str, tmp_path: Path) -> None:
    assert [entry.joint for entry in cart(tmp_path, *FOUR, other).wheels] == [f"{name}_joint" for name in "abcd"]


def test_wheels_named_against_their_places_lead_to_a_drive_to_copy(tmp_path: Path) -> None:
    found = cart(tmp_path, wheel("left", "0 -0.3 0"), wheel("right", "0 0.3 0"))
    assert found.drive is None
    assert "\n  # drive: {diff: {left: [right_joint], right: [left_joint]}}  # by place; " in found.robot


@pytest.mark.parametrize(
    ("root", "mass", "written"), [("base", 0, "base: fixed\n"), ("base", 2, "# base: fixed"), ("world", 0, "")]
)
def test_the_block_says_what_an_engine_would_hold_still(root: str, mass: float, written: str, tmp_path: Path) -> None:
    text = GOOD.replace('"base"', f'"{root}"').replace('mass value="2"', f'mass value="{mass}"')
    block = inspected(tmp_path, text).robot
    assert written in block
    assert ("fixed" in block) is bool(written)


def test_findings_of_one_kind_are_one_line(tmp_path: Path) -> None:
    zero = '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>'
    text = inspection_text(inspected(tmp_path, re.sub("<inertia .*?/>", zero, GOOD)))
    assert text.count("principal moments") == 1
    assert "(also on line 13)" in " ".join(text.split())
    findings = text.split("the audit found:")[1].split("to paste")[0].splitlines()
    assert max(len(line) for line in findings if str(tmp_path) not in line) <= 80
    # The first names and lines of many are told.
    frame = '\n<link name="f{0}"/><joint name="j{0}" type="fixed"><parent link="base"/><child link="f{0}"/></joint>'
    frames = "".join(frame.format(number) for number in range(7))
    text = inspection_text(inspected(tmp_path, GOOD.replace("</robot>", f"{frames}</robot>")))
    line = GOOD.count("\n") + 1
    more = ", ".join(str(line + number) for number in range(1, 5))
    found = " ".join(text.split())
    assert text.count("has no <inertial>") == 1
    assert f"negligible mass (and 6 more like this: 'f1', 'f2', 'f3', 'f4', ...; lines {more}, ...)" in found
    # Hints may differ.
    tags = "".join(f'\n<gazebo reference="{name}"/>' for name in ("bas", "upp", "shoulde"))
    text = inspection_text(inspected(tmp_path, GOOD.replace("</robot>", f"{tags}</robot>")))
    found = " ".join(text.split())
    assert found.count("no link or joint has this name") == 1
    assert 'no link or joint has this name (and 2 more like this: "upp", "shoulde"; lines ' in found


def test_what_a_scenario_has_to_allow_stands_in_the_block(tmp_path: Path) -> None:
    found = inspected(tmp_path, GOOD.replace('lower="-1" upper="2" ', ""))
    assert found.needs == ("missing-limits",)
    assert "  allow: [missing-limits]\n" in found.robot
    assert "\nerror missing-limits, can be allowed by robot.allow\n  " in inspection_text(found)


def test_what_no_engine_could_take_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedModel, match=r"two-parents|one-root|loop"):
        inspected(tmp_path, GOOD.replace('<parent link="base"/>', '<parent link="upper"/>'))


def test_motors_and_tendons_of_mjcf_are_listed(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")
    fingers = "".join(
        f'<body><joint name="{name}" type="slide" axis="0 1 0"/><geom size=".1"/></body>' for name in ("f1", "f2", "f3")
    )
    text = f"""<mujoco><worldbody><body><geom size=".1"/>{fingers}</body></worldbody>
      <tendon><fixed name="grip"><joint joint="f1" coef="1"/><joint joint="f2" coef="1"/></fixed></tendon>
      <actuator><position name="close" tendon="grip"/><motor name="m" joint="f3"/></actuator></mujoco>"""
    (tmp_path / "r.xml").write_text(text, encoding="utf-8")
    found = inspection_text(inspected(tmp_path, model="r.xml"))
    assert "f1 [prismatic along y, position servo 'close' on tendon 'grip']" in found
    assert "f3 [prismatic along y, motor 'm']" in found


def test_losses_have_their_lines_and_what_follows_from_them(tmp_path: Path) -> None:
    lost = '<gazebo reference="upper"><turnGravityOff>true</turnGravityOff><provideFeedback/></gazebo>\n<zzz/></robot>'
    found = inspected(tmp_path, GOOD.replace("</robot>", lost))
    text = " ".join(losses_text(found).split())
    line = GOOD.count("\n")
    assert f"robot.urdf:{line}: <turnGravityOff>true</turnGravityOff> of link 'upper' is not simulated" in text
    assert f"robot.urdf:{line + 1}: <zzz> of the model is unknown and is not read [unknown-part]" in text
    assert inspection_text(found).count("harmless-part") == 0
    feedback = '<gazebo reference="shoulder"><provideFeedback>true</provideFeedback></gazebo></robot>'
    harmless = losses_text(inspected(tmp_path, GOOD.replace("</robot>", feedback)))
    assert "forces of joints are always known [harmless-part]" in " ".join(harmless.split())

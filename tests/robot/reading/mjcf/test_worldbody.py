"""Robots among other bodies of an MJCF file, its floor, and parts of its contacts and options."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import ModelError
from sim_action.robot.model.robot_model import RobotModel
from tests.robot.reading.mjcf.test_mjcf_reader import read

ARM = """<body name="arm" pos="0 0 1"><geom size=".05"/><body name="upper"><joint name="lift" axis="0 1 0"/>
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


@pytest.mark.parametrize("other", [BOX, CABINET])
def test_the_tree_with_actuators_is_the_robot(other: str, tmp_path: Path) -> None:
    found = model(tmp_path, ARM + other, MOTOR)
    assert [joint.name for joint in found.moving_joints] == ["lift"]
    assert "the file also has body 'box'" in notes(found)[0] or "the file also has body 'cabinet'" in notes(found)[0]


def test_trees_that_equalities_couple_to_the_robot_belong_to_it(tmp_path: Path) -> None:
    coupled = MOTOR + '<equality><connect body1="lid" body2="upper" anchor="0 0 0"/></equality>'
    found = model(tmp_path, ARM + CABINET, coupled)
    assert [joint.name for joint in found.moving_joints] == ["lift", "lid"]


def test_an_arm_beside_a_free_body_with_joints_is_ambiguous_without_actuators(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="has 2 bodies in its world, 'arm', 'box': move the others"):
        model(tmp_path, ARM + BOX)


def test_bodies_fixed_to_the_world_without_actuators_are_one_robot_with_a_note(tmp_path: Path) -> None:
    found = model(tmp_path, ARM + CABINET)
    assert [joint.name for joint in found.moving_joints] == ["lift", "lid"]
    assert notes(found) == [
        "the bodies 'arm', 'cabinet' of <worldbody> are one robot: no <actuator> acts on a part of it only"
    ]


def test_a_keyframe_leaves_out_the_controls_of_other_bodies(tmp_path: Path) -> None:
    others = '<actuator><motor name="m" joint="lift"/><motor name="off" joint="lift" group="3"/></actuator>'
    key = '<keyframe><key name="home" qpos="0.5" ctrl="1 2"/></keyframe>'
    found = model(tmp_path, ARM, others + key, '<option actuatorgroupdisable="3"/>')
    assert found.keyframes["home"].controls == {"m": 1}
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
    found = model(tmp_path, planes + ARM)
    assert found.mjcf is not None
    assert found.mjcf.floor == pytest.approx(floor)
    assert not any("is the ground" in note for note in notes(found))


def test_the_highest_of_several_floors_is_the_ground_with_a_note(tmp_path: Path) -> None:
    found = model(tmp_path, FLOOR + '<geom name="stage" type="plane" size="1 1 .1" pos="0 0 .25"/>' + ARM)
    assert found.mjcf is not None
    assert found.mjcf.floor == 0.25
    assert "geom 'stage' at z = 0.25 m is the ground: it is the highest of 2 level planes" in notes(found)[0]


def test_the_friction_of_a_pair_is_noted(tmp_path: Path) -> None:
    pair = '<contact><pair geom1="floor" geom2="tip" friction="0.1 0.1 0.1 0.1 0.1"/></contact>'
    found = model(tmp_path, FLOOR + ARM, pair)
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
    assert notes(model(tmp_path, ARM, before=f"<option {option}/>"))[0].startswith(start)


@pytest.mark.parametrize(
    ("actuator", "reason"),
    [
        ('<intvelocity joint="lift" actrange="-1 1"/>', "acts on the integral of its control"),
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
    found = model(tmp_path, ARM, f"{tendon}<actuator>{actuator}</actuator>")
    assert [f"because it {reason}" in note for note in notes(found)] == [True]

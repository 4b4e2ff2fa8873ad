"""Which links of a robot may touch each other, and which robots get a note about it."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import InvalidPart
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_model import RobotModel, has_limb, touchable_pairs, unwatched_note
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model

BOX = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'


def chain(folder: Path, *kinds: str) -> RobotModel:
    """A base `l0`, and a link below each joint of these types."""
    links = "".join(f'<link name="l{number}">{BOX}</link>' for number in range(len(kinds) + 1))
    joints = "".join(
        f'<joint name="j{number}" type="{kind}"><parent link="l{number}"/><child link="l{number + 1}"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for number, kind in enumerate(kinds)
    )
    (folder / "chain.urdf").write_text(f'<robot name="chain">{links}{joints}</robot>')
    return load_model(Robot(model="chain.urdf", base="fixed"), Workspace(folder, folder))


@pytest.mark.parametrize(
    ("kinds", "pairs"),
    [
        (("revolute",), []),
        (("revolute", "revolute"), [("l0", "l2")]),
        (("revolute", "fixed"), []),
        (("fixed", "revolute", "fixed"), []),
        (("revolute", "fixed", "prismatic"), [("l0", "l3")]),
        (("planar", "revolute"), [("l0", "l2")]),
        (("floating", "revolute"), [("l0", "l2")]),
    ],
)
def test_links_of_one_body_and_neighbours_cannot_touch(
    kinds: tuple[str, ...], pairs: list[tuple[str, str]], tmp_path: Path
) -> None:
    assert list(touchable_pairs(chain(tmp_path, *kinds))) == pairs


@pytest.mark.parametrize(
    ("kinds", "bolted", "free"),
    [
        (("revolute",), False, False),
        (("revolute", "revolute"), True, False),
        (("revolute", "prismatic", "revolute"), True, True),
        (("revolute", "continuous"), False, False),
        (("continuous", "continuous", "fixed"), True, False),
    ],
)
def test_an_arm_or_a_leg_has_several_motors_in_a_row(
    kinds: tuple[str, ...], bolted: bool, free: bool, tmp_path: Path
) -> None:
    model = chain(tmp_path, *kinds)
    assert (has_limb(model, bolted=True), has_limb(model, bolted=False)) == (bolted, free)


@pytest.mark.parametrize(("name", "noted"), [("ur5e_gripper", True), ("turtlebot3_burger", False), ("f1tenth", False)])
def test_only_robots_with_limbs_get_a_note_if_the_scenario_leaves_it_open(name: str, noted: bool) -> None:
    here = Workspace(Path("/"), Path("/"))
    left_open = Robot(model=name)
    model = load_model(left_open, here)
    assert (unwatched_note(model, left_open, bolted=noted) is not None) == noted
    assert unwatched_note(model, Robot(model=name, self_collision=False), bolted=noted) is None


def test_mjcf_excludes_pairs(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    geom = '<geom type="box" size="0.1 0.1 0.1"/>'
    joint = '<joint type="hinge" axis="0 0 1" range="-1 1"/>'
    body = f'<body name="a">{geom}<body name="b">{joint}{geom}<body name="c">{joint}{geom}'
    body += f'<body name="d">{joint}{geom}</body></body></body></body>'
    contact = '<contact><exclude body1="d" body2="a"/></contact>'
    (tmp_path / "m.xml").write_text(f'<mujoco model="m"><worldbody>{body}</worldbody>{contact}</mujoco>')
    model = load_model(Robot(model="m.xml"), Workspace(tmp_path, tmp_path))
    assert list(touchable_pairs(model)) == [("a", "c"), ("b", "d")]


def test_arguments_are_for_a_xacro_file_only() -> None:
    assert Robot(model="arm.urdf.xacro", args={"size": 2}).args == {"size": 2}
    with pytest.raises(InvalidPart, match=r"only a \.xacro file has arguments, and the model is 'arm\.urdf'"):
        Robot(model="arm.urdf", args={"size": 2})

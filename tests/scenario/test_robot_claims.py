"""The audit of claims that do not fit the robot: no shapes to touch, a base that cannot move, motors that clip."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Final

import pytest

from sim_action.core.errors import Problem
from tests.scenarios import load, problems

EXAMPLES: Final = Path(__file__).parents[2] / "examples"
INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
SHAPE = '<geometry><box size="0.2 0.2 0.2"/></geometry>'
COLLISION = f"<collision>{SHAPE}</collision>"
VISUAL = f"<visual>{SHAPE}</visual>"


def robot(folder: Path, base: str = "", decor: str = "", arm: str = "", hand: str = "") -> None:
    """Write a base with a fixed decoration, and an arm with a fixed hand."""

    def link(name: str, shapes: str) -> str:
        return f'<link name="{name}">{INERTIAL}{shapes}</link>\n'

    def joint(child: str, parent: str, kind: str) -> str:
        ends = f'<parent link="{parent}"/><child link="{child}"/>'
        limit = '<axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="5" velocity="5"/>' if kind != "fixed" else ""
        return f'<joint name="{child}_joint" type="{kind}">{ends}{limit}</joint>\n'

    links = link("base", base) + link("decor", decor) + link("arm", arm) + link("hand", hand)
    joints = joint("decor", "base", "fixed") + joint("arm", "base", "revolute") + joint("hand", "arm", "fixed")
    (folder / "robot.urdf").write_text(f'<robot name="r">\n{links}{joints}</robot>\n')


def scenario(expect: str, more: str = "", base: str = "free") -> str:
    wall = "world: {objects: [{name: wall, box: [0.1, 2.0, 0.5], pose: {x: 3.0}}]}\n"
    head = f"name: a\nrobot: {{model: robot.urdf, base: {base}, pose: {{z: 1}}}}\n{wall}expect:\n  - {expect}\n"
    return f"{head}time_limit: 5 s\n{more}"


def found(folder: Path, text: str, rule: str) -> list[Problem]:
    return [problem for problem in problems(folder, text) if problem.message.endswith(f"[{rule}]")]


def warned(folder: Path, text: str) -> list[str]:
    return [str(warning) for warning in load(folder, text).warnings]


@pytest.mark.parametrize(
    "expect",
    [
        "no_collision",
        "clearance: {at_least: 1 m}",
        "contact: {with: wall}",
        "stops_before: {body: wall, gap: [0.1, 0.5]}",
        "not: no_collision",
    ],
)
def test_a_robot_without_collision_shapes_touches_nothing(expect: str, tmp_path: Path) -> None:
    robot(tmp_path, arm=VISUAL)
    (problem,) = problems(tmp_path, scenario(expect))
    assert problem.message.endswith(
        " checks nothing: no link of the robot has a collision shape; add <collision> to 'arm' [no-collision-shape]"
    )
    assert load(tmp_path, scenario(expect, "allow: [no-collision-shape]\n")).warnings == ()
    assert load(tmp_path, scenario("upright")).warnings == ()
    robot(tmp_path, base=COLLISION)
    assert load(tmp_path, scenario(expect)).warnings == ()


def test_moving_links_that_are_only_visual_are_named(tmp_path: Path) -> None:
    expect = "all_of: [no_collision, {clearance: {at_least: 1 m}}]"
    robot(tmp_path, base=COLLISION, decor=VISUAL, arm=VISUAL, hand=VISUAL)
    (warning,) = warned(tmp_path, scenario(expect))
    assert warning == (
        "contacts of 'arm', 'hand' are not seen: the links have a visual shape, but no collision shape; "
        "add <collision> [shapeless-links]"
    )
    assert warned(tmp_path, scenario(expect, "allow: [shapeless-links]\n")) == []
    assert warned(tmp_path, scenario("clearance: {at_least: 1 m, links: [base]}")) == []
    assert warned(tmp_path, scenario("upright")) == []


def test_all_links_may_touch(tmp_path: Path) -> None:
    robot(tmp_path, base=COLLISION, hand=COLLISION)
    assert warned(tmp_path, scenario("no_collision: {allow: [base]}")) == []
    assert warned(tmp_path, scenario("no_collision: {allow: [base, hand]}")) == [
        "allow names every link with a collision shape, so no touch counts; remove links from allow [nothing-to-touch]"
    ]


def test_parts_of_a_body_with_a_shape_and_a_base_that_cannot_move_need_none(tmp_path: Path) -> None:
    robot(tmp_path, base=COLLISION, decor=VISUAL, arm=VISUAL, hand=COLLISION)
    assert warned(tmp_path, scenario("no_collision")) == []
    robot(tmp_path, base=VISUAL, decor=VISUAL, hand=COLLISION)
    assert warned(tmp_path, scenario("no_collision", base="fixed")) == []
    assert len(warned(tmp_path, scenario("no_collision"))) == 1


@pytest.mark.parametrize(
    ("expect", "key"),
    [
        ("travel: {at_least: 1 m}", "travel"),
        ("path_length: {at_most: 1 m}", "path_length"),
        ("reach: {x: 0, y: 0}", "reach"),
        ("stay_within: {x: [-1, 1]}", "stay_within"),
        ("upright", "upright"),
        ("max_speed: {linear: 1}", "max_speed"),
        ("final_pose: {x: 0}", "final_pose"),
        ("follow_path: {path: [{x: 0, y: 0}, {x: 1, y: 0}], max_error: 0.1}", "follow_path"),
        ("settled: {joints: false}", "settled.joints"),
        ("not: {upright: {}}", "not.upright"),
    ],
)
def test_a_fixed_base_cannot_move(expect: str, key: str, tmp_path: Path) -> None:
    robot(tmp_path, base=COLLISION)
    (problem,) = found(tmp_path, scenario(expect, base="fixed"), "fixed-base")
    assert f"expect.0.{key}: " in problem.message
    assert load(tmp_path, scenario(expect, "allow: [fixed-base]\n", base="fixed"))
    assert load(tmp_path, scenario(expect))


def test_joints_of_a_robot_with_a_fixed_base_can_be_judged(tmp_path: Path) -> None:
    robot(tmp_path, base=COLLISION)
    golden = "# sim-action golden trajectory 1: r\ntime_s,x_m,y_m,z_m,yaw_rad,arm_joint_rad\n"
    (tmp_path / "golden.csv").write_text(f"{golden}0.0,0.0,0.0,1.0,0.0,0.0\n0.1,0.0,0.0,1.0,0.0,0.0\n")
    for expect in (
        "settled",
        "joint: {name: arm_joint, at_most: 1}",
        "matches: {trace: golden.csv, joints: {'*': 0.1}}",
    ):
        assert load(tmp_path, scenario(expect, base="fixed"))
    (tmp_path / "golden.csv").unlink()
    (problem,) = found(tmp_path, scenario("matches: {trace: golden.csv, position: 1 cm}", base="fixed"), "fixed-base")
    assert "add tolerances in 'joints' [fixed-base]" in problem.message


@pytest.mark.parametrize(
    ("limit", "key"),
    [
        ("at_most: 5", "at_most"),
        ("at_most: 5.001 N m", "at_most"),
        ("at_most: 4, rms_at_most: 6", "rms_at_most"),
        ("at_most: 4.9", None),
        ("rms_at_most: 4.9", None),
    ],
)
def test_motors_that_cannot_exceed_a_limit(limit: str, key: str | None, tmp_path: Path) -> None:
    robot(tmp_path, base=COLLISION)
    text = scenario(f"effort: {{{limit}}}", base="fixed")
    if key is None:
        assert load(tmp_path, text).warnings == ()
        return
    (problem,) = problems(tmp_path, text)
    assert f"expect.0.effort.{key}: this limit cannot be exceeded: the motors give at most 5 N m ('arm_joint')" in (
        problem.message
    )
    assert problem.message.endswith("[unreachable-limit]")
    assert load(tmp_path, text + "allow: [unreachable-limit]\n")
    file = tmp_path / "robot.urdf"
    file.write_text(file.read_text().replace('effort="5"', 'effort="0"'))
    assert load(tmp_path, text)


@pytest.mark.parametrize("key", ["effort: {at_most: 1 N, joints: [JOINT]}", "energy: {at_most: 1, joints: [JOINT]}"])
def test_a_joint_that_mimics_another_has_no_motor(key: str, tmp_path: Path) -> None:
    shutil.copy(EXAMPLES / "commands/arm.urdf", tmp_path / "robot.urdf")
    (problem,) = problems(tmp_path, scenario(key.replace("JOINT", "right_finger_joint"), base="fixed"))
    assert problem.message.endswith(
        "joints.0: joint 'right_finger_joint' mimics 'left_finger_joint' and has no motor of its own; "
        "name 'left_finger_joint'"
    )
    assert load(tmp_path, scenario(key.replace("JOINT", '"*_finger_joint"'), base="fixed"))

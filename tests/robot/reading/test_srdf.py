"""SRDF files: groups, states and disabled pairs, and what does not fit the model."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.app.inspect import inspect_model, losses_text
from sim_action.core.errors import ModelError, RefusedModel
from sim_action.core.workspace import Workspace
from sim_action.robot.model.joint_selection import chosen, joints_set_by
from sim_action.robot.model.robot_model import RobotModel, touchable_pairs
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from tests.scenarios import load, told

BOX = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
CHAIN = ("base", "one", "two", "three", "tool")
TYPES = ("revolute", "revolute", "prismatic", "fixed")


def urdf() -> str:
    links = "".join(f'<link name="{name}">{BOX}</link>' for name in CHAIN)
    joints = "".join(
        f'<joint name="j_{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for parent, child, kind in zip(CHAIN, CHAIN[1:], TYPES, strict=False)
    )
    return f'<robot name="arm">{links}{joints}</robot>'


def model_with(folder: Path, srdf: str, name: str = "arm") -> RobotModel:
    (folder / "arm.urdf").write_text(urdf())
    (folder / "arm.srdf").write_text(f'<robot name="{name}">\n{srdf}\n</robot>')
    robot = Robot(model="arm.urdf", base="fixed", srdf="arm.srdf")
    return load_model(robot, Workspace(folder, folder))


@pytest.mark.parametrize(
    ("group", "joints"),
    [
        ('<joint name="j_two"/><joint name="j_one"/>', ("j_one", "j_two")),
        ('<link name="two"/><link name="base"/>', ("j_two",)),
        ('<chain base_link="one" tip_link="tool"/>', ("j_two", "j_three")),
        ('<group name="inner"/><joint name="j_one"/>', ("j_one", "j_three")),
    ],
)
def test_a_group_means_its_moving_joints(group: str, joints: tuple[str, ...], tmp_path: Path) -> None:
    inner = '<group name="inner"><joint name="j_three"/></group>'
    model = model_with(tmp_path, f'{inner}<group name="arm">{group}</group><virtual_joint name="world_joint"/>')
    assert tuple(joint.name for joint in chosen(model, ("arm",))) == joints
    assert joints_set_by(model, ["arm", "j_one"])["arm"] == tuple(name for name in joints if name != "j_one")


def test_neighbours_and_disabled_pairs_cannot_touch(tmp_path: Path) -> None:
    """The links `three` and `tool` are one body, whose neighbour is `two`."""
    free = list(touchable_pairs(model_with(tmp_path, "")))
    assert free == [("base", "two"), ("base", "three"), ("base", "tool"), ("one", "three"), ("one", "tool")]
    some = '<disable_default_collisions link="base"/><enable_collisions link1="tool" link2="base"/>'
    assert list(touchable_pairs(model_with(tmp_path, some))) == [("base", "tool"), *free[3:]]


@pytest.mark.parametrize(
    ("srdf", "problem"),
    [
        ('<group name="g"><joint name="j_on"/></group>', "2: the model has no joint 'j_on'; did you mean 'j_one'?"),
        ('<group name="g">\n<link name="thre"/></group>', "3: the model has no link 'thre'; did you mean 'three'?"),
        ('<disable_collisions link1="one" link2="tol"/>', "2: the model has no link 'tol'; did you mean 'tool'?"),
        ('<group name="g"><group name="h"/></group>', "2: there is no group 'h' (allowed: g)"),
        ('<group name="g"><group name="g"/></group>', "2: group 'g' contains itself; remove it from group 'g'"),
        ('<group name="g"><chain base_link="tool" tip_link="one"/></group>', "2: no chain of joints leads from link"),
        ('<group_state name="s" group="arms"/>', "2: there is no group 'arms'"),
        ('<passive_joint name="x"/>', "2: the model has no joint 'x'"),
        (
            '<group name="g"/><group_state name="s" group="g"><joint name="j_one" value="nan"/></group_state>',
            "2: value=\"nan\" of joint 'j_one': expected a finite number in rad or m",
        ),
    ],
)
def test_what_does_not_fit_the_model_is_told_with_its_line(srdf: str, problem: str, tmp_path: Path) -> None:
    with pytest.raises(RefusedModel) as caught:
        model_with(tmp_path, srdf)
    (found,) = caught.value.problems
    assert f"{found.location.line}: {found.message}".startswith(problem)


def test_a_cycle_of_groups_is_refused(tmp_path: Path) -> None:
    names = ("a", "b", "c")
    groups = "\n".join(
        f'<group name="{name}"><group name="{inner}"/></group>' for name, inner in zip(names, "bca", strict=True)
    )
    with pytest.raises(RefusedModel) as caught:
        model_with(tmp_path, groups)
    (found,) = caught.value.problems
    line = found.location.line or 0
    outer, inner = names[line - 2], names[(line - 1) % 3]
    assert found.message == f"group '{inner}' contains itself; remove it from group '{outer}'"


@pytest.mark.parametrize("times", [1, 2], ids=["chain", "doubled"])
def test_many_groups_inside_each_other_are_read_in_a_moment(times: int, tmp_path: Path) -> None:
    """Each group is read once: the same group twice in each of these would otherwise be 2^1100 joints to collect."""
    groups = [f'<group name="g{i}">{times * f"""<group name="g{i + 1}"/>"""}</group>' for i in range(1100)]
    model = model_with(tmp_path, "\n".join((*groups, '<group name="g1100"><joint name="j_two"/></group>')))
    assert model.srdf is not None
    assert model.srdf.groups["g0"] == ("j_two",)


def test_the_srdf_of_another_robot_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedModel, match="this SRDF is of robot 'leg', and the model is 'arm'"):
        model_with(tmp_path, "", name="leg")


@pytest.mark.parametrize("text", ["<robot", "<sdf/>", urdf()])
def test_what_is_no_srdf_is_refused(text: str, tmp_path: Path) -> None:
    model_with(tmp_path, "")
    (tmp_path / "arm.srdf").write_text(text)
    with pytest.raises(ModelError, match=r"arm\.srdf"):
        load_model(Robot(model="arm.urdf", srdf="arm.srdf"), Workspace(tmp_path, tmp_path))


SCENARIO = """\
name: arm
robot:
  model: arm.urdf
  base: fixed
  srdf: {srdf}
  joints: {{arm: 0.5}}
expect: [settled]
time_limit: 1 s
"""


def test_a_scenario_sets_the_joints_of_a_group_and_a_missing_file_is_told_at_its_key(tmp_path: Path) -> None:
    model_with(tmp_path, "")
    expand = "an SRDF must be expanded: run xacro arm.srdf.xacro > arm.srdf, and"
    names = {"arms.srdf": "", "../arm.srdf": "", "package://nothing/other.srdf": "", "arm.srdf.xacro": expand}
    for srdf, message in names.items():
        (problem,) = told(tmp_path, SCENARIO.format(srdf=srdf))
        assert problem.startswith(f"5:3: robot.srdf: {message}")
    model_with(tmp_path, '<group name="arm"><chain base_link="base" tip_link="two"/></group>')
    loaded = load(tmp_path, SCENARIO.format(srdf="arm.srdf"))
    assert loaded.model is not None
    assert joints_set_by(loaded.model, loaded.scenario.robot.joints) == {"arm": ("j_one", "j_two")}


def test_parts_that_are_not_read_are_named(tmp_path: Path) -> None:
    model = model_with(
        tmp_path,
        '<group name="g"><joint name="j_one"/><lnk name="base"/></group><end_effector name="hand"/>\n'
        '<virtual_joint name="v" type="fixed"/><disable_collision link1="one" link2="tool"/>'
        '<passive_joint name="j_one" x="1"/><group_state name="up" group="g"/>',
    )
    messages = [f"{note.rule} {note.location.line}: {note.message}" for note in (*model.findings, *model.harmless)]
    for part in (
        "unknown-tag 2: unknown element <lnk> in <group> is ignored; did you mean <link>?",
        "unknown-tag 3: unknown element <disable_collision> in <robot> is ignored; did you mean <disable_collisions>?",
        "passed-over 3: <passive_joint> of the SRDF is not simulated; it is ignored: it is checked, but the joint",
        "passed-over 3: <group_state> of the SRDF is not simulated; it is ignored: it is checked, but no key names a",
        "harmless-part 2: <end_effector>",
        'harmless-part 3: <virtual_joint type="fixed">',
    ):
        assert any(message.startswith(part) for message in messages), (part, messages)


@pytest.mark.parametrize(
    ("srdf", "effect"),
    [
        ('<disable_collisions link1="base" link2="two"/>', {"disabled": {frozenset(("base", "two"))}}),
        (
            '<disable_default_collisions link="tool"/><enable_collisions link1="tool" link2="base"/>',
            {"disabled": {frozenset(("tool", name)) for name in ("one", "two", "three")}},
        ),
        ('<group name="g"><chain base_link="base" tip_link="one"/></group>', {"groups": {"g": ("j_one",)}}),
    ],
)  # fmt: skip
def test_a_part_that_is_read_acts(srdf: str, effect: dict[str, object], tmp_path: Path) -> None:
    model = model_with(tmp_path, srdf)
    assert model.srdf is not None
    assert {name: vars(model.srdf)[name] for name in effect} == effect
    assert not [note for note in (*model.findings, *model.harmless) if "SRDF" in note.message]


@pytest.mark.parametrize(
    ("srdf", "note"),
    [("<passive_joint name='j_two'/>", "<passive_joint> of the SRDF is not"), ("<group", "the SRDF beside the model")],
)
@pytest.mark.parametrize("names", ["arm.srdf", None])
def test_inspect_reads_the_srdf_that_is_named_or_lies_beside_the_model(
    srdf: str, note: str, names: str | None, tmp_path: Path
) -> None:
    model_with(tmp_path, "")
    (tmp_path / "arm.srdf").write_text(f'<robot name="arm">{srdf}</robot>')
    robot = Robot(model="arm.urdf", base="fixed", srdf=names)
    if names and srdf == "<group":
        with pytest.raises(ModelError, match=r"arm\.srdf"):
            inspect_model(robot, Workspace(tmp_path, tmp_path))
        return
    found = inspect_model(robot, Workspace(tmp_path, tmp_path))
    assert note in " ".join(losses_text(found).split())
    assert ("# srdf: arm.srdf" in found.robot) == (names is None)


def test_an_srdf_is_refused_as_the_model(tmp_path: Path) -> None:
    model_with(tmp_path, "")
    with pytest.raises(ModelError, match=r"this file in robot\.srdf"):
        load_model(Robot(model="arm.srdf"), Workspace(tmp_path, tmp_path))

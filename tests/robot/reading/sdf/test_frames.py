"""Frames of SDF: where links are, by hand."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sim_action.core.geometry import Vector3
from tests.robot.reading.sdf.models import facing, joint, link, load, near, position, sdf
from tests.ros_workspace import written

HALF = math.pi / 2
QUARTER_TURN = f"0 0 0 0 0 {HALF}"


def test_a_link_is_placed_in_the_models_frame_and_a_turned_root_turns_what_it_sees(tmp_path: Path) -> None:
    parts = (link("a", "<pose>1 0 0 0 0 0</pose>"), link("b", "<pose>1 2 0 0 0 0</pose>"), joint("j", "a", "b"))
    model = load(tmp_path, sdf(*parts))
    assert (model.root, position(model, "b")) == ("a", near(0, 2, 0))
    root, child = link("a", f"<pose>{QUARTER_TURN}</pose>"), link("b", "<pose>0 2 0 0 0 0</pose>")
    model = load(tmp_path, sdf(root, child, joint("j", "a", "b")))
    assert position(model, "b") == near(2, 0, 0)
    assert facing(model, "b") == near(0, -1, 0)
    (finding,) = model.findings
    assert finding.rule == "turned-base"
    assert finding.message.endswith("robot.pose: {yaw: 90 deg}")
    assert finding.location.line == 3


@pytest.mark.parametrize(
    ("pose", "expected"),
    [
        ('<pose relative_to="a">0 0 1 0 0 0</pose>', (0, 0, 1)),
        ('<pose relative_to="f">0 0 1 0 0 0</pose>', (5, 0, 1)),
        ('<pose relative_to="j">0 0 1 0 0 0</pose>', (0, 7, 1)),
        ('<pose relative_to="__model__">0 0 1 0 0 0</pose>', (-3, 0, 1)),
        ('<pose relative_to="">0 0 1 0 0 0</pose>', (-3, 0, 1)),
        ("<pose/>", (-3, 0, 0)),
        ('<pose relative_to="g"/>', (5, 0, 2)),
    ],
)
def test_a_link_is_placed_relative_to_what_its_pose_names(pose: str, expected: Vector3, tmp_path: Path) -> None:
    parts = (
        link("a", "<pose>3 0 0 0 0 0</pose>"),
        '<frame name="f" attached_to="a"><pose>5 0 0 0 0 0</pose></frame>',
        '<frame name="g"><pose relative_to="f">0 0 2 0 0 0</pose></frame>',
        link("b", pose),
        joint("j", "a", "b", '<pose relative_to="a">0 7 0 0 0 0</pose>'),
    )
    assert position(load(tmp_path, sdf(*parts)), "b") == near(*expected)


@pytest.mark.parametrize(
    "pose",
    [
        f"<pose>1 2 3 0 0 {HALF}</pose>",
        '<pose degrees="true">1 2 3 0 0 90</pose>',
        '<pose rotation_format="quat_xyzw">1 2 3 0 0 1 1</pose>',
        '<pose rotation_format="euler_rpy" degrees="1">\n  1 2 3\n  0 0 90\n</pose>',
    ],
)
def test_a_rotation_is_written_in_three_ways(pose: str, tmp_path: Path) -> None:
    model = load(tmp_path, sdf(link("a"), link("b", pose), joint("j", "a", "b")))
    assert (position(model, "b"), facing(model, "b")) == (near(1, 2, 3), near(0, 1, 0))


def test_a_long_chain_of_frames_is_followed(tmp_path: Path) -> None:
    attached = [("f0", "a"), *((f"f{n}", f"f{n - 1}") for n in range(1, 5_000))]
    pose = "<pose>0.01 0 0 0 0 0</pose>"
    frames = [f'<frame name="{name}" attached_to="{other}">{pose}</frame>' for name, other in attached]
    parts = (link("a"), link("b", '<pose relative_to="f4999"/>'), joint("j", "f4999", "b"))
    model = load(tmp_path, sdf(*parts, *reversed(frames)))
    assert model.joints[0].parent == "a"
    assert position(model, "b") == pytest.approx((50, 0, 0))


def test_a_joint_joins_the_links_that_frames_are_attached_to(tmp_path: Path) -> None:
    parts = (
        link("a"),
        link("b", "<pose>4 0 0 0 0 0</pose>"),
        '<frame name="mount" attached_to="a"><pose>1 0 0 0 0 0</pose></frame>',
        '<frame name="flange" attached_to="grip"/>',
        '<frame name="grip" attached_to="b"><pose>1 0 0 0 0 0</pose></frame>',
        joint("j", "mount", "flange", "<axis><xyz>0 0 1</xyz></axis>", "continuous"),
    )
    model = load(tmp_path, sdf(*parts))
    (made,) = model.joints
    assert (made.parent, made.child) == ("a", "b")
    # The joint is where the flange is, 1 m in front of its link.
    assert position(model, "b") == near(5, 0, 0)


def test_a_models_frame_is_attached_to_its_canonical_link(tmp_path: Path) -> None:
    inner = f'<model name="arm" canonical_link="b">{link("a")}{link("b")}{joint("j", "a", "b")}</model>'
    on_arm = joint("k", "arm", "tool")
    assert load(tmp_path, sdf(inner, link("tool"), on_arm)).joints_by_name["k"].parent == "arm::b"
    # Else to the first link. The parts of a merged model stand where its <include> stands.
    written(tmp_path / "arm.sdf", sdf(link("a")))
    body = f'<include merge="true"><uri>arm.sdf</uri></include>{link("b")}{joint("j", "a", "b")}'
    model = load(tmp_path, sdf(f'<model name="inner">{body}</model>', link("tool"), joint("k", "inner", "tool")))
    assert model.joints_by_name["k"].parent == "inner::a"


def test_in_old_files_a_joint_may_have_the_name_of_a_link(tmp_path: Path) -> None:
    parts = (joint("b", "a", "b"), link("a"), link("b"), joint("c", "b", "c"), link("c"))
    model = load(tmp_path, sdf(*parts, version="1.6"))
    assert [(joint.parent, joint.child) for joint in model.joints] == [("a", "b"), ("b", "c")]

"""Places that a link cannot come to: refused where that is certain, and only there."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.errors import InvalidScenario, Problem
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose
from sim_action.core.workspace import Workspace
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.world import Physics, World
from sim_action.world.robot_reach import range_of
from sim_action.world.scene import Scene
from tests.scenario.test_checks import INERTIAL
from tests.scenarios import load
from tests.soak import examples
from tests.traces import HERE

LIMIT: Final = '<limit lower="-0.1" upper="0.2" effort="5" velocity="5"/>'
# Two arms on a base: one of 0.3 m and 0.2 m, one with a slide.
ARMS: Final = f"""\
<robot name="arms">
  <link name="trunk">{INERTIAL}</link>
  <joint name="lift" type="prismatic"><parent link="trunk"/><child link="slider"/>
    <origin xyz="0 -0.2 0.1" rpy="0.3 0 0"/><axis xyz="0 0 1"/>{LIMIT}</joint>
  <link name="slider">{INERTIAL}</link>
  <joint name="shoulder" type="continuous"><parent link="trunk"/><child link="upper"/>
    <origin xyz="0.1 0 0.5"/><axis xyz="0 0 1"/></joint>
  <link name="upper">{INERTIAL}</link>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.3 0 0" rpy="0 0.5 0"/><axis xyz="0 1 0"/></joint>
  <link name="lower">{INERTIAL}</link>
  <joint name="flange" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0.2 0 0"/></joint>
  <link name="tool">{INERTIAL}</link>
  <joint name="rail" type="planar"><parent link="trunk"/><child link="cart"/><axis xyz="0 0 1"/></joint>
  <link name="cart">{INERTIAL}</link>
</robot>
"""


def refused(folder: Path, text: str, rule: str = "") -> list[Problem]:
    try:
        load(folder, text)
    except InvalidScenario as error:
        return [problem for problem in error.problems if rule in problem.message]
    return []


def scenario(expect: str, base: str = "fixed", pose: str = "{x: 1, z: 2, yaw: 90 deg}") -> str:
    robot = f"robot: {{model: robot.urdf, base: {base}, pose: {pose}}}"
    return f"name: a\n{robot}\nexpect:\n  - {expect}\ntime_limit: 5 s\n"


@pytest.fixture
def arms(tmp_path: Path) -> Path:
    (tmp_path / "robot.urdf").write_text(ARMS)
    return tmp_path


# The shoulder is at (1, 0.1, 2.5) in the world, and at (0.1, 0, 0.5) in the base; the tool is at most 0.5 m from it.
@pytest.mark.parametrize(
    ("place", "reachable"),
    [
        ("x: 1, y: 0.1, z: 3.0499", True),
        ("x: 1, y: 0.1, z: 3.0501", False),
        ("x: 1, y: 0.6499", True),
        ("x: 1, y: 0.6501", False),
        ("frame: base, x: -0.4499, y: 0, z: 0.5", True),
        ("frame: base, x: -0.4501, y: 0, z: 0.5", False),
        ("frame: trunk, x: -0.4501, y: 0", False),
        ("frame: lower, x: 0, y: 0, z: 0.25", True),
        ("frame: upper, x: 0.5501, y: 0, z: 0", False),
        # Between the slider, which lifts by at most 0.2 m and 5 %, and the tool there are 0.2 + 0.412 + 0.5 m.
        ("frame: slider, x: 0, y: 1.2, z: 0", True),
        ("frame: slider, x: 0, y: 1.3, z: 0", False),
        ("frame: cart, x: 0, y: 100, z: 0", True),
    ],
)
def test_a_place_beyond_the_length_of_the_arm(arms: Path, place: str, reachable: bool) -> None:
    problem = refused(arms, scenario(f"reach: {{link: tool, {place}}}"), "unreachable-target")
    assert (not problem) == reachable


@pytest.mark.parametrize(
    ("limits", "y", "point"),
    [
        ("max_error: 0.1", 0.599, None),
        ("max_error: 0.1", 0.601, 1),
        ("max_error: 0.2, end: {tolerance: 0.1}", 0.601, 1),
        ("end: {tolerance: 0.1}", 0.599, None),
        ("rms: 0.1", 5.0, None),
        ("max_error: 9", 0.7, None),
    ],
)
def test_a_point_of_a_path_beyond_the_length_of_the_arm(arms: Path, limits: str, y: float, point: int | None) -> None:
    points = f"[{{x: 0.1, y: 0.4}}, {{x: 0.1, y: {y}}}]"
    problems = refused(arms, scenario(f"follow_path: {{link: tool, frame: base, path: {points}, {limits}}}"))
    found = [problem.message.split(": ")[0] for problem in problems if "[unreachable-target]" in problem.message]
    assert found == [f"expect.0.follow_path.path.{point}"] * (point is not None)


def test_the_message_says_how_far_it_is(arms: Path) -> None:
    text = scenario("final_pose: {link: tool, frame: base, z: 1.25, tolerance: 10 cm}")
    (problem,) = refused(arms, text, "unreachable-target")
    assert problem.location.line == 4
    assert problem.message == (
        "expect.0.final_pose: this place is 0.75 m from joint 'shoulder', but tool reaches at most 0.5 m from there; "
        "move it, or the robot; check 'frame', which is base [unreachable-target]"
    )


@pytest.mark.parametrize(
    "text",
    [
        scenario("reach: {link: tool, x: 100, y: 0}", base="free"),
        scenario("reach: {link: tool, x: 1, y: 0, z: 100}", pose="{x: 1}"),
        scenario("final_pose: {link: tool, relative: true, x: 100}"),
        scenario("reach: {link: cart, x: 100, y: 0}"),
        f"{scenario('reach: {link: tool, x: 100, y: 0}')}allow: [unreachable-target]\n",
        scenario("reach: {link: toll, x: 100, y: 0}"),
        scenario("reach: {link: tool, frame: wrld, x: 100, y: 0}"),
    ],
    ids=["free base", "unknown height", "relative", "slide without limits", "allowed", "no link", "no frame"],
)
def test_only_certain_findings_are_reported(arms: Path, text: str) -> None:
    assert refused(arms, text, "unreachable-target") == []


@pytest.mark.parametrize(
    ("bounds", "escapes"),
    [
        ("z: [0, 1]", False),
        ("z: [0.01, 1]", True),
        ("x: [-0.4, 0.6], y: [-0.5, 0.5], z: [0, 1]", False),
        ("x: [-0.4, 0.6], y: [-0.5, 0.49], z: [0, 1]", True),
    ],
)
def test_bounds_that_a_link_cannot_leave(arms: Path, bounds: str, escapes: bool) -> None:
    text = scenario(f"stay_within: {{link: tool, frame: base, {bounds}}}")
    problem = refused(arms, text, "unreachable-limit")
    assert (not problem) == escapes
    assert escapes or "tool cannot leave these bounds: it is never more than 0.5 m from joint" in problem[0].message


# The tool is at most 0.5 m from the shoulder, which is at (0.1, 0, 0.5) in the base.
@pytest.mark.parametrize(
    ("expect", "key"),
    [
        ("final_pose: {link: tool, frame: base, x: 0.1, tolerance: 0.501}", "tolerance"),
        ("final_pose: {link: tool, frame: base, x: 0.1, tolerance: 0.499}", ""),
        ("final_pose: {link: tool, frame: base, x: 0.1, y: 0.3, z: 0.9, tolerance: 1.001}", "tolerance"),
        ("final_pose: {link: tool, frame: base, x: 0.1, y: 0.3, z: 0.9, tolerance: 0.999}", ""),
        ("final_pose: {link: tool, relative: true, x: 0.3, tolerance: 1.301}", "tolerance"),
        ("final_pose: {link: tool, relative: true, x: 0.3, tolerance: 1.299}", ""),
        ("final_pose: {link: tool, frame: base, yaw: 0}", ""),
        ("travel: {link: tool, at_most: 1.001}", "at_most"),
        ("travel: {link: tool, at_most: 0.999}", ""),
        ("travel: {link: tool, at_least: 0.1}", ""),
        (
            "follow_path: {link: tool, frame: base, path: [{x: 0.1, y: 0}, {x: 0.1, y: 0.2}], max_error: 0.701}",
            "max_error",
        ),
        ("follow_path: {link: tool, frame: base, path: [{x: 0.1, y: 0}, {x: 0.1, y: 0.2}], max_error: 0.699}", ""),
        ("follow_path: {link: tool, path: [{x: 1, y: 0, z: 1}, {x: 1, y: 0.1, z: 2.5}], rms: 2.1}", "rms"),
        ("follow_path: {link: tool, path: [{x: 1, y: 0, z: 1}, {x: 1, y: 0.1, z: 2.5}], rms: 1.9}", ""),
    ],
)
def test_distances_that_no_place_of_a_link_exceeds(arms: Path, expect: str, key: str) -> None:
    found = refused(arms, scenario(expect), "unreachable-limit")
    assert [problem.message.split(": ")[0].rpartition(".")[2] for problem in found] == [key] * bool(key)
    assert all("because tool is never more than" in problem.message for problem in found)
    # The height of the base is not known, and a base that moves may be anywhere.
    free = [scenario(expect, base="free"), scenario(expect.replace(", x: ", ", z: 1, x: "), pose="{x: 1}")]
    if "frame" not in expect and "relative" not in expect and "travel" not in expect:
        assert all(refused(arms, text, "unreachable-limit") == [] for text in free)


@pytest.mark.parametrize(
    ("expect", "rigid"),
    [
        ("reach: {link: trunk, x: 0, y: 0}", "link 'trunk' never moves in the frame 'world'"),
        ("max_speed: {link: tool, frame: lower, linear: 1}", "link 'tool' never moves in the frame 'lower'"),
        ("not: {upright: {link: lower, frame: tool}}", "link 'lower' never moves in the frame 'tool'"),
        ("settled: {link: tool, frame: lower}", "link 'tool' never moves in the frame 'lower'"),
        ("reach: {frame: tool, x: 0, y: 0}", ""),
        ("settled: {link: tool, frame: lower, joints: true}", ""),
        ("max_speed: {link: tool, frame: base, linear: 1}", ""),
        ("max_speed: {link: tool, linear: 1}", ""),
    ],
)
def test_a_link_that_no_joint_moves_in_its_frame(arms: Path, expect: str, rigid: str) -> None:
    problem = refused(arms, scenario(expect), "fixed-base")
    assert bool(problem) == bool(rigid)
    assert all(f"{rigid}: no joint is between them" in one.message for one in problem)


def test_a_base_link_with_the_name_of_the_world_frame(tmp_path: Path) -> None:
    text = "name: a\nrobot: {model: ur5e_gripper}\nexpect:\n  - max_speed: {link: world, linear: 1}\ntime_limit: 5 s\n"
    (problem,) = refused(tmp_path, text, "fixed-base")
    assert "link 'world' never moves in the frame 'world'" in problem.message


@pytest.mark.parametrize("expect", ["max_speed: {link: tool, linear: 300 m/s}", "travel: {link: tool, at_most: 2 km}"])
def test_the_limits_of_a_run_are_those_of_its_base(arms: Path, expect: str) -> None:
    assert refused(arms, scenario(expect, base="free")) == []


def test_an_orientation_that_none_exceeds(arms: Path) -> None:
    text = scenario("reach: {link: tool, x: 1, y: 0.1, orientation: {tolerance: 180 deg}}")
    (problem,) = refused(arms, text, "unreachable-limit")
    assert "two orientations are at most 180 deg apart" in problem.message


def scene_of(model: RobotModel, robot: Robot) -> Scene:
    return Scene(robot, model, World(), Physics(), HERE)


ANGLES = st.floats(-math.pi, math.pi)


@examples(60)
@given(st.data())
def test_no_position_of_the_joints_is_beyond_the_range(data: st.DataObject) -> None:
    robot = Robot(model="ur5e_gripper", pose=Placement(x=1.0, z=0.5, roll=0.3, yaw=-1.0))
    model = load_model(robot, Workspace(Path("/"), Path("/")))
    link = data.draw(st.sampled_from([link.name for link in model.links]))
    frame = data.draw(st.sampled_from(["world", *(link.name for link in model.links)]))
    limits = range_of(scene_of(model, robot), link, frame)
    if limits is None:
        return
    positions = {
        joint.name: data.draw(ANGLES if joint.type == "revolute" else st.floats(joint.lower or 0.0, joint.upper or 0.0))
        for joint in model.moving_joints
    }
    poses = link_poses(model, positions)
    assert robot.pose.z is not None
    base = Pose((1.0, 0.0, 0.5), robot.pose.orientation_xyzw)
    back = Pose() if frame == "world" else geometry.inverse(geometry.compose(base, poses[frame]))
    place = geometry.compose(back, geometry.compose(base, poses[link])).position_xyz
    assert limits.distance(dict(zip("xyz", place, strict=True))) <= limits.radius + 1e-9

"""A link along straight lines: times and joints at each tick, against formulas, and messages before anything runs."""

from __future__ import annotations

import dataclasses
import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, Literal

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sim_action.commands import ClosedLoop, OpenLoop, link_path
from sim_action.commands import pose as pose_module
from sim_action.commands.joints import BLENDS
from sim_action.commands.link_path import Blocked, Follower, Leg, LinkPath, between
from sim_action.commands.pose import PoseCommands
from sim_action.core import geometry
from sim_action.core.errors import ScriptError, SourceProblem
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, Twist
from sim_action.core.workspace import Workspace
from sim_action.robot.model.inverse_kinematics import Chain, Solution, Values, reach
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.robot.reading.urdf import read_urdf
from sim_action.state.command import JointTargets
from sim_action.state.observation import Observation
from sim_action.world import Physics, World
from sim_action.world.scene import Scene
from tests.robot.model.test_inverse_kinematics import INERTIAL, A, B, joint, limits
from tests.scenarios import told
from tests.soak import examples

HERE: Final = Workspace(Path(__file__).parent, Path(__file__).parent)
START: Final = {
    "shoulder_lift_joint": "-87.94 deg",
    "elbow_joint": "98.91 deg",
    "wrist_1_joint": "-100.97 deg",
    "wrist_2_joint": "-90 deg",
}
START_XYZ: Final = (0.50001, 0.1333, 0.41299)  # there the flange points down


def arm(**pose: float) -> Scene:
    robot = Robot(model="ur5e_gripper", joints=dict(START), pose=Placement(**pose))
    return Scene(robot, load_model(robot, HERE), World(), Physics(), HERE)


def spec(*waypoints: dict[str, Any], link: str = "tool0", rate: float = 40.0, **keys: Any) -> PoseCommands:
    return PoseCommands.model_validate({"pose": {"link": link, "waypoints": waypoints, **keys}, "rate": rate})


def targets(commands: PoseCommands, scene: Scene, end: float) -> list[JointTargets]:
    """The targets at all ticks until a time in s, where the source still answers."""
    controller = commands.open(scene)
    assert isinstance(controller, OpenLoop)
    times = [tick / commands.rate for tick in range(round(end * commands.rate))]
    found = [(controller.command(time), time) for time in times]
    return [moved(each, time) for each, time in found if isinstance(each, JointTargets)]


def moved(commanded: JointTargets, time: float) -> JointTargets:
    (motion,) = commanded.motions
    states = [curve.at(time) for curve in motion.curves]
    position, velocity, _ = zip(*states, strict=True)
    return JointTargets(dict(zip(motion.names, position, strict=True)), dict(zip(motion.names, velocity, strict=True)))


def at_ticks(found: list[JointTargets], _: PoseCommands) -> list[dict[str, float]]:
    return [dict(each.position) for each in found]


def flange(scene: Scene, positions: dict[str, float]) -> Pose:
    base = Pose((scene.robot.pose.x, scene.robot.pose.y, scene.robot.pose.z or 0.0), scene.robot.pose.orientation_xyzw)
    return geometry.compose(base, link_poses(scene.model, scene.model.positions(positions))["tool0"])


def off_line(point: geometry.Vector3, start: geometry.Vector3, end: geometry.Vector3) -> float:
    """The distance of a point from a line through two others, in m."""
    along = [b - a for a, b in zip(start, end, strict=True)]
    away = [p - a for a, p in zip(start, point, strict=True)]
    x, y, z = geometry.cross((along[0], along[1], along[2]), (away[0], away[1], away[2]))
    return math.hypot(x, y, z) / math.hypot(*along)


def test_the_link_is_on_the_line_at_every_tick_and_at_the_waypoint_in_time() -> None:
    scene, commands = arm(), spec({"x": 0.4, "y": -0.1, "z": 0.3, "at": 1.5})
    found = at_ticks(targets(commands, scene, 3.0), commands)
    # One tick more than the path, with a speed of 0; then the targets stay.
    assert len(found) == 62
    poses = [flange(scene, positions) for positions in found]
    assert poses[0].position_xyz == pytest.approx(START_XYZ, abs=1e-5)
    for pose in poses:
        assert off_line(pose.position_xyz, poses[0].position_xyz, (0.4, -0.1, 0.3)) < 1e-5
        turn = geometry.twist_between(poses[0], pose, 1.0).angular_xyz
        assert math.hypot(*turn) < 2e-5
    assert poses[60].position_xyz == pytest.approx((0.4, -0.1, 0.3), abs=1e-6)
    # Minimum jerk: half way at half time, and 1.875 times the mean speed there.
    half, whole = (math.dist(poses[tick].position_xyz, poses[0].position_xyz) for tick in (30, 60))
    assert half == pytest.approx(whole / 2, abs=1e-6)


@pytest.mark.parametrize(("interpolation", "peak"), [("minimum_jerk", 1.875), ("linear", 1.0)])
def test_the_speed_is_the_largest_on_the_way(interpolation: str, peak: float) -> None:
    scene = arm()
    commands = spec({"z": 0.3}, speed=0.1, interpolation=interpolation)
    poses = [flange(scene, positions) for positions in at_ticks(targets(commands, scene, 5.0), commands)]
    speeds = [math.dist(a.position_xyz, b.position_xyz) * 40 for a, b in pairwise(poses)]
    way = START_XYZ[2] - 0.3
    assert max(speeds) <= 0.1 + 1e-5
    assert max(speeds) == pytest.approx(0.1, rel=0.01)
    # A straight motion needs the time of two ramps in addition.
    ramps = 0.02 if peak == 1.0 else 0.0
    assert commands.arrivals(scene) == pytest.approx((peak * way / 0.1 + ramps,), abs=1e-4)


def test_a_turn_takes_its_own_time() -> None:
    scene = arm()
    commands = spec({"yaw": math.radians(-60)}, turn_speed=math.radians(30), interpolation="linear")
    poses = [flange(scene, positions) for positions in at_ticks(targets(commands, scene, 5.0), commands)]
    # From -90 to -60 deg, at 30 deg/s, after a ramp of 20 ms.
    assert commands.arrivals(scene) == pytest.approx((1.02,), abs=1e-5)
    for tick in (0, 10, 20, 40):
        heading = geometry.rotate(poses[tick].orientation_xyzw, (1.0, 0.0, 0.0))
        late = 0.3 if tick else 0.0
        assert math.degrees(math.atan2(heading[1], heading[0])) == pytest.approx(-90 + 30 * tick / 40 - late, abs=2e-3)
        assert poses[tick].position_xyz == pytest.approx(START_XYZ, abs=1e-5)


def test_coordinates_keep_their_last_value_and_the_link_waits() -> None:
    path = spec({"x": 0.4, "at": 1.0, "hold": 0.5}, {"z": 0.2, "at": 2.0}, {"yaw": 1.0, "at": 3.0}).path(
        Pose((0.5, 0.1, 0.4), geometry.quaternion_from_rpy(math.pi, 0, 0.5))
    )
    assert [(leg.start, leg.end) for leg in path.legs] == [(0.0, 1.0), (1.5, 2.0), (2.0, 3.0)]
    assert [leg.goal.position_xyz for leg in path.legs] == [(0.4, 0.1, 0.4), (0.4, 0.1, 0.2), (0.4, 0.1, 0.2)]
    assert path.pose(1.2) == path.pose(1.0) == path.legs[0].goal
    assert path.pose(-1.0) == path.rest
    assert path.pose(9.0) == path.legs[-1].goal
    angles = geometry.rpy_from_quaternion(path.legs[2].goal.orientation_xyzw)
    assert math.remainder(angles[0] - math.pi, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert angles[1:] == pytest.approx((0.0, 1.0), abs=1e-9)
    # A way takes the time of its speed.
    path = spec({"x": 0.4, "speed": 0.3}, {"x": 0.5, "at": 1.01}, rate=10).path(Pose((0.5, 0.1, 0.4)))
    # 1.875 x 0.1 m / 0.3 m/s = 0.625 s.
    assert [leg.end for leg in path.legs] == pytest.approx([0.625, 1.01])


def test_a_straight_path_passes_waypoints_and_cuts_corners_by_a_millimetre() -> None:
    scene = arm()
    corner = (START_XYZ[0] - 0.1, START_XYZ[1])
    commands = spec({"x": corner[0]}, {"y": corner[1] + 0.1}, speed=0.25, interpolation="linear", rate=1000.0)
    found = targets(commands, scene, 1.0)
    xyz = [flange(scene, dict(each.position)).position_xyz for each in found]
    speeds = [math.dist(a, b) * 1000 for a, b in pairwise(xyz)]
    assert max(speeds) == pytest.approx(0.25, rel=0.02)
    turns = commands.arrivals(scene)[0]
    near = [speed for index, speed in enumerate(speeds) if abs(index / 1000 - turns) < 0.02]
    assert min(near) > 0.15
    assert 0.0005 < min(math.dist(at[:2], corner) for at in xyz) < 0.0012
    accelerations = [
        max(abs(later.velocity[name] - each.velocity[name]) * 1000 for name in each.velocity)
        for each, later in pairwise(found)
    ]
    # From 0.25 m/s to rest, and round the corner, in 20 ms.
    assert max(accelerations) < 3 * 0.25 * 2**0.5 / 0.02 / 0.3


@given(st.tuples(*[st.floats(-1, 1)] * 3), st.tuples(*[st.floats(-3, 3)] * 3), st.floats(0, 1), st.floats(0, 1))
@examples(20)
def test_a_line_has_one_speed_and_turns_about_one_axis(
    place: tuple[float, float, float], angles: tuple[float, float, float], one: float, other: float
) -> None:
    assume(abs(one - other) > 1e-3)
    start = Pose((0.1, 0.2, 0.3), geometry.quaternion_from_rpy(0.4, 0.5, 0.6))
    end = Pose(place, geometry.quaternion_from_rpy(*angles))
    whole = geometry.twist_between(start, end, 1.0)
    assume(math.hypot(*whole.angular_xyz) < math.pi - 0.01)
    part = geometry.twist_between(between(start, end, one), between(start, end, other), other - one)
    assert part.linear_xyz == pytest.approx(whole.linear_xyz, abs=1e-6)
    assert part.angular_xyz == pytest.approx(whole.angular_xyz, abs=1e-6)
    assert between(start, end, 1.0) == end


def test_the_world_and_the_base_are_two_frames() -> None:
    """A turned base: the same point of the world, given in both frames."""
    scene = arm(x=1.0, y=2.0, z=0.5, yaw=math.pi / 2)
    in_base = spec({"x": 0.4, "y": 0.2, "at": 1.0}, frame="base")
    in_world = spec({"x": 1.0 - 0.2, "y": 2.0 + 0.4, "at": 1.0})
    ends = [at_ticks(targets(each, scene, 2.0), each)[-1] for each in (in_base, in_world)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)
    assert flange(scene, ends[0]).position_xyz == pytest.approx((0.8, 2.4, 0.5 + START_XYZ[2]), abs=1e-5)


def test_joints_are_held_before_the_start_and_on_a_closed_path() -> None:
    scene, commands = arm(), spec({"z": 0.3})
    controller = commands.open(scene)
    assert isinstance(controller, OpenLoop)
    assert set(controller.holding.position) == commands.joints(scene)
    assert controller.holding.position["elbow_joint"] == pytest.approx(math.radians(98.91))
    assert len(commands.joints(scene)) == 6
    scene, commands = arm(), spec({"at": 1.0})
    (first, *_) = targets(commands, scene, 2.0)
    assert set(first.velocity.values()) == {0.0}


MOBILE: Final = "".join(
    (
        f'<robot name="mobile"><link name="base">{INERTIAL}</link>',
        joint("shoulder", "base", "upper", f'<axis xyz="0 0 1"/>{limits(-3, 3)}'),
        joint("elbow", "upper", "fore", f'<axis xyz="0 0 1"/>{limits(-3, 3)}', at=f"{A} 0 0"),
        joint("tip_joint", "fore", "tip", "", kind="fixed", at=f"{B} 0 0"),
        "</robot>",
    )
)


def mobile(folder: Path, base: Literal["free", "fixed"] = "free") -> Scene:
    path = folder / "mobile.urdf"
    path.write_text(MOBILE)
    robot = Robot(model="mobile.urdf", base=base, joints={"elbow": 0.5})
    return Scene(robot, read_urdf(path), World(), Physics(), Workspace(folder, folder))


def seen(tick: int, base: Pose) -> Observation:
    return Observation(tick / 40, base, Twist(), {})


def driving(tick: int) -> Observation:
    """A base that drives and turns at a constant twist."""
    base = Pose((0.002 * tick, -0.001 * tick, 0.3), geometry.quaternion_from_rpy(0, 0, 0.005 * tick))
    return Observation(tick / 40, base, Twist((0.08, -0.04, 0.0), (0.0, 0.0, 0.2)), {})


def tip(scene: Scene, base: Pose, positions: dict[str, float]) -> Pose:
    return geometry.compose(base, link_poses(scene.model, positions)["tip"])


def test_a_free_base_is_corrected_at_every_tick(tmp_path: Path) -> None:
    """The base drives on and turns; the tip goes to its point in the world and stays there."""
    scene = mobile(tmp_path)
    commands = spec({"x": 0.5, "y": 0.4, "at": 0.5}, link="tip", orientation="free")
    controller = commands.open(scene)
    assert isinstance(controller, ClosedLoop)
    assert not controller.senses
    for tick in range(40):
        found = controller.command(driving(tick))
        assert isinstance(found, JointTargets)
        if tick >= 20:
            at = dict(moved(found, (tick + 1) / 40).position)
            assert tip(scene, driving(tick + 1).pose, at).position_xyz == pytest.approx((0.5, 0.4, 0.3), abs=1e-5)
    # It rises above the plane of the arm.
    with pytest.raises(ScriptError, match=r"link 'tip': the straight line leads out of reach: .* is 0.1 m out of"):
        controller.command(seen(40, Pose((0.0, 0.0, 0.4))))


def test_the_frame_of_a_free_base_moves_with_it(tmp_path: Path) -> None:
    controller = spec({"x": 0.5, "y": 0.4}, link="tip", orientation="free", frame="base").open(mobile(tmp_path))
    assert isinstance(controller, OpenLoop)


def test_a_fixed_base_that_stands_on_the_ground_is_seen_at_the_start(tmp_path: Path) -> None:
    scene = mobile(tmp_path, base="fixed")
    controller = spec({"x": 0.5, "y": 0.4, "z": 0.3, "at": 1}, link="tip", orientation="free").open(scene)
    assert isinstance(controller, ClosedLoop)
    base = Pose((0.0, 0.0, 0.3))
    for tick in range(42):
        found = controller.command(seen(tick, base))
    assert isinstance(found, JointTargets)
    xyz = tip(scene, base, dict(moved(found, 41 / 40).position)).position_xyz
    assert xyz == pytest.approx((0.5, 0.4, 0.3), abs=1e-6)
    assert controller.command(seen(50, base)) is None


# With the elbow at its limit of 3 rad, the tip is nearest to the shoulder.
NEAREST: Final = math.sqrt(A * A + B * B + 2 * A * B * math.cos(3))


@pytest.mark.parametrize(
    ("way", "missing"),
    [(A + B - 1e-3, None), (A + B + 1e-3, "0.001 m"), (NEAREST + 1e-3, None), (NEAREST - 1e-3, "0.001 m")],
)
def test_the_reach_of_two_links_by_formula(tmp_path: Path, way: float, missing: str | None) -> None:
    scene = mobile(tmp_path)
    commands = spec({"x": 0.8 * way, "y": 0.6 * way}, link="tip", orientation="free", frame="base")
    found = [message for _, message in commands.model_problems(scene)]
    if missing is None:
        assert not any("out of reach" in message for message in found)
    else:
        nearest = A + B if way > A else NEAREST
        at = f"({0.8 * nearest:.3f}, {0.6 * nearest:.3f}, 0.000)"
        assert found == [f"link 'tip' is {missing} out of reach; the nearest position is {at}"]


SCENARIO: Final = {
    "name": "reach out",
    "robot": {"model": "ur5e_gripper", "joints": START},
    "expect": [{"joint_within": {"position": {"elbow_joint": ["0 deg", "170 deg"]}}}],
    "time_limit": 5,
}


def problem(folder: Path, commands: object) -> str:
    """The only problem of a scenario with commands."""
    (message,) = told(folder, json.dumps({**SCENARIO, "commands": commands}, indent=1))
    return message


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        ({"link": "tool", "waypoints": [{"x": 0}]}, "pose.link: the robot has no link 'tool'; did you mean 'tool0'?"),
        (
            {"link": "base_link", "waypoints": [{"x": 0}]},
            "pose.link: no joint with a motor is between the base link 'world' and link 'base_link'",
        ),
        ({"waypoints": []}, "pose.waypoints: must not be empty"),
        ({"waypoints": [{"x": 0.4}], "frame": "table"}, "pose.frame: expected 'world' or 'base'"),
        ({"waypoints": [{"z": 0.3}, {"x": 1.5}]}, "pose.waypoints.1: link 'tool0' is 0.5"),
        (
            {"waypoints": [{"y": -0.3, "at": 0.1}]},
            (
                "_joint' would move at 884.4 deg/s, more than its velocity limit, 180 deg/s; the way "
                "takes 0.1 s and needs at least 0.5 s: lower the speed, or go another way"
            ),
        ),
        (
            {"waypoints": [{"y": 0.3}, {"y": 0, "at": 0.1}]},
            "pose.waypoints.1: 'at' must be later than 1.25025 s, when the link leaves the waypoint before it",
        ),
        (
            {"waypoints": [{"y": 0, "at": 1}, {"y": 0.1, "at": 1}]},
            "pose.waypoints.1.at: must be later than 1 s, the time before it",
        ),
        (
            {"waypoints": [{"y": 0, "hold": 1e308}, {"y": 0.1}]},
            "pose.waypoints.0.hold: must be at most 86,400 s, found 1e+308",
        ),
        (
            {"waypoints": [{"z": 0.4, "speed": 5e-324}, {"y": 0.1}]},
            "pose.waypoints.0: the link would arrive at inf s; a run lasts at most 86,400 s: raise the speed",
        ),
        (
            {"waypoints": [{"z": 0.4, "at": 1e308}, {"y": 0.1}]},
            "pose.waypoints.0: the link would arrive at 1e+308 s; a run lasts at most 86,400 s",
        ),
        ({"waypoints": [{"y": 0, "at": 1, "speed": 1}]}, "'speed' and 'at' cannot be combined"),
        (
            {"waypoints": [{"yaw": 0.1}], "orientation": "free"},
            "pose.waypoints.0: 'orientation: free' ignores roll, pitch and yaw; remove them",
        ),
        (
            {"link": "shoulder_link", "waypoints": [{"x": 0.1}]},
            "; only 1 joint moves it, so add 'orientation: free' if only its position counts",
        ),
        ({"waypoints": [{"x": -0.5, "y": 0.05}]}, "of the way to this waypoint, at ("),
    ],
)
def test_bad_input(tmp_path: Path, pose: dict[str, Any], message: str) -> None:
    assert message in problem(tmp_path, {"pose": {"link": "tool0", **pose}})


@pytest.mark.parametrize(
    ("waypoint", "message"),
    [
        ({}, "does not move the link, and does not wait: state a coordinate or an angle; to wait, 'hold: 1 s'"),
        ({"speed": 0.1}, "does not move the link"),
    ],
)
def test_waypoints_without_an_effect(tmp_path: Path, waypoint: dict[str, Any], message: str) -> None:
    for waypoints in ([waypoint], [waypoint, {"z": 0.35}]):
        pose = {"link": "tool0", "waypoints": waypoints}
        assert f"pose.waypoints.0: {message}" in problem(tmp_path, {"pose": pose})


def test_a_link_waits_before_its_first_way() -> None:
    scene = arm()
    waits, goes = spec({"hold": 0.5}, {"z": 0.35}), spec({"z": 0.35})
    still, moving = targets(waits, scene, 2.0), targets(goes, scene, 1.5)
    assert all(set(each.velocity.values()) == {0.0} for each in still[:20])
    late, early = at_ticks(still, waits)[20:], at_ticks(moving, goes)
    assert len(late) == len(early)
    for one, other in zip(late, early, strict=True):
        assert one == pytest.approx(other, abs=1e-9)
    assert waits.arrivals(scene) == pytest.approx((0.0, goes.arrivals(scene)[0] + 0.5))


def test_a_stated_orientation_that_the_link_has_takes_no_time() -> None:
    scene = arm()
    roll, pitch, yaw = geometry.rpy_from_quaternion(flange(scene, scene.joint_positions).orientation_xyzw)
    commands = spec({"roll": roll, "pitch": pitch, "yaw": yaw, "hold": 0.1}, {"z": 0.35})
    assert commands.arrivals(scene)[0] == 0.0
    assert targets(commands, scene, 1.0)


def test_a_joint_of_two_sources(tmp_path: Path) -> None:
    commands = [
        {"pose": {"link": "tool0", "waypoints": [{"z": 0.3}]}},
        {"joints": [{"at": 1, "position": {"elbow_joint": "90 deg"}}]},
    ]
    assert "'elbow_joint'" in problem(tmp_path, commands)


def test_a_start_beyond_half_a_turn_is_another_posture() -> None:
    """With its elbow down the same arm has the same flange, and keeps it down."""
    up = arm()
    down = dataclasses.replace(up, robot=up.robot.model_copy(update={"joints": {**START, "elbow_joint": "-98.91 deg"}}))
    for scene, sign in ((up, 1), (down, -1)):
        commands = spec({"z": flange(scene, scene.joint_positions).position_xyz[2] + 0.02})
        for each in targets(commands, scene, 1.0):
            assert each.position["elbow_joint"] * sign > 0


def test_long_paths_are_checked_before_the_run_up_to_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, far = mobile(tmp_path), [{"x": 5.0 + step} for step in range(40)]
    assert len(list(spec(*far, link="tip", orientation="free", frame="base").model_problems(scene))) == 10
    near: list[dict[str, Any]] = [{"x": 0.5, "y": 0.4}, {"x": 0.51}, {"x": 0.5}]
    late = spec(*near, {"x": 5.0}, link="tip", orientation="free", frame="base")
    assert [path[-1] for path, _ in late.model_problems(scene)] == [3]
    monkeypatch.setattr(pose_module, "MAX_CHECKED_WAYPOINTS", 3)
    assert list(late.model_problems(scene)) == []
    with pytest.raises(SourceProblem, match="out of reach"):
        late.open(scene)
    searched = list[int]()
    monkeypatch.setattr(pose_module, "MAX_CHECKED_SAMPLES", 10)
    monkeypatch.setattr(link_path, "reach", lambda *found, **_: searched.append(len(found)))
    assert list(spec(*near, link="tip", orientation="free", frame="base").model_problems(scene)) == []
    assert searched == []


def tracked(folder: Path) -> tuple[Scene, Follower]:
    """The arm on a base that moves, and what finds its joint positions."""
    where = mobile(folder)
    return where, Follower(Chain.of(where.model, "tip", {}), turns=False, rate=40.0)


def test_a_large_correction_is_followed_in_small_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The path moves on by 12 cm in one tick: the targets of the steps lie between its two ends."""
    _, follower = tracked(tmp_path)
    values = (0.0, 0.5)
    start = follower.chain.pose(values)
    x, y, z = start.position_xyz
    end = Pose((x, y - 0.12, z), start.orientation_xyzw)
    path = LinkPath((Leg(0, 0.0, 1 / 40, start, end, (False, False)),), start, BLENDS["linear"])
    asked = list[float]()

    def noted(chain: Chain, target: Pose, near: Values, *, turns: bool) -> Solution:
        asked.append(y - target.position_xyz[1])
        return reach(chain, target, near, turns=turns)

    monkeypatch.setattr(link_path, "reach", noted)
    follower.follow(path, 1, Pose(), values)
    assert asked == pytest.approx([0.01 * step for step in range(1, 13)])


def test_a_jump_to_another_posture_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The elbow on the other side of the line from the shoulder to the tip reaches the same point."""
    _, follower = tracked(tmp_path)
    chain, values = follower.chain, (0.0, 0.5)
    here = chain.pose(values)
    turn = 2 * math.atan2(here.position_xyz[1], here.position_xyz[0])
    other = (turn, -0.5)
    assert chain.pose(other).position_xyz == pytest.approx(here.position_xyz)
    monkeypatch.setattr(link_path, "reach", lambda *_, **__: Solution(other, chain.pose(other), 0.0, 0.0, 0.0))
    path = LinkPath((), here, BLENDS["linear"])
    with pytest.raises(Blocked, match="it would have to change its posture"):
        follower.follow(path, 1, Pose(), values)

"""Where links are and how they move, and the box around shapes, against points on the shapes and differences."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, Vector3, quaternion_from_rpy
from sim_action.core.lazy_numpy import FloatArray
from sim_action.meshes.collision_hulls import hull_lines, shrunk
from sim_action.robot.model.kinematics import (
    LinkMotion,
    LinkStates,
    beyond_limits,
    link_frames,
    link_motion,
    link_poses,
    motion_in,
    robot_box,
    too_fast,
    too_strong,
    why_no_frame,
    why_no_link,
)
from sim_action.robot.model.robot_model import (
    ENGINE_MARGIN_M,
    Joint,
    JointType,
    Link,
    Mimic,
    RobotModel,
    Shape,
    ball_angles,
    ball_joints,
)
from sim_action.robot.reading.urdf import read_urdf
from sim_action.state.observation import JointState
from sim_action.state.trace import Trace
from tests.robot.bad_models import GOOD
from tests.soak import examples

QUARTER = math.pi / 2
UP = (0.0, 0.0, 1.0)
angles = st.floats(-math.pi, math.pi)
lengths = st.floats(0.01, 2.0)


def joint(name: str, kind: JointType, ends: tuple[str, str], at: Vector3, axis: Vector3 = UP) -> Joint:
    return Joint(name, kind, *ends, Pose(at), axis)


def model(*joints: Joint, shapes: tuple[Shape, ...] = ()) -> RobotModel:
    names = dict.fromkeys(name for joint in joints for name in (joint.parent, joint.child)) or {"base": None}
    links = tuple(Link(name, 1.0, shapes if name == "base" else ()) for name in names)
    return RobotModel("it", "/it.urdf", links, joints, "<robot/>")


def test_joints_turn_and_slide_what_hangs_on_them() -> None:
    # The file's order is not that of the tree.
    it = model(
        joint("slide", "prismatic", ("arm", "hand"), (1.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0)),
        joint("turn", "revolute", ("base", "arm"), (0.0, 0.0, 0.5)),
        joint("held", "fixed", ("hand", "tip"), (0.0, 0.1, 0.0)),
    )
    poses = link_poses(it, {"turn": QUARTER, "slide": 0.25})
    assert poses["base"] == Pose()
    assert poses["hand"].position_xyz == pytest.approx((0, 1.25, 0.5))
    assert poses["tip"].position_xyz == pytest.approx((-0.1, 1.25, 0.5))
    assert poses["tip"].yaw == pytest.approx(QUARTER)
    assert link_poses(it, {})["hand"].position_xyz == (1, 0, 0.5)
    # What has no shape has no box.
    assert robot_box(it, poses) is None


def test_the_box_is_where_the_joints_have_taken_the_shapes(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    block = '<collision><origin xyz="1 0 0"/><geometry><box size="0.2 0.4 0.6"/></geometry></collision>'
    path.write_text(GOOD.replace('<link name="upper">', f'<link name="upper">{block}'))
    it = read_urdf(path)
    lower, upper = robot_box(it, link_poses(it, {"shoulder": QUARTER})) or ((), ())
    assert lower == pytest.approx((-0.2, 0.9, 0.7))
    assert upper == pytest.approx((1.5, 2.5, 3.5))


@given(st.sampled_from(["box", "cylinder", "sphere", "capsule"]), st.tuples(angles, angles, angles), lengths, lengths)
def test_a_turned_shape_touches_all_six_sides_of_its_box(
    kind: str, turn: tuple[float, float, float], radius: float, length: float
) -> None:
    height = {"sphere": radius, "capsule": length / 2 + radius}.get(kind, length / 2)
    pose = Pose((0.1, -0.2, 0.3), geometry.quaternion_from_rpy(*turn))
    shape = Shape(kind, pose, radius, (-radius, -radius, -height), (radius, radius, height))
    it = model(shapes=(shape,))
    lower, upper = robot_box(it, link_poses(it, {})) or ((), ())
    points = [geometry.compose(pose, Pose(point)).position_xyz for point in surface(kind, radius, height)]
    slack = 0.01 * (radius + height)
    for axis in range(3):
        reached = [point[axis] for point in points]
        assert lower[axis] == pytest.approx(min(reached), abs=slack)
        assert upper[axis] == pytest.approx(max(reached), abs=slack)
        assert lower[axis] <= min(reached) + 1e-9
        assert upper[axis] >= max(reached) - 1e-9


def surface(kind: str, radius: float, height: float) -> list[Vector3]:
    if kind == "box":
        return [(x, y, z) for x, y, z in product((-radius, radius), (-radius, radius), (-height, height))]
    turns = [2 * math.pi * turn / 48 for turn in range(48)]
    if kind == "cylinder":
        return [(radius * math.cos(t), radius * math.sin(t), z) for t in turns for z in (-height, height)]
    offset = height - radius
    rings = [math.pi * ring / 48 for ring in range(49)]
    return [
        (radius * math.sin(r) * math.cos(t), radius * math.sin(r) * math.sin(t), radius * math.cos(r) + end)
        for r in rings
        for t in turns
        for end in (-offset, offset)
    ]


def test_a_mesh_that_lies_beside_its_origin_is_where_it_is() -> None:
    pose = Pose((0.0, 0.0, 1.0), geometry.quaternion_from_rpy(0, 0, QUARTER))
    it = model(shapes=(Shape("mesh", pose, None, (1.0, 0.0, 0.0), (3.0, 0.5, 0.2)),))
    lower, upper = robot_box(it, link_poses(it, {})) or ((), ())
    assert lower == pytest.approx((-0.5, 1.0, 1.0))
    assert upper == pytest.approx((0.0, 3.0, 1.2))


CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 0.5, 0), (0, 0, 0.25)], dtype=np.float32)


def meshes(corners: np.ndarray[Any, np.dtype[np.float32]], pose: Pose) -> tuple[Shape, Shape]:
    """Return a mesh as MJCF has it, and as URDF has it."""
    (ax, ay, az), (bx, by, bz) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    in_mjcf = Shape("mesh", pose, None, (ax, ay, az), (bx, by, bz), corners=corners.tobytes())
    hull = shrunk(corners.astype(np.float64), ENGINE_MARGIN_M)
    return in_mjcf, replace(in_mjcf, corners=b"", hulls=f"o hull_0\n{hull_lines(hull, 0)}".encode())


@examples(10)
@given(st.tuples(angles, angles, angles), st.tuples(angles, angles, angles))
def test_the_box_around_a_turned_mesh_is_that_around_its_points(
    own: tuple[float, float, float], swing: tuple[float, float, float]
) -> None:
    pose = Pose((0.1, -0.2, 0.3), geometry.quaternion_from_rpy(*own))
    frame = Pose((1, 2, 3), geometry.quaternion_from_rpy(*swing))
    points = [geometry.compose(geometry.compose(frame, pose), Pose(at)).position_xyz for at in CORNERS.tolist()]
    for shape in meshes(CORNERS, pose):
        # A smaller one inside it changes nothing.
        box = robot_box(model(shapes=(*meshes(CORNERS / np.float32(2), pose), shape)), {"base": frame})
        assert box is not None
        for corner, most in zip(box, (min, max), strict=True):
            assert corner == pytest.approx([most(each) for each in zip(*points, strict=True)], abs=1e-6)


HINGE = Joint("j", "revolute", "a", "b", Pose(), (0, 0, 1), -1.0, 1.5707963, max_effort=10.0, max_velocity=2.0)
SLIDE = replace(HINGE, type="prismatic", lower=0.0, upper=0.04, max_velocity=0.2)
FREE = Joint("j", "continuous", "a", "b", Pose(), (0, 0, 1))


def test_what_is_beyond_a_limit_is_told_in_units_of_the_joint() -> None:
    assert beyond_limits(HINGE, 2.0) == "114.6 deg is outside the limits of the joint, -57.3 deg to 90 deg"
    assert beyond_limits(SLIDE, -0.01) == "-0.01 m is outside the limits of the joint, 0 m to 0.04 m"
    assert too_fast(HINGE, -2.5) == "143.2 deg/s is more than the joint's velocity limit, 114.6 deg/s"
    assert too_fast(SLIDE, 0.2001) == "0.2001 m/s is more than the joint's velocity limit, 0.2 m/s"
    assert too_strong(HINGE, 10.5) == "10.5 N m is more than the joint's effort limit, 10 N m"
    assert too_strong(SLIDE, -11.0) == "11 N is more than the joint's effort limit, 10 N"


@pytest.mark.parametrize("way", [1, -1])
def test_a_limit_itself_is_allowed_however_it_was_rounded(way: int) -> None:
    assert beyond_limits(HINGE, math.pi / 2) is None
    assert beyond_limits(HINGE, math.pi / 2 + 2e-6) is not None
    limited = replace(HINGE, max_velocity=1.5707963)
    assert too_fast(limited, way * math.pi / 2) is None
    assert too_fast(limited, way * math.pi / 2 * (1 + 2e-6)) is not None
    assert too_strong(HINGE, way * 10.0) is None


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_joint_without_limits_can_do_anything(value: float) -> None:
    assert (beyond_limits(FREE, value), too_fast(FREE, value), too_strong(FREE, value)) == (None, None, None)


_BALL, _BETWEEN = ball_joints(
    "ball", "slide", "tip", Pose((0.1, 0.2, 0), quaternion_from_rpy(0.5, 0, 0)), (0.1, 0, 0.2)
)
MODEL = RobotModel(
    "arm",
    "arm.urdf",
    (*(Link(name, 1.0) for name in ("chassis", "upper", "slide", "copy", "tip", "tool")), *_BETWEEN),
    (
        # Two joints in series, about anchors.
        Joint("a", "revolute", "chassis", "upper", Pose((0.1, 0, 0.2)), (0, 1, 0), anchor_xyz=(0.1, 0, -0.3)),
        Joint("b", "revolute", "chassis", "upper", Pose((0.1, 0, 0.2)), (1, 0, 0), anchor_xyz=(0, 0.2, 0)),
        Joint("c", "prismatic", "upper", "slide", Pose((0.4, 0, 0), quaternion_from_rpy(0, 0, 1)), (0.6, 0, 0.8)),
        Joint("d", "revolute", "chassis", "copy", Pose((0, 1, 0)), (0, 0, 1), mimic=Mimic("a", -2.0, 0.5)),
        *_BALL,
        Joint("weld", "fixed", "tip", "tool", Pose((0, 0, 0.3), quaternion_from_rpy(0, 1, 0)), (0, 0, 1)),
    ),
    "",
)
NAMES = ("a", "b", "c", "d", "ball_x", "ball_y", "ball_z")
numbers = st.floats(-3, 3)
STEP_S = 1e-5


def trace_of(names: tuple[str, ...], positions: FloatArray, velocities: FloatArray, base: FloatArray) -> Trace:
    """Return a trace; `base`: (T, 13)."""
    time = np.arange(len(base), dtype=np.float64)[:, None]
    return Trace(names, np.hstack((time, base, positions, velocities, np.zeros_like(positions))))


def base_rows(pose: Pose, twist: Twist, count: int = 1) -> FloatArray:
    row = (*pose.position_xyz, *pose.orientation_xyzw, *twist.linear_xyz, *twist.angular_xyz)
    return np.tile(row, (count, 1))


def pose_at(motion: LinkMotion, row: int) -> Pose:
    position: Any = tuple(motion.position_xyz[row].tolist())
    orientation: Any = tuple(motion.orientation_xyzw[row].tolist())
    return Pose(position, orientation)


def assert_same(found: Pose, expected: Pose) -> None:
    assert found.position_xyz == pytest.approx(expected.position_xyz, abs=1e-12)
    assert abs(np.dot(found.orientation_xyzw, expected.orientation_xyzw)) == pytest.approx(1, abs=1e-12)


@examples(20)
@given(st.lists(st.tuples(*[numbers] * 7), min_size=2, max_size=2), st.tuples(*[numbers] * 6))
def test_links_are_where_the_joints_put_them(rows: list[tuple[float, ...]], at: tuple[float, ...]) -> None:
    base = Pose((at[0], at[1], at[2]), quaternion_from_rpy(at[3], at[4], at[5]))
    trace = trace_of(NAMES, np.array(rows), np.zeros((2, 7)), base_rows(base, Twist(), 2))
    for row, positions in enumerate(rows):
        joints = dict(zip(NAMES, positions, strict=True))
        states = LinkStates(MODEL, base, Twist(), {name: JointState(at, 0, 0) for name, at in joints.items()})
        for link, pose in link_poses(MODEL, joints).items():
            expected = geometry.compose(base, pose)
            assert_same(pose_at(link_motion(MODEL, trace, link), row), expected)
            assert_same(states[link].pose, expected)


def test_frames_of_all_links_are_columns() -> None:
    rows = np.array([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7], [1.0, -2.0, 0.1, 0.0, -0.5, 0.2, 3.0]])
    ones, zeros = np.ones(2), np.zeros(2)
    place: Any = ((ones, zeros, zeros), (zeros, zeros, zeros, ones))
    base = Pose(*place)
    names = [joint.name for joint in MODEL.moving_joints]
    for name, frame in link_frames(MODEL, base, rows).items():
        for row, positions in enumerate(rows.tolist()):
            expected = link_poses(MODEL, dict(zip(names, positions, strict=True)))[name]
            columns = (np.broadcast_to(column, 2) for column in (*frame.position_xyz, *frame.orientation_xyzw))
            x, y, z, i, j, k, w = (float(column[row]) for column in columns)
            assert_same(Pose((x - 1, y, z), (i, j, k, w)), expected)


def integrated(positions: FloatArray, velocities: FloatArray) -> FloatArray:
    """Return the positions of NAMES after a short time; those of the ball joint turn about the axes of its link."""
    turn = geometry.multiply(
        geometry.multiply(quaternion_from_rpy(positions[4], 0, 0), quaternion_from_rpy(0, positions[5], 0)),
        geometry.multiply(quaternion_from_rpy(0, 0, positions[6]), _little_turn(velocities[4:] * STEP_S)),
    )
    return np.array([*(positions[:4] + velocities[:4] * STEP_S), *ball_angles(turn)])


def _little_turn(vector: FloatArray) -> geometry.Quaternion:
    angle = math.sqrt(vector @ vector)
    x, y, z = (vector * (math.sin(angle / 2) / angle if angle else 0.5)).tolist()
    return (x, y, z, math.cos(angle / 2))


ball = st.tuples(numbers, st.floats(-1.4, 1.4), numbers)


@examples(20)
@given(st.tuples(*[numbers] * 4), ball, st.tuples(*[numbers] * 7), st.tuples(*[numbers] * 6), st.tuples(*[numbers] * 3))
def test_twists_are_the_rates_of_poses(
    joints: tuple[float, ...],
    ball: tuple[float, ...],
    speeds: tuple[float, ...],
    twist: tuple[float, ...],
    rpy: tuple[float, float, float],
) -> None:
    positions, velocities = np.array([*joints, *ball]), np.array(speeds)
    moving = Twist((twist[0], twist[1], twist[2]), (twist[3], twist[4], twist[5]))
    before = Pose((1, 2, 3), quaternion_from_rpy(*rpy))
    x, y, z = np.add(before.position_xyz, np.multiply(moving.linear_xyz, STEP_S)).tolist()
    little = _little_turn(np.multiply(moving.angular_xyz, STEP_S))
    after = Pose((x, y, z), geometry.multiply(little, before.orientation_xyzw))
    trace = trace_of(
        NAMES,
        np.array([positions, integrated(positions, velocities)]),
        np.array([velocities] * 2),
        np.vstack((base_rows(before, moving), base_rows(after, moving))),
    )
    state = {name: JointState(p, v, 0) for name, p, v in zip(NAMES, positions, velocities, strict=True)}
    states = LinkStates(MODEL, before, moving, state)
    for link in MODEL.links_by_name:
        for frame in ("world", "base", "copy"):
            motion = motion_in(MODEL, trace, link, frame)
            expected = geometry.twist_between(pose_at(motion, 0), pose_at(motion, 1), STEP_S)
            found = (*motion.linear_xyz[0].tolist(), *motion.angular_xyz[0].tolist())
            tolerance = 1e-3 * (1 + max(map(abs, found)) ** 2)
            assert found == pytest.approx((*expected.linear_xyz, *expected.angular_xyz), abs=tolerance), link
            if frame == "world":
                scalar = states[link].twist
                assert found == pytest.approx((*scalar.linear_xyz, *scalar.angular_xyz), abs=1e-9)


def test_a_joint_that_the_trace_leaves_out_follows_its_leader_or_stays_at_home() -> None:
    model = replace(
        MODEL, joints=tuple(replace(joint, reference=0.3) if joint.name == "b" else joint for joint in MODEL.joints)
    )
    base = base_rows(Pose(), Twist())
    left_out = trace_of(("a",), np.array([[0.7]]), np.array([[2.0]]), base)
    rest = {"b": 0.3, "d": -2 * 0.7 + 0.5}
    positions = [{"a": 0.7, **rest}.get(name, 0.0) for name in NAMES]
    velocities = [{"a": 2.0, "d": -4.0}.get(name, 0.0) for name in NAMES]
    whole = trace_of(NAMES, np.array([positions]), np.array([velocities]), base)
    for link in model.links_by_name:
        found, expected = (link_motion(model, trace, link) for trace in (left_out, whole))
        for name in ("position_xyz", "orientation_xyzw", "linear_xyz", "angular_xyz"):
            np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-12)


def test_a_ball_joint_at_its_pole_has_finite_twists() -> None:
    joints = {name: JointState(math.pi / 2 if name == "ball_y" else 0.0, 1.0, 0.0) for name in NAMES}
    states = LinkStates(MODEL, Pose(), Twist(), joints)
    assert all(math.isfinite(number) for state in states.values() for number in state.twist.angular_xyz)


def test_a_frame_that_is_named_base_is_a_link_of_that_name_first() -> None:
    trace = trace_of(NAMES, np.full((1, 7), 0.1), np.zeros((1, 7)), base_rows(Pose((5, 6, 7)), Twist()))
    assert pose_at(motion_in(MODEL, trace, "chassis", "base"), 0) == Pose()
    renamed = {"upper": "base"}
    links = tuple(replace(link, name=renamed.get(link.name, link.name)) for link in MODEL.links)
    joints = tuple(
        replace(joint, parent=renamed.get(joint.parent, joint.parent), child=renamed.get(joint.child, joint.child))
        for joint in MODEL.joints
    )
    model = replace(MODEL, links=links, joints=joints)
    assert_same(pose_at(motion_in(model, trace, "base", "base"), 0), Pose())
    assert pose_at(motion_in(model, trace, "chassis", "base"), 0).position_xyz != (0, 0, 0)


def test_unknown_links_and_frames_have_the_nearest_names() -> None:
    states = LinkStates(MODEL, Pose(), Twist(), {})
    with pytest.raises(KeyError, match="the robot has no link 'toll'; did you mean 'tool'"):
        states["toll"]
    with pytest.raises(KeyError, match="did you mean 'upper'"):
        link_motion(MODEL, trace_of((), np.empty((1, 0)), np.empty((1, 0)), base_rows(Pose(), Twist())), "uper")
    assert why_no_link(MODEL, "tool") is None
    assert (why_no_frame(MODEL, "world"), why_no_frame(MODEL, "base"), why_no_frame(MODEL, "tip")) == (None,) * 3
    stated = "there is no frame 'wrold': a frame is world, base, or a link of the robot; did you mean 'world'?"
    assert (why_no_frame(MODEL, "wrold") or "").startswith(stated)


def test_states_are_computed_when_they_are_read_and_a_copy_has_them_all() -> None:
    states = LinkStates(MODEL, Pose((1, 2, 3)), Twist(), {})
    assert states._known is None
    assert (len(states), set(states)) == (len(MODEL.links), set(MODEL.links_by_name))
    copied = copy.deepcopy(states)
    assert copied == dict(states)
    assert not isinstance(copied, LinkStates)
    assert "tool" in states
    assert "nothing" not in states

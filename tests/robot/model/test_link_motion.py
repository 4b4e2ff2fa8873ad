"""The motion of links over a trace and at one moment: against differences, and against poses of one moment."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, quaternion_from_rpy
from sim_action.core.lazy_numpy import FloatArray
from sim_action.robot.model.kinematics import (
    LinkMotion,
    LinkStates,
    link_frames,
    link_motion,
    link_poses,
    motion_in,
    why_no_frame,
    why_no_link,
)
from sim_action.robot.model.robot_model import Joint, Link, Mimic, RobotModel, ball_angles, ball_joints
from sim_action.state.observation import JointState
from sim_action.state.trace import Trace
from tests.soak import examples

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
    place: Any = (ones, zeros, zeros)
    turns: Any = (zeros, zeros, zeros, ones)
    base = Pose(place, turns)
    names = [joint.name for joint in MODEL.moving_joints]
    for name, frame in link_frames(MODEL, base, rows).items():
        for row, positions in enumerate(rows.tolist()):
            expected = link_poses(MODEL, dict(zip(names, positions, strict=True)))[name]
            numbers: Any = [
                np.broadcast_to(column, 2)[row] for column in (*frame.position_xyz, *frame.orientation_xyzw)
            ]
            x, y, z, *turn = map(float, numbers)
            i, j, k, w = turn
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
        np.testing.assert_allclose(found.position_xyz, expected.position_xyz, atol=1e-12)
        np.testing.assert_allclose(found.orientation_xyzw, expected.orientation_xyzw, atol=1e-12)
        np.testing.assert_allclose(found.linear_xyz, expected.linear_xyz, atol=1e-12)
        np.testing.assert_allclose(found.angular_xyz, expected.angular_xyz, atol=1e-12)


def test_a_ball_joint_at_its_pole_has_finite_twists() -> None:
    joints = {name: JointState(math.pi / 2 if name == "ball_y" else 0.0, 1.0, 0.0) for name in NAMES}
    states = LinkStates(MODEL, Pose(), Twist(), joints)
    assert all(math.isfinite(number) for state in states.values() for number in state.twist.angular_xyz)


def test_a_frame_that_is_named_base_is_a_link_of_that_name_first() -> None:
    trace = trace_of(NAMES, np.full((1, 7), 0.1), np.zeros((1, 7)), base_rows(Pose((5, 6, 7)), Twist()))
    assert pose_at(motion_in(MODEL, trace, "chassis", "base"), 0) == Pose()
    renamed = {"upper": "base"}
    model = replace(
        MODEL,
        links=tuple(replace(link, name=renamed.get(link.name, link.name)) for link in MODEL.links),
        joints=tuple(
            replace(joint, parent=renamed.get(joint.parent, joint.parent), child=renamed.get(joint.child, joint.child))
            for joint in MODEL.joints
        ),
    )
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
    message = why_no_frame(MODEL, "wrold") or ""
    assert message.startswith(
        "there is no frame 'wrold': a frame is world, base, or a link of the robot; did you mean "
    )
    assert "did you mean 'world'?" in message


def test_states_are_computed_when_they_are_read_and_a_copy_has_them_all() -> None:
    states = LinkStates(MODEL, Pose((1, 2, 3)), Twist(), {})
    assert states._known is None
    assert (len(states), set(states)) == (len(MODEL.links), set(MODEL.links_by_name))
    copied = copy.deepcopy(states)
    assert copied == dict(states)
    assert not isinstance(copied, LinkStates)
    assert "tool" in states
    assert "nothing" not in states

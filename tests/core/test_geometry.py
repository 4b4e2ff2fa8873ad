"""Poses and quaternions against rotations that can be done in the head."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import (
    IDENTITY,
    Pose,
    Quaternion,
    Twist,
    Vector3,
    add,
    compose,
    conjugate,
    cross,
    dot,
    inverse,
    multiply,
    quaternion_from_rpy,
    rotate,
    rpy_from_quaternion,
    scale,
    subtract,
    twist_between,
)

QUARTER = math.pi / 2
angles = st.floats(-3, 3)
vectors = st.tuples(*[st.floats(-10, 10)] * 3)


@pytest.mark.parametrize(
    ("rpy", "vector", "turned"),
    [
        ((0, 0, QUARTER), (1, 0, 0), (0, 1, 0)),
        ((0, QUARTER, 0), (1, 0, 0), (0, 0, -1)),
        ((QUARTER, 0, 0), (0, 1, 0), (0, 0, 1)),
        # About the fixed axes: first roll lifts y to z, then yaw leaves z alone.
        ((QUARTER, 0, QUARTER), (0, 1, 0), (0, 0, 1)),
        ((0, QUARTER, QUARTER), (0, 0, 1), (0, 1, 0)),
    ],
)
def test_roll_pitch_yaw_turn_about_the_fixed_axes_in_this_order(rpy: Vector3, vector: Vector3, turned: Vector3) -> None:
    assert rotate(quaternion_from_rpy(*rpy), vector) == pytest.approx(turned, abs=1e-15)


def test_no_rotation_is_the_identity_and_all_have_unit_length() -> None:
    assert quaternion_from_rpy(0, 0, 0) == IDENTITY
    assert rotate(IDENTITY, (1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)
    rotation: Quaternion = quaternion_from_rpy(0.3, -0.4, 0.5)
    assert math.hypot(*rotation) == pytest.approx(1.0)


@given(angles, angles, angles, vectors)
def test_a_rotation_keeps_lengths_and_its_conjugate_undoes_it(r: float, p: float, y: float, vector: Vector3) -> None:
    rotation = quaternion_from_rpy(r, p, y)
    turned = rotate(rotation, vector)
    assert math.hypot(*turned) == pytest.approx(math.hypot(*vector), abs=1e-12)
    assert rotate(conjugate(rotation), turned) == pytest.approx(vector, abs=1e-12)


@given(st.lists(angles, min_size=6, max_size=6), vectors)
def test_a_product_applies_the_second_factor_first(turns: list[float], vector: Vector3) -> None:
    first, second = quaternion_from_rpy(*turns[:3]), quaternion_from_rpy(*turns[3:])
    assert rotate(multiply(first, second), vector) == pytest.approx(rotate(first, rotate(second, vector)), abs=1e-9)


@given(st.floats(-3.1, 3.1))
def test_yaw_is_the_heading_that_was_given(yaw: float) -> None:
    assert Pose(orientation_xyzw=quaternion_from_rpy(0, 0, yaw)).yaw == pytest.approx(yaw, abs=1e-12)


def test_composed_poses_are_seen_from_the_outermost_frame() -> None:
    outer = Pose((1.0, 2.0, 3.0), quaternion_from_rpy(0, 0, QUARTER))
    inner = Pose((1.0, 0.0, 0.0), quaternion_from_rpy(0, 0, QUARTER))
    composed = compose(outer, inner)
    assert composed.position_xyz == pytest.approx((1.0, 3.0, 3.0))
    assert abs(composed.yaw) == pytest.approx(math.pi)
    pose = Pose((1.0, 2.0, 3.0), (0.5, 0.5, 0.5, 0.5))
    assert compose(pose, Pose()) == compose(Pose(), pose) == pose


@given(st.tuples(*[st.floats(-3.1, 3.1)] * 3))
def test_a_pose_and_its_inverse_cancel(angles: tuple[float, float, float]) -> None:
    pose = Pose((1.0, 2.0, 3.0), quaternion_from_rpy(*angles))
    for both in (compose(pose, inverse(pose)), compose(inverse(pose), pose)):
        assert both.position_xyz == pytest.approx((0, 0, 0), abs=1e-12)
        assert both.orientation_xyzw == pytest.approx((0, 0, 0, 1), abs=1e-12)


@pytest.mark.parametrize("pitch", [0.0, 0.5, -1.2, QUARTER, -QUARTER, QUARTER - 1e-9])
@given(roll=st.floats(-3.1, 3.1), yaw=st.floats(-3.1, 3.1))
def test_roll_pitch_and_yaw_make_the_rotation_they_came_from(pitch: float, roll: float, yaw: float) -> None:
    rotation = quaternion_from_rpy(roll, pitch, yaw)
    again = quaternion_from_rpy(*rpy_from_quaternion(rotation))
    assert multiply(conjugate(rotation), again)[:3] == pytest.approx((0, 0, 0), abs=1e-12)


def test_planar_twists_and_arithmetic_of_vectors() -> None:
    assert Twist.planar(1, 2) == Twist((1.0, 0.0, 0.0), (0.0, 0.0, 2.0))
    assert Twist.planar(1, 2, lateral=3) == Twist((1.0, 3.0, 0.0), (0.0, 0.0, 2.0))
    assert Twist.planar() == Twist()
    assert add((1.0, 2.0, 3.0), (10.0, 20.0, 40.0)) == (11.0, 22.0, 43.0)
    assert subtract((1.0, 2.0, 3.0), (10.0, 20.0, 40.0)) == (-9.0, -18.0, -37.0)
    assert scale((1.0, -2.0, 3.0), 2.0) == (2.0, -4.0, 6.0)
    assert dot((1.0, 2.0, 3.0), (10.0, 20.0, -40.0)) == -70.0
    assert cross((1.0, 2.0, 3.0), (4.0, 6.0, 9.0)) == (0.0, 3.0, -2.0)


@given(vectors, vectors, st.tuples(angles, angles, angles), st.floats(1e-3, 10))
def test_a_twist_brings_one_pose_to_the_other(start: Vector3, end: Vector3, rpy: Vector3, seconds: float) -> None:
    roll, pitch, yaw = rpy
    here = Pose(start, quaternion_from_rpy(pitch, yaw, roll))
    there = Pose(end, quaternion_from_rpy(roll, pitch, yaw))
    twist = twist_between(here, there, seconds)
    moved = [at + speed * seconds for at, speed in zip(start, twist.linear_xyz, strict=True)]
    assert moved == pytest.approx(end, abs=1e-9)
    turn = math.hypot(*twist.angular_xyz) * seconds
    assert turn <= math.pi + 1e-9  # the short way round
    x, y, z = (rate * seconds / (turn or 1.0) for rate in twist.angular_xyz)
    sine = math.sin(turn / 2)
    turned = multiply((x * sine, y * sine, z * sine, math.cos(turn / 2)), here.orientation_xyzw)
    probe = (1.0, 2.0, 3.0)
    assert rotate(turned, probe) == pytest.approx(rotate(there.orientation_xyzw, probe), abs=1e-6)


def test_what_stays_or_hardly_turns_has_no_twist() -> None:
    pose = Pose((1.0, 2.0, 3.0), quaternion_from_rpy(0.1, 0.2, 0.3))
    assert math.hypot(*twist_between(pose, pose, 0.1).angular_xyz) < 1e-12
    assert twist_between(pose, pose, 0.1).linear_xyz == (0.0, 0.0, 0.0)
    assert twist_between(Pose(), Pose(orientation_xyzw=(0.0, 0.0, 1e-320, 1.0)), 1e-6).angular_xyz == (0.0, 0.0, 0.0)

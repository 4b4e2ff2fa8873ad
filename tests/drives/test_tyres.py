"""Tyres: the round outline of a link about its joint, from primitive shapes and from the hulls of meshes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import Pose, Vector3, quaternion_from_rpy, rotate
from sim_action.drives.tyres import NotRound, Tyre, tyre_of
from sim_action.meshes.collision_hulls import shrunk
from sim_action.robot.model.robot_model import ENGINE_MARGIN_M, Joint, Link, Shape, Visual
from tests.drives.carts import LYING
from tests.soak import examples

ACROSS: Vector3 = (0.0, 1.0, 0.0)
JOINT = Joint("spin", "continuous", "base", "wheel", Pose(), ACROSS)


def mesh(points: Iterable[Vector3]) -> Shape:
    """A mesh shape with one hull, as the reader makes it."""
    corners = np.array(list(points))
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in shrunk(corners, ENGINE_MARGIN_M).tolist()]
    lower, upper = ((x, y, z) for x, y, z in (corners.min(axis=0).tolist(), corners.max(axis=0).tolist()))
    return Shape("mesh", Pose(), None, lower, upper, "\n".join(["o hull_0", *lines, "f 1 2 3", ""]).encode())


def prism(corners: int, radius: float = 0.1, half_width: float = 0.02, squash: float = 1.0, off: float = 0.0) -> Shape:
    """A wheel about y with flat facets; `squash`: height over length; `off`: m, its centre ahead of the axis."""
    angles = [2 * math.pi * number / corners for number in range(corners)]
    return mesh(
        (off + radius * math.cos(angle), side, squash * radius * math.sin(angle))
        for angle in angles
        for side in (-half_width, half_width)
    )


def cylinder(radius: float, y: float = 0.0, length: float = 0.04) -> Shape:
    pose = dataclasses.replace(LYING, position_xyz=(0.0, y, 0.0))
    return Shape("cylinder", pose, radius, (-radius, -radius, -length / 2), (radius, radius, length / 2))


def sphere(radius: float, y: float = 0.0, x: float = 0.0) -> Shape:
    return Shape("sphere", Pose((x, y, 0.0)), radius, (-radius,) * 3, (radius,) * 3)


def box(half: float) -> Shape:
    return Shape("box", Pose(), None, (-half,) * 3, (half,) * 3)


def tyre(*shapes: Shape, joint: Joint = JOINT) -> Tyre | NotRound:
    return tyre_of(Link("wheel", 1.0, shapes), joint)


@pytest.mark.parametrize("corners", [8, 12, 32, 100])
def test_a_mesh_wheel_rolls_as_far_as_its_outline_is_long(corners: int) -> None:
    found = tyre(prism(corners))
    assert isinstance(found, Tyre)
    around = corners * 2 * 0.1 * math.sin(math.pi / corners)
    assert found.radius == pytest.approx(around / (2 * math.pi), rel=1e-6)
    assert found.width == pytest.approx(0.04)
    assert found.middle_xyz == pytest.approx((0, 0, 0), abs=1e-9)


@given(st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3), st.integers(8, 40), st.floats(0.01, 2))
@examples(10)
def test_a_mesh_wheel_is_measured_about_any_axis(
    roll: float, pitch: float, yaw: float, corners: int, radius: float
) -> None:
    turned = quaternion_from_rpy(roll, pitch, yaw)
    shape = dataclasses.replace(prism(corners, radius), pose=Pose((0.3, -0.2, 0.1), turned))
    joint = dataclasses.replace(JOINT, axis_xyz=rotate(turned, ACROSS), anchor_xyz=(0.3, -0.2, 0.1))
    found = tyre(shape, joint=joint)
    assert isinstance(found, Tyre)
    assert found.radius == pytest.approx(corners * radius * math.sin(math.pi / corners) / math.pi, rel=1e-3)
    assert found.middle_xyz == pytest.approx((0.3, -0.2, 0.1), abs=1e-3 * radius)


def test_a_mesh_of_mjcf_has_its_corners() -> None:
    angles = np.arange(32) * (2 * np.pi / 32)
    rims = [np.stack([0.1 * np.cos(angles), np.full(32, y), 0.1 * np.sin(angles)], axis=1) for y in (0.0, 0.04)]
    corners = np.concatenate(rims).astype(np.float32).tobytes()
    found = tyre(Shape("mesh", Pose(), corners=corners))
    assert isinstance(found, Tyre)
    assert [found.radius, found.width] == pytest.approx([32 * 0.1 * math.sin(math.pi / 32) / math.pi, 0.04])
    assert found.middle_xyz == pytest.approx((0.0, 0.02, 0.0))


@pytest.mark.parametrize(
    ("shape", "reason"),
    [
        (prism(4), "its outline has 4 corners"),
        (prism(32, squash=0.9), "the corners of its outline are 0.09 m to 0.1 m from it"),
        (prism(32, off=0.01), "the corners of its outline are 0.09 m to 0.11 m from it"),
        (prism(7), "two corners of its outline are 51.4 deg apart"),
        (Shape("mesh", Pose()), "is a mesh whose shape is not known here"),
        (box(0.1), "is a box, which is not round"),
        (dataclasses.replace(cylinder(0.1), pose=Pose()), "is a cylinder, which does not lie along the joint's axis"),
        (sphere(0.1, x=0.01), "is a sphere, whose centre is 0.01 m from the joint's axis"),
    ],
    ids=[
        "square",
        "ellipse",
        "eccentric",
        "seven corners",
        "unknown",
        "box",
        "upright cylinder",
        "sphere off the axis",
    ],
)
def test_a_link_that_is_not_round_says_why(shape: Shape, reason: str) -> None:
    found = tyre(shape)
    assert isinstance(found, NotRound)
    assert found.reason.endswith(reason)


def test_the_largest_of_several_shapes_is_the_tyre() -> None:
    assert tyre(cylinder(0.03, length=0.2), cylinder(0.1), box(0.05)) == tyre(cylinder(0.1))


def test_twin_tyres_are_as_wide_as_both() -> None:
    found = tyre(cylinder(0.1, y=0.05), cylinder(0.1, y=-0.01))
    assert isinstance(found, Tyre)
    assert [found.radius, found.width] == pytest.approx([0.1, 0.1])
    assert found.middle_xyz == pytest.approx((0, 0.02, 0))


def test_a_shape_that_sticks_out_of_the_tyre_makes_it_unround() -> None:
    assert isinstance(tyre(cylinder(0.1), box(0.09)), NotRound)


def test_spheres_and_capsules_are_round() -> None:
    assert tyre(sphere(0.05)) == Tyre(0.05, (0.0, 0.0, 0.0), 0.0, "sphere")
    capsule = Shape("capsule", LYING, 0.05, (-0.05, -0.05, -0.07), (0.05, 0.05, 0.07))
    found = tyre(capsule)
    assert isinstance(found, Tyre)
    assert [found.radius, found.width] == pytest.approx([0.05, 0.04])


def test_a_wheel_that_is_only_drawn_touches_nothing() -> None:
    seen = Link("wheel", 1.0, visuals=(Visual("cylinder", Pose()),))
    assert tyre_of(seen, JOINT) == NotRound("has no collision shape, only visuals: nothing of it touches the ground")
    assert tyre_of(Link("wheel", 1.0), JOINT) == NotRound("has no collision shape")

"""Where links are, and the box around shapes, against points on the shapes themselves."""

from __future__ import annotations

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
from sim_action.core.geometry import Pose, Vector3
from sim_action.meshes.collision_hulls import hull_lines, shrunk
from sim_action.robot.model.kinematics import beyond_limits, link_poses, robot_box, too_fast, too_strong
from sim_action.robot.model.robot_model import ENGINE_MARGIN_M, Joint, JointType, Link, RobotModel, Shape
from sim_action.robot.reading.urdf import read_urdf
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


def test_what_has_no_shape_has_no_box() -> None:
    it = model()
    assert robot_box(it, link_poses(it, {})) is None


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

"""Where links are, and the box around shapes, against points on the shapes themselves."""

from __future__ import annotations

import math
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.robot.kinematics import link_poses, robot_box
from sim_action.robot.robot_model import Joint, JointType, Link, RobotModel, Shape
from sim_action.robot.urdf import read_urdf
from tests.robot.bad_models import GOOD

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

"""Inverse kinematics: targets from joints within limits are found, targets out of reach are not, limits hold.

Two-link arms have formulas: with links of lengths a and b, the tip reaches all distances from |a - b| to a + b. With an
elbow of at most a right angle, it comes no nearer than the hypotenuse of both.
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.workspace import Workspace
from sim_action.robot.model.inverse_kinematics import REACHED_M, Chain, Values, damped_least_squares, reach, search
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.robot.reading.urdf import read_urdf
from tests.soak import examples

INERTIAL: Final = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
FREE: Final = '<limit effort="9" velocity="2"/>'
A, B = 0.5, 0.3


def joint(name: str, parent: str, child: str, more: str, *, kind: str = "revolute", at: str = "0 0 0") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{at}"/>{more}</joint><link name="{child}">{INERTIAL}</link>'
    )


def model_of(folder: Path, *joints: str) -> RobotModel:
    path = folder / "robot.urdf"
    path.write_text(f'<robot name="r"><link name="base">{INERTIAL}</link>{"".join(joints)}</robot>')
    return read_urdf(path)


def limits(lower: float, upper: float) -> str:
    return f'<limit lower="{lower}" upper="{upper}" effort="9" velocity="2"/>'


def two_links(folder: Path, elbow: str = limits(-3.1, 3.1)) -> Chain:
    """An arm in the x-y plane that is stretched along x at zero."""
    model = model_of(
        folder,
        joint("shoulder", "base", "upper", f'<axis xyz="0 0 1"/>{FREE}', kind="continuous"),
        joint("elbow", "upper", "fore", f'<axis xyz="0 0 1"/>{elbow}', at=f"{A} 0 0"),
        joint("tip_joint", "fore", "tip", "", kind="fixed", at=f"{B} 0 0"),
    )
    return Chain.of(model, "tip", {})


def built_in(name: str) -> RobotModel:
    here = Path(__file__).parent
    return load_model(Robot(model=name), Workspace(here, here))


def from_bullet(name: str) -> RobotModel:
    data = pytest.importorskip("pybullet_data")
    folder = Path(data.getDataPath()) / Path(name).parent
    return load_model(Robot(model=Path(name).name, base="fixed"), Workspace(folder, folder))


def chain_to(model: RobotModel, link: str) -> tuple[Chain, Values]:
    home = model.positions({})
    chain = Chain.of(model, link, home)
    return chain, tuple(home[each.name] for each in chain.joints)


def drawn(chain: Chain, numbers: random.Random) -> Values:
    ranges = zip(chain.lower, chain.upper, strict=True)
    return tuple(numbers.uniform(max(lower, -math.pi), min(upper, math.pi)) for lower, upper in ranges)


ARMS: Final[Mapping[str, tuple[str, str]]] = {
    "ur5e": ("ur5e_gripper", "tool0"),
    "kuka": ("kuka_iiwa/model.urdf", "lbr_iiwa_link_7"),
    "franka": ("franka_panda/panda.urdf", "panda_hand"),
}


def arm(name: str) -> tuple[Chain, Values]:
    path, link = ARMS[name]
    return chain_to(from_bullet(path) if "/" in path else built_in(path), link)


@pytest.mark.parametrize(
    ("name", "count"),
    [("ur5e", 100), ("kuka", 30), ("franka", 20), *(pytest.param(name, 500, marks=pytest.mark.soak) for name in ARMS)],
)
def test_targets_within_the_limits_are_found(name: str, count: int) -> None:
    chain, start = arm(name)
    numbers = random.Random(1)
    found = 0
    for _ in range(count):
        target = chain.pose(drawn(chain, numbers))
        solution = search(chain, target, start)
        assert solution.values == chain.inside(solution.values)
        there = chain.pose(solution.values)
        distance = math.dist(there.position_xyz, target.position_xyz)
        angle = math.hypot(*geometry.twist_between(there, target, 1.0).angular_xyz)
        assert solution.is_reached == (distance <= 1e-6 and angle <= 1e-6)
        found += distance < 1e-4 and angle < 1e-4
    assert found >= 0.99 * count


@pytest.mark.parametrize(("name", "count"), [("ur5e", 8), *(pytest.param(n, 50, marks=pytest.mark.soak) for n in ARMS)])
def test_targets_out_of_reach_are_not_accepted(name: str, count: int) -> None:
    chain, start = arm(name)
    numbers = random.Random(2)
    for _ in range(count):
        x, y, z = (numbers.gauss(0, 1) for _ in range(3))
        scale = chain.length * numbers.uniform(1.0001, 2.0) / math.hypot(x, y, z)
        solution = search(chain, Pose((x * scale, y * scale, z * scale)), start)
        assert not solution.is_reached
        # No point of the arm is farther from the base than its length.
        assert solution.distance >= scale * math.hypot(x, y, z) - chain.length


@given(st.integers(0, 10**6))
@examples(10)
def test_a_chain_agrees_with_the_poses_of_links(seed: int) -> None:
    numbers = random.Random(seed)
    model = built_in("ur5e_gripper")
    for link in ("tool0", "right_finger", "forearm_link"):
        chain, _ = chain_to(model, link)
        values = drawn(chain, numbers)
        stated = dict(zip((each.name for each in chain.joints), values, strict=True))
        expected = link_poses(model, model.positions(stated))[link]
        found = chain.pose(values)
        assert found.position_xyz == pytest.approx(expected.position_xyz, abs=1e-13)
        turn = geometry.twist_between(expected, found, 1.0).angular_xyz
        assert turn == pytest.approx((0.0, 0.0, 0.0), abs=1e-13)


@given(st.integers(0, 10**6))
@examples(10)
def test_the_velocity_of_each_joint_is_the_difference_of_two_poses(seed: int) -> None:
    chain, _ = chain_to(built_in("ur5e_gripper"), "right_finger")
    values = drawn(chain, random.Random(seed))
    _, columns = chain.motions(values)
    assert [each.name for each in chain.joints][-1] == "left_finger_joint"
    for index, column in enumerate(columns):
        step = 1e-6
        before, after = (
            chain.pose([value + side * (at == index) for at, value in enumerate(values)]) for side in (-step, step)
        )
        twist = geometry.twist_between(before, after, 2 * step)
        assert column == pytest.approx((*twist.linear_xyz, *twist.angular_xyz), abs=1e-8)


@pytest.fixture(scope="module")
def round_arm(tmp_path_factory: pytest.TempPathFactory) -> Chain:
    return two_links(tmp_path_factory.mktemp("arm"), limits(-math.pi, math.pi))


@given(st.floats(-math.pi, math.pi), st.floats(0.0, 1.2))
@examples(12)
def test_two_links_reach_the_ring_of_their_lengths(round_arm: Chain, angle: float, distance: float) -> None:
    target = Pose((distance * math.cos(angle), distance * math.sin(angle), 0.0))
    found = search(round_arm, target, (0.1, 0.2), turns=False)
    missing = max(0.0, distance - (A + B), (A - B) - distance)
    assert found.distance == pytest.approx(missing, rel=1e-4, abs=1e-5)
    assert found.is_reached == (missing <= REACHED_M)


@pytest.mark.parametrize("elbow", [0.0, 0.5, math.pi / 2])
def test_an_elbow_with_a_limit_cannot_come_near(tmp_path: Path, elbow: float) -> None:
    chain = two_links(tmp_path, limits(0.0, elbow) if elbow else limits(0.0, 0.0))
    nearest = math.sqrt(A * A + B * B + 2 * A * B * math.cos(elbow))
    for inside in (0.001, 0.1, 0.3):
        target = Pose((0.0, nearest - inside, 0.0))
        found = search(chain, target, (0.0, 0.0), turns=False)
        assert not found.is_reached
        assert found.distance == pytest.approx(inside, abs=1e-5)
        assert found.values == chain.inside(found.values)


def test_barely_reached_and_barely_not(tmp_path: Path) -> None:
    chain = two_links(tmp_path)
    for beyond, is_reached in ((-1e-9, True), (0.0, True), (1e-5, False)):
        found = search(chain, Pose((0.0, A + B + beyond, 0.0)), (0.0, 0.1), turns=False)
        assert found.is_reached is is_reached


def test_a_position_alone_leaves_the_orientation_free(tmp_path: Path) -> None:
    chain = two_links(tmp_path)
    target = Pose((0.4, 0.3, 0.0), geometry.quaternion_from_rpy(0, 0, 1.0))
    assert search(chain, target, (0.0, 0.5), turns=False).is_reached
    turned = search(chain, target, (0.0, 0.5))
    assert not turned.is_reached
    # At its position, two postures have orientations of their own: the nearer one is found.
    distance = math.hypot(0.4, 0.3)
    elbow = math.acos((distance**2 - A * A - B * B) / (2 * A * B))
    direction = math.atan2(0.3, 0.4)
    inner = math.acos((A * A + distance**2 - B * B) / (2 * A * distance))
    headings = [direction - inner + elbow, direction + inner - elbow]
    assert turned.distance < 1e-4
    assert turned.angle == pytest.approx(min(abs(1.0 - heading) for heading in headings), abs=0.01)


def test_joints_of_every_kind_move_the_link(tmp_path: Path) -> None:
    """A slide, a turn without limits, and a hinge whose half is copied by a second one."""
    half = '<mimic joint="hinge" multiplier="0.5" offset="0.1"/>'
    model = model_of(
        tmp_path,
        joint("slide", "base", "a", f'<axis xyz="0 0 1"/>{limits(0.1, 0.6)}', kind="prismatic"),
        joint("turn", "a", "b", f'<axis xyz="0 0 1"/>{FREE}', kind="continuous"),
        joint("hinge", "b", "c", f'<axis xyz="0 1 0"/>{limits(-2, 2)}', at="0.3 0 0"),
        joint("copy", "c", "d", f'<axis xyz="0 1 0"/>{limits(-0.4, 0.9)}{half}', at="0.2 0 0"),
        joint("end", "d", "tip", "", kind="fixed", at="0.1 0 0"),
    )
    chain = Chain.of(model, "tip", {})
    assert [each.name for each in chain.joints] == ["slide", "turn", "hinge"]
    # The follower's limits count: (-0.4 - 0.1) / 0.5, (0.9 - 0.1) / 0.5.
    assert chain.lower == pytest.approx((0.1, -math.inf, -1.0))
    assert chain.upper == pytest.approx((0.6, math.inf, 1.6))
    # It moves at half the speed, so the leader's own limit is the smaller one.
    assert chain.fastest == (2.0, 2.0, 2.0)
    values = (0.35, 40.0, 0.7)
    found = search(chain, chain.pose(values), (0.1, 0.0, 0.0))
    assert found.is_reached
    assert found.values[0] == pytest.approx(0.35, abs=1e-6)
    assert math.remainder(found.values[1] - 40.0, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)
    assert found.values[2] == pytest.approx(0.7, abs=1e-6)


def test_a_follower_that_is_faster_slows_its_leader(tmp_path: Path) -> None:
    fast = '<mimic joint="hinge" multiplier="-4"/>'
    model = model_of(
        tmp_path,
        joint("hinge", "base", "a", f'<axis xyz="0 1 0"/>{limits(-2, 2)}'),
        joint("copy", "a", "b", f'<axis xyz="0 1 0"/>{limits(-9, 9)}{fast}', at="1 0 0"),
    )
    assert Chain.of(model, "b", {}).fastest == (0.5,)


def test_a_ball_joint_and_a_joint_on_another_branch_do_not_move_the_link(tmp_path: Path) -> None:
    model = model_of(
        tmp_path,
        joint("hinge", "base", "a", f'<axis xyz="0 1 0"/>{limits(-2, 2)}'),
        joint("ball", "a", "b", "", kind="spherical", at="1 0 0"),
        joint("other", "a", "c", f'<axis xyz="0 1 0"/>{limits(-2, 2)}'),
    )
    positions = {"ball_x": 0.1, "ball_y": -0.2, "ball_z": 0.3, "other": 0.4}
    chain = Chain.of(model, "b", positions)
    assert [each.name for each in chain.joints] == ["hinge"]
    expected = link_poses(model, {**positions, "hinge": 0.5})["b"]
    assert chain.pose((0.5,)).position_xyz == pytest.approx(expected.position_xyz, abs=1e-14)
    assert chain.pose((0.5,)).orientation_xyzw == pytest.approx(expected.orientation_xyzw, abs=1e-14)


def test_a_near_target_keeps_the_posture() -> None:
    chain, _ = arm("ur5e")
    start = (0.2, -1.5, 1.7, -1.8, -1.5, 0.3)
    at = chain.pose(start)
    x, y, z = at.position_xyz
    near: Vector3 = (x + 0.01, y - 0.01, z)
    found = reach(chain, Pose(near, at.orientation_xyzw), start)
    assert found.is_reached
    assert max(abs(there - here) for there, here in zip(found.values, start, strict=True)) < 0.1


def test_a_follower_of_a_follower_has_the_offsets_of_both(tmp_path: Path) -> None:
    """second = 3 (2 first + 0.1) + 0.2."""
    turn = f'<axis xyz="0 0 1"/>{limits(-9, 9)}'
    model = model_of(
        tmp_path,
        joint("lead", "base", "a", turn),
        joint("first", "a", "b", f'{turn}<mimic joint="lead" multiplier="2" offset="0.1"/>', at="0.3 0 0"),
        joint("second", "b", "tip", f'{turn}<mimic joint="first" multiplier="3" offset="0.2"/>', at="0.2 0 0"),
    )
    found = Chain.of(model, "tip", {}).pose((0.05,))
    assert found.yaw == pytest.approx(0.05 + 0.2 + 0.8)
    x, y = 0.3 * math.cos(0.05) + 0.2 * math.cos(0.25), 0.3 * math.sin(0.05) + 0.2 * math.sin(0.25)
    assert found.position_xyz == pytest.approx((x, y, 0.0))


numbers = st.floats(-10, 10)
vectors = st.tuples(numbers, numbers, numbers)


@given(st.lists(vectors, min_size=1, max_size=5), vectors, st.floats(1e-3, 10))
@examples(20)
def test_every_derivative_is_zero(
    columns: list[tuple[float, float, float]], error: tuple[float, float, float], damping: float
) -> None:
    found = damped_least_squares(columns, error, damping)
    rest = [
        math.fsum(column[row] * part for column, part in zip(columns, found, strict=True)) - error[row]
        for row in range(3)
    ]
    for column, part in zip(columns, found, strict=True):
        derivative = math.fsum(a * b for a, b in zip(column, rest, strict=True)) + damping * part
        assert derivative == pytest.approx(0.0, abs=1e-6)

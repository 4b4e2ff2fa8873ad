"""The table of drives, and the first that fits."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.drives import DRIVES, Drive, DriveMotion, WheelSpeeds, heading_text, radius_text, recognise, torque_text
from sim_action.drives.ackermann import AckermannDrive
from sim_action.drives.diff import DiffDrive
from sim_action.drives.mecanum import MecanumDrive
from sim_action.drives.skid import SkidSteer
from sim_action.robot.model.kinematics import Mobility
from sim_action.robot.model.robot_model import Joint, Link, RobotModel
from tests.drives.carts import CAR, FOUR, RADIUS, cart, steered, wheel
from tests.soak import examples
from tests.traces import WHEELS, burger, scene


def test_the_table_has_the_keys_of_its_classes_and_a_model_without_wheels_no_drive() -> None:
    assert {name: DRIVES.load(name).key for name in DRIVES} == {name: name for name in DRIVES}
    links = (Link("base", 1.0), Link("tip", 1.0))
    joints = (Joint("elbow", "revolute", "base", "tip", Pose(), (0.0, 0.0, 1.0)),)
    assert recognise(RobotModel("arm", "", links, joints, "")) is None


ALONG_X: Vector3 = (-1.0, 0.0, 0.0)
BURGERS = DiffDrive(left=WHEELS[:1], right=WHEELS[1:])
SKID = SkidSteer(left=("a", "b"), right=("c", "d"), slip=2.0, acceleration=0.3)
MECANUM = MecanumDrive(left=("a", "b"), right=("c", "d"))
DRIVE = AckermannDrive(steering=("a_steer", "b_steer"), wheels=("c", "d"), acceleration=2.0)
FOUR_AHEAD = cart(wheel("a", 0.3, 0.3), wheel("b", -0.1, 0.3), wheel("c", 0.3, -0.3), wheel("d", -0.1, -0.3))
TO_THE_LEFT = cart(
    *(wheel(name, x, y, axis=ALONG_X) for name, x, y in (("a", -0.3, 0.2), ("c", 0.3, 0.2))),
    *(wheel(name, x, y, axis=ALONG_X) for name, x, y in (("b", -0.3, -0.2), ("d", 0.3, -0.2))),
)
FRONT = (steered("a", 0.3, 0.2), steered("b", 0.3, -0.2))
STEERED = cart(*FRONT, wheel("c", -0.2, 0.2), wheel("d", -0.2, -0.2))


@pytest.mark.parametrize(
    ("drive", "model", "mobility"),
    [
        # 0.16 m between the wheels: rims that gain 1 m/s in a second turn it by 1 / 0.08 rad/s. Wheels of 33 mm turn
        # with 100 rad/s at most.
        (BURGERS, burger(), Mobility(acceleration=1.0, turn_acceleration=12.5, fastest=3.3)),
        (SKID, FOUR_AHEAD, Mobility(ahead=-0.1, acceleration=0.3, turn_acceleration=0.3 / 0.6)),
        (SKID, TO_THE_LEFT, Mobility(heading=math.pi / 2, acceleration=0.3, turn_acceleration=0.3 / 0.6)),
        (MECANUM, cart(*FOUR), Mobility(turn_acceleration=1 / math.hypot(0.2, 0.3))),
        # The inner wheel is turned by 0.6 rad, 0.5 m before the axle and 0.2 m beside the middle.
        (
            DRIVE,
            STEERED,
            Mobility(ahead=0.2, tightest=1 / (0.5 / math.tan(0.6) + 0.2), acceleration=2.0, wheelbase=0.5),
        ),
    ],
    ids=["diff", "skid", "skid that faces left", "mecanum", "ackermann"],
)
def test_it_says_what_it_can_do(drive: Drive, model: RobotModel, mobility: Mobility) -> None:
    found = drive.prepared(dataclasses.replace(scene(), model=model)).mobility
    assert dataclasses.astuple(found) == pytest.approx(dataclasses.astuple(mobility))


FASTEST = 20.0
LEFT, RIGHT = ("a", "b"), ("c", "d")
LIMITLESS: dict[str, tuple[Drive, RobotModel]] = {
    "diff": (DiffDrive(left=LEFT, right=RIGHT, acceleration=1e9), cart(*FOUR)),
    "skid": (SkidSteer(left=LEFT, right=RIGHT, acceleration=1e9), cart(*FOUR)),
    "mecanum": (MecanumDrive(left=LEFT, right=RIGHT, acceleration=1e9), cart(*FOUR)),
    "ackermann": (AckermannDrive(steering=("a_steer", "b_steer"), wheels=("c", "d"), acceleration=1e9), CAR),
}
every_drive = pytest.mark.parametrize("name", list(LIMITLESS))


def opened(name: str, fastest: float | None) -> DriveMotion:
    """A drive all of whose wheels have the same limit, in rad/s."""
    drive, model = LIMITLESS[name]
    joints = (replace(joint, max_velocity=fastest) if joint.type == "continuous" else joint for joint in model.joints)
    return drive.open(replace(model, joints=tuple(joints)), 100.0)


def speeds(motion: DriveMotion, twist: Twist) -> dict[str, float]:
    return dict(motion.targets(twist, 10)[-1].velocity)


@every_drive
@examples(20)
@given(linear=st.floats(-9, 9), curvature=st.floats(-1, 1), lateral=st.floats(-9, 9))
def test_wheels_are_held_to_their_limits_all_alike(name: str, linear: float, curvature: float, lateral: float) -> None:
    lateral = lateral if name == "mecanum" else 0.0
    twist = Twist.planar(linear, linear * curvature, lateral=lateral)
    free, limited = opened(name, None), opened(name, FASTEST)
    asked, given_ = speeds(free, twist), speeds(limited, twist)
    share = min(1.0, FASTEST / max(*map(abs, asked.values()), 1e-9))
    assert given_ == pytest.approx({joint: share * speed for joint, speed in asked.items()}, rel=2e-6, abs=1e-9)
    assert bool(limited.notes) == (share < 1 - 1e-6)
    assert free.notes == ()


@every_drive
def test_what_a_twist_asked_for_is_noted_once(name: str) -> None:
    motion = opened(name, FASTEST)
    for linear in (0.5, 4.0, 8.0, -8.0):
        motion.targets(Twist.planar(linear), 1)
    (note,) = motion.notes
    assert "for 2292 deg/s, but its limit in the model is 1146 deg/s: all wheels were slowed by the same factor" in note


@every_drive
@examples(20)
@given(steps=st.integers(1, 60), ahead=st.floats(-1, 1), left=st.floats(-1, 1), turn=st.floats(-3, 3))
def test_a_twist_planned_at_once_is_the_twist_planned_step_by_step(
    name: str, steps: int, ahead: float, left: float, turn: float
) -> None:
    drive, model = LIMITLESS[name]
    slow = drive.model_copy(update={"acceleration": 1.0} | ({"steering_rate": 2.0} if name == "ackermann" else {}))
    twist = Twist.planar(ahead, turn, lateral=left if name == "mecanum" else 0.0)
    whole = slow.open(model, 60.0).targets(twist, steps)
    single = slow.open(model, 60.0)
    one_by_one = [single.targets(twist, 1)[0] for _ in range(steps)]
    assert [*whole, *[whole[-1]] * (steps - len(whole))] == one_by_one


def test_the_base_of_a_mecanum_drive_is_pushed_no_faster_than_its_wheels_turn() -> None:
    (targets,) = opened("mecanum", FASTEST).targets(Twist.planar(4.0, lateral=4.0), 1)
    assert targets.base is not None
    assert targets.base.linear_xy == pytest.approx((1.0, 1.0))


def test_a_car_that_goes_over_to_a_curve_is_within_its_limits_at_every_step() -> None:
    drive = AckermannDrive(steering=("a_steer", "b_steer"), wheels=("c", "d"), acceleration=1.0, steering_rate=1.0)
    joints = (replace(joint, max_velocity=FASTEST) if joint.name in "cd" else joint for joint in CAR.joints)
    motion = drive.open(replace(CAR, joints=tuple(joints)), 100.0)
    straight = motion.targets(Twist.planar(FASTEST * RADIUS), 1000)
    turning = motion.targets(Twist.planar(FASTEST * RADIUS, FASTEST * RADIUS), 1000)
    assert straight[-1].velocity == pytest.approx({"c": FASTEST, "d": FASTEST})
    assert max(abs(speed) for targets in turning for speed in targets.velocity.values()) <= FASTEST * (1 + 1e-6)
    # On a circle of 1 m the outer of the wheels, 0.4 m apart, goes 1.2 m where the middle goes 1 m.
    assert turning[-1].velocity == pytest.approx({"c": FASTEST * 0.8 / 1.2, "d": FASTEST})


def test_the_slowest_wheel_decides() -> None:
    found = WheelSpeeds(cart(wheel("a", 0, 1, fastest=10.0), wheel("b", 0, -1, fastest=1.0)), "ab")
    assert found.share({"a": 20.0, "b": -4.0}) == 0.25
    assert found.share({"a": 0.0, "b": 0.0}) == 1.0
    assert math.isclose(found.told_share({"a": 40.0, "b": 2.0}), 0.25)
    (note,) = found.notes
    assert "asked joint 'a'" in note
    assert WheelSpeeds(cart(*FOUR), "abcd").share(dict.fromkeys("abcd", 1e9)) == 1.0


@pytest.mark.parametrize(("radius", "message"), [(1e-7, "at least 1e-06 m"), (1e200, "at most 1000 m")])
def test_lengths_have_bounds(radius: float, message: str) -> None:
    drive = SkidSteer(left=("c",), right=("d",), radius=radius)
    assert (("radius",), f"must be {message}") in list(drive.problems(CAR))


def test_headings_radii_and_torques_as_text() -> None:
    assert (heading_text(1e-5), heading_text(-math.pi / 2)) == ("", ", heading -90 deg from the base's x axis")
    assert (radius_text([0.1, 0.1]), radius_text([0.1, 0.2, 0.1])) == ("wheel radius 0.1 m", "wheel radii 0.1 m, 0.2 m")
    # A torque is the stated one, or that of the joints.
    assert [torque_text(torque, burger(), WHEELS) for torque in (2.0, None)] == [", torque 2 N m", ", torque 10 N m"]
    assert torque_text(None, cart(*FOUR), ("a", "b")) == ""

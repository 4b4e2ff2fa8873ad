"""How wheels move a robot is the inverse of how a drive moves its wheels, whichever drive it is."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sim_action.core.geometry import Twist, Vector3
from sim_action.drives import Drive
from sim_action.drives.ackermann import AckermannDrive
from sim_action.drives.diff import DiffDrive
from sim_action.drives.mecanum import MecanumDrive
from sim_action.drives.skid import SkidSteer
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.command import JointTargets
from sim_action.state.readings import PlanarWay
from tests.drives.carts import FOUR, RADIUS, cart, steered, wheel

QUICK = 1e9
TIME = 0.2
LEFTWARD: Vector3 = (0.0, -1.0, 0.0)

# Wheels that are not amid the base, and one whose axis points the other way.
TWO = cart(wheel("l", 0.1, 0.2), wheel("r", 0.1, -0.3, axis=LEFTWARD))
SIDED = [
    (DiffDrive(left=("l",), right=("r",), acceleration=QUICK), TWO),
    (SkidSteer(left=("a", "b"), right=("c", "d"), acceleration=QUICK, slip=1.4), cart(*FOUR)),
]
# Both wheels roll along the base's y, and left is where x points back.
ASIDE = cart(wheel("l", -0.2, 0.1, axis=(-1.0, 0.0, 0.0)), wheel("r", 0.2, 0.1, axis=(-1.0, 0.0, 0.0)))

CARS = [
    # The axle that is not steered is driven, and behind the base's origin.
    (wheel("c", -0.1, 0.2), wheel("d", -0.1, -0.2), steered("a", 0.4, 0.2), steered("b", 0.4, -0.2)),
    # Tyres beside their kingpins.
    (wheel("c", 0.0, 0.2), wheel("d", 0.0, -0.2), steered("a", 0.5, 0.2, beside=0.05), steered("b", 0.5, -0.2)),
    # Rear wheels that steer.
    (wheel("c", 0.0, 0.2), wheel("d", 0.0, -0.2), steered("a", -0.5, 0.2), steered("b", -0.5, -0.2)),
    # Steering joints that point down.
    (
        wheel("c", 0.0, 0.2),
        wheel("d", 0.0, -0.2),
        steered("a", 0.5, 0.2, axis=(0.0, 0.0, -1.0)),
        steered("b", 0.5, -0.2, axis=(0.0, 0.0, -1.0)),
    ),
]

speeds = st.floats(-2, 2)
turns = st.floats(-3, 3)


def way(drive: Drive, model: RobotModel, twist: Twist) -> PlanarWay:
    """How a drive's own wheels, turned as it wants them for a while, move the point that it drives."""
    assert list(drive.problems(model)) == []
    planned = drive.open(model, 100.0).targets(twist, 200)[-1]
    return moved(drive, model, planned)


def moved(drive: Drive, model: RobotModel, planned: JointTargets) -> PlanarWay:
    motion = drive.wheel_motion(model)
    assert motion is not None
    assert set(motion.gears) == set(planned.velocity)
    assert set(motion.steering) == set(planned.position)
    rolled = {name: gear * planned.velocity[name] * TIME for name, gear in motion.gears.items()}
    return motion.way(rolled, planned.position)


def is_way(found: PlanarWay, ahead: float, left: float, turn: float) -> bool:
    wanted = (ahead * TIME, left * TIME, turn * TIME)
    return (found.x, found.y, found.turn) == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize(("drive", "model"), SIDED)
@given(ahead=speeds, turn=turns)
def test_two_sides_of_wheels(drive: Drive, model: RobotModel, ahead: float, turn: float) -> None:
    assert is_way(way(drive, model, Twist.planar(ahead, turn)), ahead, 0.0, turn)


@given(ahead=speeds, turn=turns)
def test_a_robot_that_does_not_face_its_x(ahead: float, turn: float) -> None:
    drive = DiffDrive(left=("l",), right=("r",), acceleration=QUICK)
    assert is_way(way(drive, ASIDE, Twist.planar(ahead, turn)), 0.0, ahead, turn)


@given(ahead=speeds, left=speeds, turn=turns)
def test_mecanum_wheels(ahead: float, left: float, turn: float) -> None:
    drive = MecanumDrive(left=("a", "b"), right=("c", "d"), acceleration=QUICK)
    assert is_way(way(drive, cart(*FOUR), Twist.planar(ahead, turn, lateral=left)), ahead, left, turn)


@pytest.mark.parametrize("parts", CARS)
@pytest.mark.parametrize("driven", [("c", "d"), ("a", "b"), ("a", "b", "c", "d")])
@given(ahead=speeds, curvature=st.floats(-1, 1))
def test_a_car(parts: tuple[object, ...], driven: tuple[str, ...], ahead: float, curvature: float) -> None:
    assume(abs(ahead) > 1e-6)
    drive = AckermannDrive(steering=("a_steer", "b_steer"), wheels=driven, acceleration=QUICK)
    model = cart(*parts)  # type: ignore[arg-type] # parts of a cart
    assert is_way(way(drive, model, Twist.planar(ahead, curvature * ahead)), ahead, 0.0, curvature * ahead)


def test_wheels_that_are_steered_across_tell_of_no_curve() -> None:
    drive = AckermannDrive(steering=("a_steer", "b_steer"), wheels=("c", "d"))
    planned = JointTargets(position={"a_steer": 1.5, "b_steer": -1.5}, velocity={"c": 1.0, "d": 1.0})
    found = moved(drive, cart(*CARS[0]), planned)
    assert math.isfinite(found.turn)
    assert found.x == pytest.approx(RADIUS * TIME, rel=0.2)


@pytest.mark.parametrize(
    ("drive", "model", "middle"),
    [
        (*SIDED[0], (0.1, -0.05)),
        (*SIDED[1], (0.0, 0.0)),
        (DiffDrive(left=("l",), right=("r",)), ASIDE, (0.0, 0.1)),
        (AckermannDrive(steering=("a_steer", "b_steer"), wheels=("c", "d")), cart(*CARS[0]), (-0.1, 0.0)),
        (MecanumDrive(left=("a", "b"), right=("c", "d")), cart(*FOUR), (0.0, 0.0)),
    ],
)
def test_it_is_the_middle_of_the_axle_that_goes_this_way(
    drive: Drive, model: RobotModel, middle: tuple[float, float]
) -> None:
    motion = drive.wheel_motion(model)
    assert motion is not None
    assert motion.middle_xy == pytest.approx(middle)

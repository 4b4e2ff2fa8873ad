"""What each drive says it can do."""

from __future__ import annotations

import dataclasses
import math

import pytest

from sim_action.core.geometry import Vector3
from sim_action.drives import Drive
from sim_action.drives.ackermann import AckermannDrive
from sim_action.drives.diff import DiffDrive
from sim_action.drives.mecanum import MecanumDrive
from sim_action.drives.skid import SkidSteer
from sim_action.robot.model.kinematics import Mobility
from sim_action.robot.model.robot_model import RobotModel
from tests.drives.carts import FOUR, cart, steered, wheel
from tests.traces import WHEELS, burger, scene

ALONG_X: Vector3 = (-1.0, 0.0, 0.0)
BURGERS = DiffDrive(left=WHEELS[:1], right=WHEELS[1:])
SKID = SkidSteer(left=("a", "b"), right=("c", "d"), slip=2.0, acceleration=0.3)
MECANUM = MecanumDrive(left=("a", "b"), right=("c", "d"))
CAR = AckermannDrive(steering=("a_steer", "b_steer"), wheels=("c", "d"), acceleration=2.0)
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
        (CAR, STEERED, Mobility(ahead=0.2, tightest=1 / (0.5 / math.tan(0.6) + 0.2), acceleration=2.0, wheelbase=0.5)),
    ],
    ids=["diff", "skid", "skid that faces left", "mecanum", "ackermann"],
)
def test_it_says_what_it_can_do(drive: Drive, model: RobotModel, mobility: Mobility) -> None:
    found = drive.prepared(dataclasses.replace(scene(), model=model)).mobility
    assert dataclasses.astuple(found) == pytest.approx(dataclasses.astuple(mobility))

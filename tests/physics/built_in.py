"""The built-in rover, car and arm: lines, turns and stops; and an arm against its Denavit-Hartenberg parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from sim_action.robot.built_in import FOLDER
from tests.physics.arms import angle_at, sag
from tests.physics.case import Case, Run, Setup
from tests.physics.caster import driven
from tests.physics.measures import GRAVITY, Measure, highest_tilt, joint_angle, radius, steady_turn, travelled

GROUP: Final = "built-in"
_ROVER: Final = "husky_a200"
_CAR: Final = "f1tenth"
_ARM: Final = "ur5e_gripper"
Matrix = NDArray[np.float64]


def _stop(model: str, speed: float) -> Setup:
    """Two seconds at a speed, then a stop: both ramps are alike, so the way is that of two seconds at full speed."""
    return Setup(model, 2.5 + speed, {"commands": {"rate": 10, "twist": [{"linear": speed, "for": 2.0}]}})


def _wheeled() -> list[Case]:
    rover, car = _stop(_ROVER, 0.8), _stop(_CAR, 1.0)
    spin = driven(_ROVER, {"angular": 0.8}, 2.5)
    curve = driven(_ROVER, {"linear": 0.5, "angular": 0.5}, 4.0)
    circle = driven(_CAR, {"linear": 1.0, "angular": 0.8}, 3.0)
    tightest = driven(_CAR, {"linear": 0.8, "angular": 1.2}, 4.0)
    # Wheelbase over the tangent of the inner wheel's angle, and half the track.
    least = 0.3302 / math.tan(0.4189) + 0.26 / 2
    rows: tuple[tuple[str, Setup, Measure, str, float, float, bool], ...] = (
        ("husky_a200 stops: way", rover, travelled, "m", 1.6, 0.01, True),
        ("husky_a200 spin: turn rate", spin, steady_turn(1.5, 2.5), "rad/s", 0.8, 0.05, True),
        ("husky_a200 curve: turn rate", curve, steady_turn(2.0, 4.0), "rad/s", 0.5, 0.05, False),
        ("f1tenth stops: way", car, travelled, "m", 2.0, 0.01, True),
        ("f1tenth circle: turn rate", circle, steady_turn(1.5, 3.0), "rad/s", 0.8, 0.02, True),
        ("f1tenth circle: radius", circle, radius(1.5, 3.0), "m", 1.25, 0.02, True),
        ("f1tenth at full lock: radius", tightest, radius(2.0, 4.0), "m", least, 0.02, False),
    )
    tilt: dict[str, Any] = {"unit": "deg", "kind": "bound", "truth": 0.0, "tolerance": 1.0, "quick": False}
    return [
        *(
            Case(name, GROUP, (setup,), measure, unit, "analytic", truth, share * truth, quick=quick)
            for name, setup, measure, unit, truth, share, quick in rows
        ),
        Case("husky_a200 stops: tilt", GROUP, (rover,), highest_tilt, **tilt),
        Case("f1tenth stops: tilt", GROUP, (car,), highest_tilt, **tilt),
    ]


# The manufacturer's parameters, in m and rad.
_A: Final = (0.0, -0.425, -0.3922, 0.0, 0.0, 0.0)
_D: Final = (0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996)
_ALPHA: Final = (math.pi / 2, 0.0, 0.0, math.pi / 2, -math.pi / 2, 0.0)
_JOINTS: Final = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
_NAMES: Final = tuple(f"{name}_joint" for name in _JOINTS)
_LINKS: Final = ("shoulder_link", "upper_arm_link", "forearm_link", "wrist_1_link", "wrist_2_link", "wrist_3_link")
_TOOL: Final = {"tool0": 0.0, "left_finger": 0.096, "right_finger": 0.096}
"""Parts of the gripper -> the place of their frame on the flange's axis, in m."""


def frames(angles: Sequence[float]) -> list[Matrix]:
    """The frames (4, 4) in which links rest, after the turn of their joint; the last one is that of the flange."""
    # The base of the driver is turned by half a turn from that of the table.
    frame, found = np.diag([-1.0, -1.0, 1.0, 1.0]), []
    for angle, a, d, alpha in zip(angles, _A, _D, _ALPHA, strict=True):
        cos, sin = math.cos(angle), math.sin(angle)
        turned = frame @ np.array([[cos, -sin, 0, 0], [sin, cos, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        found.append(turned)
        cos, sin = math.cos(alpha), math.sin(alpha)
        frame = turned @ np.array([[1, 0, 0, a], [0, cos, -sin, 0], [0, sin, cos, d], [0, 0, 0, 1]])
    return [*found, frame]


def _masses() -> dict[str, tuple[float, Matrix]]:
    """Link -> its mass, and its centre of mass in its own frame; as the file has them."""
    found = {}
    for link in ET.parse(FOLDER / f"{_ARM}.urdf").getroot().iterfind("link[inertial]"):
        mass, origin = link.find("inertial/mass"), link.find("inertial/origin")
        assert mass is not None
        assert origin is not None
        centre = [float(number) for number in origin.attrib["xyz"].split()]
        found[link.attrib["name"]] = float(mass.attrib["value"]), np.array([*centre, 1.0])
    return found


def holding_torques(angles: Sequence[float]) -> Matrix:
    """The torques (6,) in N m that hold the arm: the slope of its potential energy."""
    masses = _masses()

    def potential(angles: Matrix) -> float:
        *links, flange = frames(angles.tolist())
        energy = sum(masses[name][0] * (frame @ masses[name][1])[2] for name, frame in zip(_LINKS, links, strict=True))
        for name, along in _TOOL.items():
            mass, centre = masses[name]
            # The fingers are opposite to each other, so only what they have along the axis counts.
            energy += mass * (flange @ np.array([0.0, 0.0, along + centre[2], 1.0]))[2]
        return float(energy * GRAVITY)

    here, step = np.array(angles), 1e-5
    turns = np.eye(6) * step
    return np.array([(potential(here + turn) - potential(here - turn)) / (2 * step) for turn in turns])


_POSES: Final = ((0.4, -1.2, 1.0, -0.7, -1.1, 0.3), (-1.0, -0.6, 0.9, 0.5, 0.8, -0.4), (2.2, -2.0, -1.1, 0.3, 2.0, 1.5))


def _off_by(truth: Matrix) -> Measure:
    """The largest difference of any joint's mean effort in the last half second from its true torque, in N m."""

    def measure(run: Run) -> float:
        columns = [run.trace.joint_names.index(name) for name in _NAMES]
        last = run.trace.joint_effort[run.row(run.setup.seconds - 0.5) :, columns]
        return float(np.abs(last.mean(axis=0) - truth).max())

    return measure


_GAP: Final = 0.09
_BALL: Final = 0.01
_BALLS: Final = {
    "ahead": (0.0, 0.0, 0.096 + _GAP + _BALL),
    "left": (0.075 + _GAP + _BALL, 0.0, 0.078),
    "above": (0.0, 0.0375 + _GAP + _BALL, 0.03),
}
"""The middles of balls in the frame of the flange: in front of the gripper's bar and its end, and above its palm."""


def _misplaced(run: Run) -> float:
    """The largest error of the distance to a ball whose place is known in the frame of the flange, in m."""
    assert len(run.trace.clearances) == len(_BALLS)
    return max(abs(float(record.distance.min()) - _GAP) for record in run.trace.clearances.values())


def _held(angles: Sequence[float]) -> Setup:
    flange = frames(angles)[-1]
    objects, expected = [], []
    for name, place in _BALLS.items():
        x, y, z = (flange @ np.array([*place, 1.0]))[:3].tolist()
        objects.append({"name": name, "sphere": {"radius": _BALL}, "pose": {"x": x, "y": y, "z": z}})
        expected.append({"clearance": {"at_least": "1 cm", "to": [name], "links": ["tool0"]}})
    keys = {"world": {"objects": objects}, "expect": expected, "allow": ["fixed-base"]}
    return Setup(_ARM, 1.0, keys, {"joints": dict(zip(_NAMES, angles, strict=True))}, settle=0.5)


def _overshoot(run: Run) -> float:
    """How far the wrist turns beyond 1 rad, or misses it at the end, in rad."""
    angle = joint_angle(run, "wrist_3_joint")
    return max(float(angle.max()) - 1.0, abs(float(angle[-1]) - 1.0))


def _arm() -> list[Case]:
    cases = []
    for number, angles in enumerate(_POSES, start=1):
        setup, torques = _held(angles), holding_torques(angles)
        figures: dict[str, Any] = {"group": GROUP, "setups": (setup,), "kind": "bound", "truth": 0.0}
        figures |= {"family": f"ur5e_gripper in pose {number}", "quick": number == 1}
        most = 0.01 * float(np.abs(torques).max())
        name = f"ur5e_gripper in pose {number}"
        cases += [
            Case(f"{name}: sag", measure=sag, unit="rad", tolerance=0.0005, **figures),
            Case(f"{name}: torques", measure=_off_by(torques), unit="N m", tolerance=most, **figures),
            Case(f"{name}: place of the gripper", measure=_misplaced, unit="m", tolerance=0.0002, **figures),
        ]
    step = {"joints": [{"at": 0, "position": {"wrist_3_joint": 1.0}}], "interpolation": "hold", "rate": 240}
    setup = Setup(_ARM, 1.0, {"commands": step, "allow": ["fixed-base"]}, settle=0.5)
    figures = {"group": GROUP, "setups": (setup,), "unit": "rad", "family": "ur5e_gripper step"}
    # The wrist is light: it turns at its limit of 180 deg/s nearly at once.
    truth = 0.2 * math.pi
    cases += [
        Case(
            "ur5e_gripper step: angle after 0.2 s",
            measure=angle_at("wrist_3_joint", 0.2),
            kind="analytic",
            truth=truth,
            tolerance=0.03 * truth,
            **figures,
        ),
        Case("ur5e_gripper step: overshoot", measure=_overshoot, kind="bound", truth=0.0, tolerance=0.002, **figures),
    ]
    return cases


CASES: Final = (*_wheeled(), *_arm())

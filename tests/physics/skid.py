"""Skid-steered robots: the turn that is asked for, from any start yaw and at any rate, in both engines.

A twist asks for a turn rate. The drive knows the slip of isotropic friction, so the robot turns at that rate; it may
not matter in which direction the robot starts, nor how long a physics step is. The turn is measured after the ramps of
the wheels have ended.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from tests.physics.case import Case, Setup
from tests.physics.caster import driven
from tests.physics.measures import curve_speed, ratio, spread, steady_turn
from tests.physics.robots import ROVER_SIDES, SIX_WHEELS, rover
from tools.bench.robots import ROBOTS

GROUP: Final = "skid"
YAWS_DEG: Final = (0, 1, 5, 20, 45)
RATES: Final = (240.0, 480.0, 1000.0)
_START, _END = 3.0, 6.0


@dataclass(frozen=True)
class Skid:
    """A robot and its manoeuvres: name -> twist."""

    name: str
    model: str
    robot: Mapping[str, object]
    twists: Mapping[str, Mapping[str, float]]
    bundled: bool = False


CURVE_AND_SPIN: Final = {"curve": {"linear": 0.5, "angular": 0.5}, "spin": {"linear": 0.0, "angular": 0.8}}
ROVER_DRIVE: Final = {"drive": {"skid": dict(ROVER_SIDES)}}
SIX_WHEEL_DRIVE: Final = {
    "drive": {"skid": {side: [f"{end}_{side}_wheel_joint" for end in SIX_WHEELS] for side in ("left", "right")}}
}
_KNOWN: Final = {known.name: known for known in ROBOTS}
_R2D2S: Final = {side: [f"{side}_front_wheel_joint", f"{side}_back_wheel_joint"] for side in ("left", "right")}

# The runs of all cases of this group take twice as long as the rest of the zoo.
_QUICK: Final = ("rover square curve", "rover heavy curve", "husky curve")

ROVERS: Final = (
    Skid("rover long", rover(0.50, 0.30), ROVER_DRIVE, CURVE_AND_SPIN),
    Skid("rover square", rover(0.40, 0.35), ROVER_DRIVE, CURVE_AND_SPIN),
    Skid("rover wide", rover(0.25, 0.45), ROVER_DRIVE, CURVE_AND_SPIN),
    Skid("rover on six wheels", rover(0.6, 0.45, ends=SIX_WHEELS), SIX_WHEEL_DRIVE, CURVE_AND_SPIN),
    Skid("husky", _KNOWN["husky"].path, _KNOWN["husky"].keys, CURVE_AND_SPIN, bundled=True),
    Skid(
        "r2d2",
        _KNOWN["r2d2"].path,
        # At 1 m/s^2, wheels with the inertia of flywheels would lift its front off the ground.
        {"drive": {"skid": {**_R2D2S, "acceleration": 0.2}}},
        {"curve": {"linear": 0.3, "angular": 0.3}, "spin": {"linear": 0.0, "angular": 0.3}},
        bundled=True,
    ),
)


def _setup(skid: Skid, twist: Mapping[str, float], yaw_deg: float, rate: float) -> Setup:
    setup = driven(skid.model, dict(twist), _END, pose={"yaw": math.radians(yaw_deg)}, **skid.robot)
    return replace(setup, rate=rate)


def cases_of(skid: Skid, manoeuvre: str) -> list[Case]:
    family = f"{skid.name} {manoeuvre}"
    twist, turn = skid.twists[manoeuvre], steady_turn(_START, _END)
    asked = twist["angular"]
    figures: dict[str, Any] = {"family": family, "bundled": skid.bundled}
    yaws = tuple(_setup(skid, twist, yaw, RATES[0]) for yaw in YAWS_DEG)
    rates = tuple(_setup(skid, twist, 0, rate) for rate in RATES)
    turned_rates = tuple(_setup(skid, twist, 5, rate) for rate in RATES)
    quick = family in _QUICK
    cases = []
    for yaw, setup in zip(YAWS_DEG, yaws, strict=True):
        name = f"{family} from {yaw} deg"
        figures["quick"] = quick and setup == yaws[0]
        cases.append(Case(name, GROUP, (setup,), turn, "rad/s", "analytic", asked, 0.05 * asked, **figures))
    figures["quick"] = False
    for over, setups in (("start yaws", yaws), ("rates", rates), ("rates from 5 deg", turned_rates)):
        name = f"{family} over {over}"
        cases.append(Case(name, GROUP, setups, spread(turn), "of the turn", "spread", 0.0, 0.02, **figures))
    figures["quick"] = quick
    if speed := twist["linear"]:
        name, measure = f"{family} speed", curve_speed(_START, _END)
        cases.append(Case(name, GROUP, yaws[:1], measure, "m/s", "analytic", speed, 0.05 * speed, **figures))
    figures["between"] = True
    name = f"{family} engines"
    cases.append(Case(name, GROUP, yaws[:1], ratio(turn), "of the turn", "spread", 0.0, 0.05, **figures))
    return cases


CASES: Final = tuple(case for skid in ROVERS for manoeuvre in skid.twists for case in cases_of(skid, manoeuvre))

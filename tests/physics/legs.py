"""Robots on four legs: the ground carries their whole weight, they do not drift, and a drop adds no energy."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from tests.physics.case import Case, Kind, Run, Setup
from tests.physics.measures import GRAVITY, Measure, final_speed, highest_tilt, rebound, travelled
from tests.physics.robots import FEET, STANCE, quadruped
from tools.bench.robots import QUADRUPED_STANCE, ROBOTS

GROUP: Final = "legs"
_KNOWN: Final = {known.name: known for known in ROBOTS}


@dataclass(frozen=True)
class _Legged:
    """A robot."""

    name: str
    model: str
    robot: Mapping[str, object]
    feet: Sequence[str]
    drop: float  # the height of the base in m at which its feet are 5 cm above the ground; 0: it is not dropped
    bundled: bool = False
    held: Sequence[str] = ()  # joints without limits, which nothing holds but a command


_LEGS: Final = ("FR", "FL", "RR", "RL")
_LAIKAGOS: Final = ("hip_motor_2_chassis", "upper_leg_2_hip_motor", "lower_leg_2_upper_leg")
ROBOTS_ON_LEGS: Final = (
    # Hips are sqrt(2) 0.2 m above feet of 2 cm.
    _Legged("quadruped 10 kg", quadruped(), {"joints": STANCE}, FEET, 0.20 * 2**0.5 + 0.02 + 0.05),
    _Legged("quadruped 40 kg", quadruped(40.0), {"joints": STANCE}, FEET, 0.20 * 2**0.5 + 0.02 + 0.05),
    # Hips are 0.209 cos(40 deg) + 0.175 cos(50 deg) m above feet of 2 cm.
    _Legged("built-in quadruped", "quadruped", {"joints": QUADRUPED_STANCE}, FEET, 0.1601 + 0.1125 + 0.02 + 0.05),
    _Legged("a1", _KNOWN["a1"].path, _KNOWN["a1"].keys, [f"{leg}_toe" for leg in _LEGS], 0.0, bundled=True),
    _Legged(
        "laikago",
        _KNOWN["laikago"].path,
        # Its y axis points upwards.
        {**_KNOWN["laikago"].keys, "pose": {"roll": math.pi / 2}},
        [f"toe{leg}" for leg in _LEGS],
        0.0,
        bundled=True,
        held=[f"{leg}_{part}_joint" for leg in _LEGS for part in _LAIKAGOS],
    ),
)


def carried(feet: Sequence[str]) -> Measure:
    """The mean sum of the forces on feet in the last second, over the weight."""

    def measure(run: Run) -> float:
        rows = round(1.0 * _READINGS_HZ)
        forces = [run.trace.sensors[foot].columns["force"][-rows:].mean() for foot in feet]
        return float(sum(forces)) / (run.mass * GRAVITY)

    return measure


_READINGS_HZ: Final = 60.0


def _cases(legged: _Legged) -> list[Case]:
    sensors = [{"contact": {}, "name": foot, "link": foot, "rate": _READINGS_HZ, "trace": True} for foot in legged.feet]
    keys: dict[str, object] = {"sensors": sensors}
    if legged.held:
        keys["commands"] = {"joints": [{"at": 1.0, "position": dict.fromkeys(legged.held, 0.0)}]}
    stand = Setup(legged.model, 4.0, keys, legged.robot)
    family: dict[str, Any] = {"family": legged.name, "bundled": legged.bundled}
    dropped = Setup(legged.model, 3.0, {}, {**legged.robot, "pose": {"z": legged.drop}}, settle=0.0)
    rows: list[tuple[str, Setup, Measure, str, Kind, float, float]] = [
        ("weight on its feet", stand, carried(legged.feet), "of the weight", "analytic", 1.0, 0.01),
        ("drift while it stands", stand, travelled, "m", "bound", 0.0, 0.002),
        ("tilt while it stands", stand, highest_tilt, "deg", "bound", 0.0, 2.0),
        ("rebound from 5 cm", dropped, rebound, "m", "bound", 0.0, 0.01),
        ("speed after a drop", dropped, final_speed, "m/s", "bound", 0.0, 0.005),
    ]
    return [
        Case(f"{legged.name}: {what}", GROUP, (setup,), measure, unit, kind, truth, tolerance, **family)
        for what, setup, measure, unit, kind, truth, tolerance in rows
        if setup is stand or legged.drop
    ]


CASES: Final = tuple(case for legged in ROBOTS_ON_LEGS for case in _cases(legged))

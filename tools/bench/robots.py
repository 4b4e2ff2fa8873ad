"""Robots that come with the engine, as scenarios name them: for tests, docs/models/robots.md and benchmarks."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from sim_action.core.permissions import Permissions
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_spec import Robot
from sim_action.scenario.loading import load_scenario
from sim_action.scenario.model import LoadedScenario

_PACKAGE: Final = find_spec("pybullet_data")
DATA: Final = Path(_PACKAGE.origin).parent if _PACKAGE and _PACKAGE.origin else Path("no-pybullet_data")
"""The folder of the robots; it does not exist without PyBullet."""

WORKSPACE: Final = Workspace(DATA, DATA, allow_outside=True)


@dataclass(frozen=True, slots=True)
class KnownRobot:
    """A robot that loads.

    Attributes:
        name: as people call it.
        model: built in, or a path below `DATA`.
        keys: of the scenario's `robot:`, beside the model.
        drive: whose wheels must be braked for it to rest.
    """

    name: str
    model: str
    keys: Mapping[str, object] = field(default_factory=dict)
    drive: Mapping[str, object] = field(default_factory=dict)

    @property
    def path(self) -> str:
        """The model, from anywhere."""
        return str(DATA / self.model) if "/" in self.model or "." in self.model else self.model

    @property
    def robot(self) -> Robot:
        """As a scenario would have it."""
        return Robot.model_validate_json(json.dumps({"model": self.path, **self.keys}))

    def resting(self, folder: Path, seconds: float) -> LoadedScenario:
        """A scenario in which it rests, written to a folder."""
        drive, commands = ({"drive": self.drive}, {"commands": _BRAKES}) if self.drive else ({}, {})
        scenario = {
            "name": f"{self.name} rests",
            "robot": {"model": self.path, **self.keys, **drive},
            **commands,
            # The y axis of a robot that starts rolled by 90 deg points up.
            "expect": [{"upright": {"max_tilt": "95 deg" if "pose" in self.keys else "5 deg"}}, _SMALL_TRAVEL],
            "duration": seconds,
            "time_limit": seconds,
            # A fixed base does rest.
            "allow": ["fixed-base"],
        }
        path = folder / f"{self.name}.sim.yml"
        path.write_text(json.dumps(scenario))
        return load_scenario(path, Permissions(outside=True))


_SMALL_TRAVEL: Final = {"travel": {"at_most": "2 cm"}}
_BRAKES: Final = {"twist": [{"linear": 0}]}
_LEGS: Final = ("FR", "FL", "RR", "RL")
_STANCE: Final = {f"{leg}_upper_joint": 0.8 for leg in _LEGS} | {f"{leg}_lower_joint": -1.6 for leg in _LEGS}
QUADRUPED_STANCE: Final = {
    f"{end}_{side}_{name}": math.radians(angle)
    for end in ("front", "rear")
    for side in ("left", "right")
    for name, angle in (("thigh", 40.0), ("knee", -90.0))
}
"""A pose of the built-in quadruped in which its feet are 0.3 mm in front of its hips."""
# Wheels that nobody holds roll, and a robot of 44 kg is never quite level.
_HUSKYS_WHEELS: Final = {side: [f"front_{side}_wheel", f"rear_{side}_wheel"] for side in ("left", "right")}

BURGER: Final = KnownRobot("burger", "turtlebot3_burger")
OUR_ROBOTS: Final = (
    BURGER,
    KnownRobot("rover", "husky_a200"),
    KnownRobot("car", "f1tenth"),
    KnownRobot("arm", "ur5e_gripper"),
    KnownRobot("quadruped", "quadruped", {"joints": QUADRUPED_STANCE}),
)
"""The built-in robots."""

MINITAUR: Final = KnownRobot("minitaur", "quadruped/minitaur.urdf", {"allow": ["missing-limits"]})

ROBOTS: Final = (
    KnownRobot("husky", "husky/husky.urdf", {}, {"diff": _HUSKYS_WHEELS}),
    KnownRobot("racecar", "racecar/racecar.urdf"),
    KnownRobot("r2d2", "r2d2.urdf"),
    KnownRobot("a1", "a1/a1.urdf", {"joints": _STANCE}),
    KnownRobot("laikago", "laikago/laikago_toes.urdf", {"pose": {"roll": "90 deg"}}),
    MINITAUR,
    KnownRobot("kuka_iiwa", "kuka_iiwa/model.urdf", {"base": "fixed"}),
    KnownRobot("franka_panda", "franka_panda/panda.urdf", {"base": "fixed"}),
)
"""The robots of `pybullet_data`."""

REFUSED: Final = KnownRobot("humanoid", "humanoid/humanoid.urdf")
"""Its file ends in a NUL."""

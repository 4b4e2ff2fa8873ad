"""A scene: the robot, its loaded model and what surrounds it, as engines, drives and assertions get to see it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from sim_action import units
from sim_action.robot_model import RobotModel
from sim_action.workspace import Workspace
from sim_action.world import Physics, Robot, World

# Where in a scenario a problem is (the keys that lead there), and what it is.
SpecProblem = tuple[tuple[str | int, ...], str]
SpecProblems = Iterator[SpecProblem]


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything that is simulated, with names resolved and files read."""

    robot: Robot
    model: RobotModel
    world: World
    physics: Physics
    workspace: Workspace

    @property
    def joint_positions(self) -> dict[str, float]:
        """Where joints begin that the scenario names, in rad, or m if prismatic. Raises units.UnitError."""
        joints = self.model.joints_by_name
        return {
            name: units.parse(written, joints[name].dimension("position"))
            for name, written in self.robot.joints.items()
        }

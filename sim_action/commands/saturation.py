"""Clip joint targets to the limits of the motors, as real motors, Gazebo and ros_control do.

Physics engines do not clip: there, an effort of ten times the limit accelerates ten times as much.
"""

from __future__ import annotations

from collections.abc import Mapping

from sim_action.core import units
from sim_action.core.records import replace
from sim_action.robot.model.kinematics import beyond_limits
from sim_action.robot.model.robot_model import Reading, RobotModel
from sim_action.state.command import Answer, JointTargets


class Saturation:
    """Clips efforts and velocities to the limits of a model, and adds one note per joint and quantity.

    Attributes:
        notes: notes for the user.
    """

    def __init__(self, model: RobotModel, source: str) -> None:
        self.notes: list[str] = []
        self._source = source
        self._joints = model.joints_by_name
        # A joint is removed once it has a note.
        self._limited = {joint.name for joint in model.moving_joints if (joint.lower, joint.upper) != (None, None)}
        moving = model.moving_joints
        self._max_effort = {joint.name: joint.max_effort for joint in moving if joint.max_effort is not None}
        self._max_velocity = {joint.name: joint.max_velocity for joint in moving if joint.max_velocity is not None}
        self._noted: set[tuple[str, Reading]] = set()

    def clip_answer(self, answer: Answer) -> Answer:
        """Return an answer with all its joint targets clipped."""
        if isinstance(answer, tuple):
            return tuple(self.clip(command) if isinstance(command, JointTargets) else command for command in answer)
        return self.clip(answer) if isinstance(answer, JointTargets) else answer

    def clip(self, targets: JointTargets) -> JointTargets:
        """Return clipped targets. A position beyond the limits is kept: the joint stops at its limit."""
        self._note_positions(targets.position)
        velocity = self._cut(targets.velocity, "velocity", self._max_velocity)
        effort = self._cut(targets.effort, "effort", self._max_effort)
        max_effort = self._cut(targets.max_effort, "effort", self._max_effort)
        if velocity is targets.velocity and effort is targets.effort and max_effort is targets.max_effort:
            return targets
        return replace(targets, velocity=velocity, effort=effort, max_effort=max_effort)

    def _note_positions(self, asked: Mapping[str, float]) -> None:
        for name, position in asked.items():
            if name in self._limited and (beyond := beyond_limits(self._joints[name], position)):
                self._limited.remove(name)
                self.notes.append(
                    f"{self._source} commanded joint '{name}' to a position that it cannot reach: {beyond}"
                )

    def _cut(self, asked: Mapping[str, float], reading: Reading, limits: Mapping[str, float]) -> Mapping[str, float]:
        beyond = {name for name, value in asked.items() if abs(value) > limits.get(name, abs(value))}
        if not beyond:
            return asked
        for name in sorted(beyond):
            self._note(name, reading, asked[name], limits[name])
        return {
            name: max(-limits[name], min(limits[name], value)) if name in beyond else value
            for name, value in asked.items()
        }

    def _note(self, name: str, reading: Reading, asked: float, limit: float) -> None:
        if (name, reading) in self._noted:
            return
        self._noted.add((name, reading))
        unit = self._joints[name].dimension(reading).si
        found, allowed = units.display_apart(abs(asked), limit, unit)
        self.notes.append(
            f"{self._source} commanded {found} for joint '{name}'; it was clipped to {allowed}, its {reading} limit"
        )

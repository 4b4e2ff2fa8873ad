"""The controllers that a scenario states for nodes to command by topics, with the names and topics of ros2_control."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import Field, model_validator

from sim_action.core.field_types import FrozenModel
from sim_action.core.wording import FirstFew
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.model.joint_selection import joints_set_by, setting_problems
from sim_action.robot.model.robot_model import RobotModel

Names = Annotated[tuple[str, ...], Field(min_length=1)]


class JointController(FrozenModel):
    """A controller: the joints that it moves, by name, by pattern such as `'*_hip'`, or by group of the SRDF."""

    trajectory: Annotated[
        Names | None,
        Field(description="joints that follow a `trajectory_msgs/JointTrajectory` on `/NAME/joint_trajectory`"),
    ] = None
    position: Annotated[
        Names | None, Field(description="joints whose positions are a `std_msgs/Float64MultiArray` on `/NAME/commands`")
    ] = None
    velocity: Annotated[Names | None, Field(description="joints whose velocities are, likewise")] = None
    effort: Annotated[Names | None, Field(description="joints whose efforts are, likewise")] = None

    @model_validator(mode="after")
    def _has_one_kind(self) -> Self:
        if len(self.model_fields_set) != 1 or not self.names:
            raise ValueError("a controller needs exactly one of 'trajectory', 'position', 'velocity' and 'effort'")
        return self

    @property
    def kind(self) -> str:
        """The key that is stated."""
        (kind,) = self.model_fields_set
        return kind

    @property
    def names(self) -> tuple[str, ...]:
        """The names, patterns and groups of its joints."""
        names: tuple[str, ...] | None = getattr(self, self.kind)
        return names or ()

    def topic(self, name: str) -> str:
        """Return its usual topic; `name`: that of the controller."""
        return f"/{name.strip('/')}/{'joint_trajectory' if self.kind == 'trajectory' else 'commands'}"

    def joints(self, model: RobotModel) -> tuple[str, ...]:
        """Return its joints, in the order of the names, and in that of the model for patterns and groups."""
        found = joints_set_by(model, dict.fromkeys(self.names))
        return tuple(dict.fromkeys(joint for name in self.names for joint in found[name]))


def joint_problems(controllers: Mapping[str, JointController], model: RobotModel) -> SpecProblems:
    """Yield unknown joints, joints without a motor, and joints of two controllers."""
    hinted, first = FirstFew(), dict[str, str]()
    for name, controller in controllers.items():
        key = (name, controller.kind)
        problems = list(setting_problems(model, dict.fromkeys(controller.names, 0.0), hinted))
        yield from ((key, message) for _, message in problems)
        for joint in controller.joints(model):
            if (why := model.why_not_driven(joint)) is not None:
                yield key, why
            elif (other := first.setdefault(joint, name)) != name:
                yield key, f"joint '{joint}' already obeys the controller '{other}'"

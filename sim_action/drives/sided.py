"""What drives have in common that steer by the difference of two sides of wheels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Self

from pydantic import Field

from sim_action.core.field_types import PositiveMetres, PositiveMetresPerSecondSquared
from sim_action.core.yaml_errors import SpecProblems
from sim_action.drives import Drive
from sim_action.drives.heading import Rolling, along, axle_problems, heading_of, rolling, turned_forward
from sim_action.drives.keys import Heading, MotorTorque, WheelRadius
from sim_action.drives.plugins import StatedSides, sides_by_plugin
from sim_action.drives.sided_motion import SidedMotion
from sim_action.drives.wheel_problems import LEAST_LENGTH, joint_problems, length_problems
from sim_action.drives.wheel_speeds import WheelSpeeds
from sim_action.drives.wheels import Wheel, wheel
from sim_action.drives.wording import heading_text, radius_text, remarked, torque_text
from sim_action.robot.kinematics import Mobility
from sim_action.robot.robot_model import RobotModel
from sim_action.world import GRAVITY

if TYPE_CHECKING:
    from sim_action.drives.sided_ways import SidedWays

JointNames = Annotated[tuple[str, ...], Field(min_length=1)]

# In rad from the base's x axis: rather a mistake than a robot that goes that way.
_BACKWARD: Final = math.radians(135)


class SidedDrive(Drive):
    """Wheels on the left and on the right."""

    title: ClassVar[str]
    """How people call it."""
    plugins: ClassVar[tuple[str, ...]]
    """Those of Gazebo that say which wheels it has."""

    left: Annotated[JointNames, Field(description="joints of the wheels on the left")]
    right: Annotated[JointNames, Field(description="joints of the wheels on the right")]
    radius: WheelRadius = None
    separation: Annotated[
        PositiveMetres | None, Field(description="between left and right wheels; left out: read from the model")
    ] = None
    acceleration: Annotated[PositiveMetresPerSecondSquared, Field(description="limit at the rim of a wheel")] = 1.0
    torque: MotorTorque = None
    heading: Heading = None

    @classmethod
    def by_plugin(cls, model: RobotModel) -> Self | None:
        """What Gazebo's plugin in the model says, if that fits the model."""
        stated = sides_by_plugin(model, cls.plugins)
        drive = cls.as_stated(model, stated) if stated else None
        return drive if drive and not any(drive.problems(model)) else None

    @classmethod
    def as_stated(cls, model: RobotModel, stated: StatedSides) -> Self:
        """What a plugin says. In Gazebo, joints turn forward to go forward, on whatever side they are."""
        drive = cls(left=stated.left, right=stated.right, **stated.figures)
        heading = turned_forward(drive._wheels(model))
        if heading is None or (abs(heading) <= _BACKWARD and math.cos(heading - drive.forward(model)) > 0):
            return drive
        return drive.model_copy(update={"heading": heading})

    def problems(self, model: RobotModel) -> SpecProblems:
        """Joints that the model has not, wheels that do not roll, figures that it does not tell."""
        unknown = [*joint_problems(model, "left", self.left), *joint_problems(model, "right", self.right)]
        yield from unknown
        if unknown:
            return
        yield from length_problems(self, "radius", "separation")
        if set(self.left) & set(self.right):
            yield ("right",), "a wheel cannot be on both sides"
            return
        heading = self.forward(model)
        for found in self._wheels(model):
            yield from axle_problems(found, heading)
        if self.heading is None and abs(heading) > _BACKWARD:
            yield ("left",), "these wheels are on the right in the model; swap 'left' and 'right', or give 'heading'"
        if self.separation is None and self.separation_in(model) < LEAST_LENGTH:
            yield (), "the left and right wheels are at the same place in the model; give 'separation'"
        for found in self._wheels(model):
            if self.radius is None and found.radius is None:
                yield (), f"the model does not tell the radius of the wheel at '{found.joint}'; give 'radius'"
                return

    def open(self, model: RobotModel, rate: float, gravity: float = GRAVITY) -> SidedMotion:
        """See Drive.open."""
        gears = self._gears(model)
        return SidedMotion(
            left={name: gears[name] for name in self.left},
            right={name: gears[name] for name in self.right},
            separation=self._effective_separation(model),
            most_change=self.acceleration / rate,
            speeds=WheelSpeeds(model, gears),
            torque=self.torque,
        )

    def wheel_motion(self, model: RobotModel) -> SidedWays:
        """See Drive.wheel_motion."""
        from sim_action.drives.sided_ways import SidedWays

        heading = self.forward(model)
        left, right = self.sides(model)
        ahead = _mean([placed.ahead for placed in (*left, *right)])
        middle = along(heading, ahead, (_mean_left(left) + _mean_left(right)) / 2)
        separation = self._effective_separation(model)
        return SidedWays(self._gears(model), self.left, self.right, separation, heading, middle)

    def mobility(self, model: RobotModel) -> Mobility:
        """See Drive.mobility."""
        left, right = self.sides(model)
        return Mobility(
            heading=self.forward(model),
            ahead=-_mean([placed.ahead for placed in (*left, *right)]),
            acceleration=self.acceleration,
            turn_acceleration=2 * self.acceleration / self._effective_separation(model),
        )

    def describe(self, model: RobotModel, gravity: float = GRAVITY) -> str:
        """See Drive.describe."""
        sides = f"left {', '.join(self.left)}; right {', '.join(self.right)}"
        separation = f"separation {self.separation_in(model):.4g} m{self.slip_text(model)}"
        torque = torque_text(self.torque, model, (*self.left, *self.right))
        figures = (
            f"{self.title}: {sides}; {radius_text([*self.radii(model).values()])}, {separation}, "
            f"acceleration {self.acceleration:.4g} m/s^2{torque}{heading_text(self.forward(model))}"
        )
        stated = sides_by_plugin(model, self.plugins)
        return remarked(figures, stated.remarks if stated and self == self.as_stated(model, stated) else ())

    def forward(self, model: RobotModel) -> float:
        """Where forward is, in rad from the base's x axis to the left."""
        if self.heading is not None:
            return self.heading
        left, right = ([wheel(model, name) for name in side] for side in (self.left, self.right))
        return heading_of((*left, *right), left, right)

    def slip_factor(self, model: RobotModel) -> float:
        """By how much further apart the wheels seem to be when the robot turns."""
        return 1.0

    def slip_text(self, model: RobotModel) -> str:
        """What to say of that."""
        return ""

    def sides(self, model: RobotModel) -> tuple[list[Rolling], list[Rolling]]:
        """The wheels on the left, and those on the right."""
        heading = self.forward(model)
        left, right = ([rolling(wheel(model, name), heading) for name in side] for side in (self.left, self.right))
        return left, right

    def radii(self, model: RobotModel) -> dict[str, float]:
        """Joint -> the radius of its wheel in m; problems() reports those that nobody tells."""
        radii = {found.joint: self.radius or found.radius for found in self._wheels(model)}
        return {joint: radius for joint, radius in radii.items() if radius is not None}

    def _gears(self, model: RobotModel) -> dict[str, float]:
        left, right = self.sides(model)
        radii = self.radii(model)
        return {placed.joint: placed.turns * radii[placed.joint] for placed in (*left, *right)}

    def _wheels(self, model: RobotModel) -> list[Wheel]:
        return [wheel(model, name) for name in (*self.left, *self.right)]

    def _effective_separation(self, model: RobotModel) -> float:
        return self.separation_in(model) * self.slip_factor(model)

    def separation_in(self, model: RobotModel) -> float:
        """Between left and right wheels, in m."""
        if self.separation is not None:
            return self.separation
        left, right = self.sides(model)
        return abs(_mean_left(left) - _mean_left(right))


def _mean_left(wheels: Sequence[Rolling]) -> float:
    return _mean([placed.left for placed in wheels])


def _mean(values: Sequence[float]) -> float:
    # As statistics.fmean has it, which takes longer to import than a robot to be recognised.
    return math.fsum(values) / len(values)

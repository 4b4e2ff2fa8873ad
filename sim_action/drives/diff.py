"""Differential drive: wheels on the left and on the right that turn at speeds of their own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, ClassVar, Final, Self

from pydantic import Field

from sim_action import units
from sim_action.command import JointTargets
from sim_action.drives import Drive
from sim_action.drives.diff_plugin import StatedWheels, stated_by_plugin
from sim_action.drives.wheels import Wheel, radius, wheel
from sim_action.geometry import Twist
from sim_action.quantities import PositiveMetres, PositiveMetresPerSecondSquared, PositiveNewtonMetres
from sim_action.robot_model import RobotModel
from sim_action.scene import SpecProblems

JointNames = Annotated[tuple[str, ...], Field(min_length=1)]


class DiffDrive(Drive):
    """Two sides of wheels; forward speed is their mean, turning rate their difference over the separation.

    Wheel speeds follow a twist by a ramp, as Gazebo's diff drive plugin does (`wheelAcceleration`).
    """

    key: ClassVar[str] = "diff"

    left: Annotated[JointNames, Field(description="joints of the wheels on the left")]
    right: Annotated[JointNames, Field(description="joints of the wheels on the right")]
    radius: Annotated[PositiveMetres | None, Field(description="of a wheel; left out: read from the model")] = None
    separation: Annotated[
        PositiveMetres | None, Field(description="between left and right wheels; left out: read from the model")
    ] = None
    acceleration: Annotated[PositiveMetresPerSecondSquared, Field(description="limit at the rim of a wheel")] = 1.0
    torque: Annotated[
        PositiveNewtonMetres | None, Field(description="limit of a wheel's motor; left out: the joint's own limit")
    ] = None

    @classmethod
    def recognise(cls, model: RobotModel) -> Self | None:
        """What Gazebo's plugin in the model says, or else round wheels whose joints have telling names.

        That is one continuous joint with "left" in its name, and one with "right".
        """
        stated = stated_by_plugin(model)
        by_plugin = cls._of(stated) if stated else None
        return by_plugin if by_plugin and not any(by_plugin.problems(model)) else cls._by_names(model)

    @classmethod
    def _by_names(cls, model: RobotModel) -> Self | None:
        wheels = [joint.name for joint in model.joints if joint.type == "continuous" and radius(model, joint.name)]
        left, right = ([name for name in wheels if side in name.lower()] for side in ("left", "right"))
        return cls(left=tuple(left), right=tuple(right)) if len(left) == len(right) == len(wheels) / 2 == 1 else None

    def problems(self, model: RobotModel) -> SpecProblems:
        """Joints that the model has not, or that are none of wheels, and figures that it does not tell."""
        unknown = [
            ((side, index), trouble)
            for side in ("left", "right")
            for index, name in enumerate(getattr(self, side))
            if (trouble := _why_no_wheel(model, name)) is not None
        ]
        yield from unknown
        if unknown:
            return
        for key in ("radius", "separation"):
            if 0 < (getattr(self, key) or 0) < _LEAST_LENGTH:
                yield (key,), f"must be at least {_LEAST_LENGTH:g} m"
        if set(self.left) & set(self.right):
            yield ("right",), "a wheel cannot be on both sides"
        elif self.separation is None and self._separation(model) < _LEAST_LENGTH:
            yield (), "the left and right wheels are at the same place in the model; give 'separation'"
        if self.radius is None and wheel(model, self.left[0]).radius is None:
            yield (), f"the model does not tell the radius of the wheel at '{self.left[0]}'; give 'radius'"

    def open(self, model: RobotModel, rate: float) -> DiffDriveMotion:
        """See Drive.open."""
        return DiffDriveMotion(self, self._radius(model), self._separation(model), 1 / rate)

    def describe(self, model: RobotModel) -> str:
        """See Drive.describe."""
        figures = (
            f"diff drive: left {', '.join(self.left)}; right {', '.join(self.right)}; wheel radius "
            f"{self._radius(model):.4g} m, separation {self._separation(model):.4g} m, "
            f"acceleration {self.acceleration:.4g} m/s^2"
        )
        stated = stated_by_plugin(model)
        return "; ".join((figures, *(stated.remarks if stated and self == self._of(stated) else ())))

    @classmethod
    def _of(cls, stated: StatedWheels) -> Self:
        return cls(left=stated.left, right=stated.right, **stated.figures)

    def _radius(self, model: RobotModel) -> float:
        radius = self.radius or wheel(model, self.left[0]).radius
        assert radius is not None, "problems() reports a radius that nobody tells"
        return radius

    def _separation(self, model: RobotModel) -> float:
        if self.separation is not None:
            return self.separation
        left, right = ([wheel(model, name) for name in side] for side in (self.left, self.right))
        return abs(_mean(left, lambda w: w.position_xyz[1]) - _mean(right, lambda w: w.position_xyz[1]))


class DiffDriveMotion:
    """Rim speeds of both sides, ramping towards what the last twist asks for."""

    def __init__(self, drive: DiffDrive, radius: float, separation: float, time_step: float) -> None:
        self._drive = drive
        self._radius = radius
        self._half_separation = separation / 2
        self._change = drive.acceleration * time_step
        self._left = self._right = 0.0
        torque = drive.torque
        self._max_effort = {} if torque is None else dict.fromkeys((*drive.left, *drive.right), torque)

    @property
    def joints(self) -> frozenset[str]:
        """See DriveMotion.joints."""
        return frozenset((*self._drive.left, *self._drive.right))

    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        """See DriveMotion.targets."""
        turn = twist.angular_xyz[2] * self._half_separation
        left, right = twist.linear_xyz[0] - turn, twist.linear_xyz[0] + turn
        planned = []
        for _ in range(steps):
            before = (self._left, self._right)
            self._left, self._right = self._towards(left, self._left), self._towards(right, self._right)
            planned.append(self._joint_targets())
            if before == (self._left, self._right):
                break
        return planned

    def _towards(self, wanted: float, speed: float) -> float:
        return speed + max(-self._change, min(self._change, wanted - speed))

    def _joint_targets(self) -> JointTargets:
        left = dict.fromkeys(self._drive.left, self._left / self._radius)
        right = dict.fromkeys(self._drive.right, self._right / self._radius)
        return JointTargets(velocity=left | right, max_effort=self._max_effort)


# In m. Wheels of less would be asked to turn at speeds that are no numbers.
_LEAST_LENGTH: Final = 1e-6

# In rad, from one limit to the other: exporters write such as 1e9 for what turns for ever.
_FOR_EVER: Final = 1e5


def _why_no_wheel(model: RobotModel, name: str) -> str | None:
    """What to say of a joint that no wheel turns about: engines drive it through its limits, for a while."""
    if (trouble := model.why_not_driven(name)) is not None:
        return trouble
    joint = model.joints_by_name[name]
    if joint.type == "prismatic":
        return f"joint '{name}' slides: a wheel turns about a joint that is 'continuous'"
    if joint.lower is None or joint.upper is None or not 0 <= joint.upper - joint.lower < _FOR_EVER:
        return None
    limits = f"{units.display(joint.lower, 'rad')} to {units.display(joint.upper, 'rad')}"
    return f"joint '{name}' has limits, {limits}: a wheel turns for ever, about a joint that is 'continuous'"


def _mean(wheels: Sequence[Wheel], value: Callable[[Wheel], float]) -> float:
    return sum(map(value, wheels)) / len(wheels)

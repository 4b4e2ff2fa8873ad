"""Skid steer: four or six wheels that cannot be steered, so that some slip whenever it turns."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import fmean
from typing import Annotated, ClassVar, Final, Self

from pydantic import Field

from sim_action.core import units
from sim_action.core.field_types import NonNegativeKilogramSquareMetres, PositiveRatio
from sim_action.drives.diff import TwoSidedDrive
from sim_action.drives.plugins import SKID_PLUGINS, StatedSides
from sim_action.drives.wheels import ASKEW, Wheel, centre_of_mass, steering_joint, wheels_on_ground
from sim_action.robot.robot_model import RobotModel
from sim_action.world.scene import Scene

# Of the robot's mass: what a motor adds to it at the rim of its wheel, as small motors with many gears do.
# PyBullet splits the friction of a tyre between lengthwise and sideways by how easily the wheel gives way to each.
# One that spins as easily as its few grams let it slips lengthwise whatever holds it: husky turned half as far.
_AT_THE_RIM: Final = 0.5

Sides = tuple[tuple[str, ...], tuple[str, ...]]

# In m: a wheel nearer to the middle is on no side.
_AMID: Final = 1e-3

# Of an interval: down to the last bits.
_HALVINGS: Final = 60


class SkidSteer(TwoSidedDrive):
    """Two sides of several wheels each, as diff; when it turns, wheels slip, as if they were `slip` times as far apart.

    The factor that is worked out holds on level ground for friction that is the same in all directions. The inertia of
    the motors, which models seldom tell, is what keeps the wheels turning as they are told. Wheels are held to the
    velocity limits of their joints as those of diff are.
    """

    key: ClassVar[str] = "skid"
    title: ClassVar[str] = "skid steer"
    plugins: ClassVar[tuple[str, ...]] = SKID_PLUGINS

    slip: Annotated[
        PositiveRatio | None,
        Field(description="factor on the separation; left out: worked out from where the wheels and the mass are"),
    ] = None
    rotor_inertia: Annotated[
        NonNegativeKilogramSquareMetres | None,
        Field(description="of a wheel's motor, felt through its gears; left out: as half the robot's mass at the rim"),
    ] = None

    @classmethod
    def recognise(cls, model: RobotModel) -> Self | None:
        """What Gazebo's plugin in the model says, or else several wheels on both sides, all of which roll forward."""
        if (stated := cls.by_plugin(model)) is not None:
            return stated
        left, right = sides_on_ground(model) or ((), ())
        return cls(left=left, right=right) if len(left) == len(right) > 1 else None

    @classmethod
    def as_stated(cls, model: RobotModel, stated: StatedSides) -> Self:
        """See TwoSidedDrive.as_stated; a separation that a plugin says is taken as it is there: in effect."""
        drive = super().as_stated(model, stated)
        return drive.model_copy(update={"slip": 1.0}) if "separation" in stated.figures else drive

    def slip_factor(self, model: RobotModel) -> float:
        """See TwoSidedDrive.slip_factor."""
        if self.slip is not None:
            return self.slip
        heading = self.forward(model)
        x, y, _ = centre_of_mass(model)
        aheads = [placed.ahead for side in self.sides(model) for placed in side]
        return slip_factor(footings(aheads, math.cos(heading) * x + math.sin(heading) * y), self.separation_in(model))

    def slip_text(self, model: RobotModel) -> str:
        """See TwoSidedDrive.slip_text."""
        worked_out = "" if self.slip else " (worked out from where the wheels and the mass are)"
        return f" x slip {self.slip_factor(model):.4g}{worked_out}, rotors {self._rotor_text(model)}"

    def prepared(self, scene: Scene) -> Scene:
        """With the inertia of the motors. See Drive.prepared."""
        return replace(super().prepared(scene), rotors=self.rotors(scene.model))

    def rotors(self, model: RobotModel) -> dict[str, float]:
        """Joint -> inertia of its motor in kg m^2."""
        stated, radii = self.rotor_inertia, self.radii(model)
        if stated is not None:
            return dict.fromkeys(radii, stated)
        return {joint: _AT_THE_RIM * model.mass * radius**2 for joint, radius in radii.items()}

    def _rotor_text(self, model: RobotModel) -> str:
        told = dict.fromkeys(units.display(inertia, "kg m^2") for inertia in self.rotors(model).values())
        return f"{', '.join(told)}{' (assumed)' if self.rotor_inertia is None else ''}"


def sides_on_ground(model: RobotModel) -> Sides | None:
    """Joints on the left, and on the right; None unless all roll the same way, on a side, and none is steered."""
    wheels = wheels_on_ground(model)
    if not wheels or any(steering_joint(model, found.joint) for found in wheels):
        return None
    by_place, by_name = _by_place(wheels), _by_name(wheels)
    # What rolls along x has its left where y is; of what rolls another way, only names tell what is its front.
    if by_place is None:
        return by_name if _parallel(wheels) else None
    return by_place if by_name in (None, by_place) else None


def _by_place(wheels: Sequence[Wheel]) -> Sides | None:
    if any(abs(found.axis_xyz[1]) < 1 - ASKEW or abs(found.position_xyz[1]) < _AMID for found in wheels):
        return None
    return _split(wheels, [found.position_xyz[1] > 0 for found in wheels])


def _by_name(wheels: Sequence[Wheel]) -> Sides | None:
    names = [found.joint.lower() for found in wheels]
    if any(("left" in name) == ("right" in name) for name in names):
        return None
    return _split(wheels, ["left" in name for name in names])


def _split(wheels: Sequence[Wheel], is_left: Sequence[bool]) -> Sides | None:
    left, right = (
        tuple(found.joint for found, here in zip(wheels, is_left, strict=True) if here is side)
        for side in (True, False)
    )
    return (left, right) if left and right else None


def _parallel(wheels: Sequence[Wheel]) -> bool:
    ax, ay, _ = wheels[0].axis_xyz
    return all(abs(ax * found.axis_xyz[0] + ay * found.axis_xyz[1]) > 1 - ASKEW for found in wheels)


@dataclass(frozen=True, slots=True)
class Footing:
    """Where a wheel stands, in m ahead of the middle of all wheels, and its share of the load."""

    ahead: float
    load: float


def footings(aheads: Sequence[float], mass_ahead: float) -> list[Footing]:
    """The wheels of both sides of a robot whose mass is in the mean at `mass_ahead`, in m as `aheads`.

    Loads change evenly from front to rear, as they do on two axles.
    """
    middle = fmean(aheads)
    spread = sum((ahead - middle) ** 2 for ahead in aheads)
    lean = (mass_ahead - middle) / spread if spread else 0.0
    loads = [max(0.0, 1 / len(aheads) + lean * (ahead - middle)) for ahead in aheads]
    return [Footing(ahead - middle, load) for ahead, load in zip(aheads, loads, strict=True)]


def slip_factor(wheels: Sequence[Footing], separation: float) -> float:
    """By how much further apart the wheels of a turning robot seem to be: wanted rim speed over turning rate.

    A robot that turns drags its front and rear wheels sideways. Friction that is the same in all directions (Coulomb's)
    then also lets rims slip lengthwise, until its forces and moments cancel. Four wheels that carry the same load do
    so at 1 + (wheelbase / separation)^2, whatever the coefficient and the speed.
    """
    half = separation / 2
    furthest = max(abs(wheel.ahead) for wheel in wheels)

    def moment(slip: float) -> float:
        shift = _root(lambda shift: sum(_sideways(wheel, slip, shift) for wheel in wheels), -furthest, furthest)
        return sum(_moment(wheel, half, slip, shift) for wheel in wheels)

    return 1 + _root(moment, 0.0, 2 * furthest**2 / half) / half


def _sideways(wheel: Footing, slip: float, shift: float) -> float:
    """A wheel's friction to the side, for a robot that turns at 1 rad/s about a point `shift` m behind the middle."""
    return wheel.load * _over(wheel.ahead + shift, math.hypot(slip, wheel.ahead + shift))


def _moment(wheel: Footing, half: float, slip: float, shift: float) -> float:
    """The moment of its friction about the middle; `slip`: m/s of its rim, lengthwise."""
    arm = half * slip - wheel.ahead * (wheel.ahead + shift)
    return wheel.load * _over(arm, math.hypot(slip, wheel.ahead + shift))


def _over(part: float, whole: float) -> float:
    return part / whole if whole else 0.0


def _root(rising: Callable[[float], float], low: float, high: float) -> float:
    """Where a function that rises passes through zero."""
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if rising(middle) < 0 else (low, middle)
    return high

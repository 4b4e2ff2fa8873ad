"""Skid steer: four or six wheels that cannot be steered, so that some slip whenever it turns."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, ClassVar, Final, Self

from pydantic import Field

from sim_action.core import units
from sim_action.core.field_types import NonNegativeKilogramSquareMetres, PositiveRatio
from sim_action.drives.plugins import SKID_PLUGINS, StatedSides
from sim_action.drives.sided import SidedDrive
from sim_action.drives.sides import sides_on_ground
from sim_action.drives.slip import footings, slip_factor
from sim_action.drives.wheels import centre_of_mass
from sim_action.robot.robot_model import RobotModel
from sim_action.world.scene import Scene

# Of the robot's mass: what a motor adds to it at the rim of its wheel, as small motors with many gears do.
# PyBullet splits the friction of a tyre between lengthwise and sideways by how easily the wheel gives way to each.
# One that spins as easily as its few grams let it slips lengthwise whatever holds it: husky turned half as far.
_AT_THE_RIM: Final = 0.5


class SkidSteer(SidedDrive):
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
        """See SidedDrive.as_stated; a separation that a plugin says is taken as it is there: in effect."""
        drive = super().as_stated(model, stated)
        return drive.model_copy(update={"slip": 1.0}) if "separation" in stated.figures else drive

    def slip_factor(self, model: RobotModel) -> float:
        """See SidedDrive.slip_factor."""
        if self.slip is not None:
            return self.slip
        heading = self.forward(model)
        x, y, _ = centre_of_mass(model)
        aheads = [placed.ahead for side in self.sides(model) for placed in side]
        return slip_factor(footings(aheads, math.cos(heading) * x + math.sin(heading) * y), self.separation_in(model))

    def slip_text(self, model: RobotModel) -> str:
        """See SidedDrive.slip_text."""
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

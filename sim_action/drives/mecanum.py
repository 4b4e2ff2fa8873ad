"""Mecanum wheels: four, whose rollers let the robot go sideways as well."""

from __future__ import annotations

import math
from dataclasses import replace
from statistics import fmean
from typing import Annotated, ClassVar, Final, Self

from pydantic import Field

from sim_action.core import units
from sim_action.core.field_types import PositiveMetresPerSecondSquared, PositiveNewtons
from sim_action.core.geometry import Vector3
from sim_action.core.yaml_errors import SpecProblems
from sim_action.drives import Drive
from sim_action.drives.heading import Rolling, axle_problems, heading_of, rolling
from sim_action.drives.keys import Heading, WheelRadius
from sim_action.drives.mecanum_motion import MecanumMotion, Roller, arm
from sim_action.drives.mecanum_ways import MecanumWays
from sim_action.drives.plugins import StatedSides, corners_by_plugin
from sim_action.drives.wheel_problems import joint_problems, length_problems
from sim_action.drives.wheel_speeds import WheelSpeeds
from sim_action.drives.wheels import Wheel, centre_of_mass, wheel
from sim_action.drives.wording import heading_text, radius_text, remarked
from sim_action.robot.kinematics import Mobility
from sim_action.robot.robot_model import RobotModel
from sim_action.world import GRAVITY
from sim_action.world.scene import Scene

# Of the weight that is on them, what rollers at 45 deg hold with a friction of 1.
_HOLD: Final = 1 / math.sqrt(2)

# Front left, rear left, front right, rear right.
_CORNERS: Final = [(1, 1), (-1, 1), (1, -1), (-1, -1)]

Pair = Annotated[tuple[str, ...], Field(min_length=2, max_length=2)]


class MecanumDrive(Drive):
    """Four mecanum wheels, front and rear: forward, sideways and turning at once; kinematic, rollers are not modelled.

    Wheels turn as their inverse kinematics says, and have no friction; the base is pushed to its velocity by a force
    that is limited, and acts where the wheels touch the ground. A script that turns the wheels by hand takes them over:
    the base is pushed no more. Beyond the velocity limit of a wheel's joint in the model, all three are slowed alike,
    and the outcome has a note.
    """

    key: ClassVar[str] = "mecanum"

    left: Annotated[Pair, Field(description="joints of the wheels on the left: front, rear")]
    right: Annotated[Pair, Field(description="joints of the wheels on the right: front, rear")]
    radius: WheelRadius = None
    acceleration: Annotated[
        PositiveMetresPerSecondSquared, Field(description="limit of the velocity's change, also where wheels are")
    ] = 1.0
    force: Annotated[
        PositiveNewtons | None,
        Field(
            description="that pushes the base at the most; left out: what rollers hold, 0.7 of its weight in this world"
        ),
    ] = None
    heading: Heading = None

    @classmethod
    def recognise(cls, model: RobotModel) -> Self | None:
        """What gz's plugin in the model says: without it, the wheels look like those of skid steer."""
        stated = corners_by_plugin(model)
        return cls._of(stated) if stated else None

    @classmethod
    def _of(cls, stated: StatedSides) -> Self:
        return cls(left=stated.left, right=stated.right, **stated.figures)

    def problems(self, model: RobotModel) -> SpecProblems:
        """Joints that the model has not, wheels that do not roll or are not where they should be."""
        unknown = [*joint_problems(model, "left", self.left), *joint_problems(model, "right", self.right)]
        yield from unknown
        if unknown:
            return
        yield from length_problems(self, "radius")
        if model.mjcf:
            yield (), "wheels of MJCF keep the friction of their geoms, and mecanum wheels slide; use a model in URDF"
        heading = self._forward(model)
        for found in self._wheels(model):
            yield from axle_problems(found, heading)
            if self.radius is None and found.radius is None:
                yield (), f"the model does not tell the radius of the wheel at '{found.joint}'; give 'radius'"
        if self._corners(model) != _CORNERS:
            yield (), "the wheels are not at the corners: left: [front, rear], right: [front, rear]; or give 'heading'"

    def open(self, model: RobotModel, rate: float, gravity: float = GRAVITY) -> MecanumMotion:
        """See Drive.open."""
        x, y, _ = centre_of_mass(model)
        lowest = min(found.position_xyz[2] - radius for found, radius in self._tyres(model))
        point: Vector3 = (x, y, lowest)
        return MecanumMotion(
            self._rollers(model),
            heading=self._forward(model),
            most_change=self.acceleration / rate,
            speeds=WheelSpeeds(model, (*self.left, *self.right)),
            force=self._force(model, gravity),
            point_xyz=point,
        )

    def wheel_motion(self, model: RobotModel) -> MecanumWays:
        """See Drive.wheel_motion."""
        return MecanumWays(self._rollers(model), self._forward(model))

    def describe(self, model: RobotModel, gravity: float = GRAVITY) -> str:
        """See Drive.describe."""
        front_left, rear_left, front_right, _ = self._placed(model)
        wheelbase, separation = front_left.ahead - rear_left.ahead, front_left.left - front_right.left
        assumed = "" if self.force else " (0.7 of its weight)"
        figures = (
            f"mecanum drive, kinematic: left {', '.join(self.left)}; right {', '.join(self.right)}; "
            f"{radius_text([radius for _, radius in self._tyres(model)])}, wheelbase {wheelbase:.4g} m, "
            f"separation {separation:.4g} m, acceleration {self.acceleration:.4g} m/s^2, wheels without friction, "
            f"pushed by up to {units.display(self._force(model, gravity), 'N')}{assumed}"
            f"{heading_text(self._forward(model))}"
        )
        stated = corners_by_plugin(model)
        return remarked(figures, stated.remarks if stated and self == self._of(stated) else ())

    def mobility(self, model: RobotModel) -> Mobility:
        """See Drive.mobility."""
        return Mobility(
            heading=self._forward(model),
            acceleration=self.acceleration,
            turn_acceleration=self.acceleration / arm(self._placed(model)),
        )

    def prepared(self, scene: Scene) -> Scene:
        """With wheels that slide: their rollers roll. See Drive.prepared."""
        joints = scene.model.joints_by_name
        wheels = {joints[name].child for name in (*self.left, *self.right)}
        links = tuple(
            replace(link, surface=replace(link.surface, friction=0.0)) if link.name in wheels else link
            for link in scene.model.links
        )
        return replace(super().prepared(scene), model=replace(scene.model, links=links))

    def _wheels(self, model: RobotModel) -> list[Wheel]:
        return [wheel(model, name) for name in (*self.left, *self.right)]

    def _tyres(self, model: RobotModel) -> list[tuple[Wheel, float]]:
        return [(found, radius) for found in self._wheels(model) if (radius := self.radius or found.radius)]

    def _rollers(self, model: RobotModel) -> tuple[Roller, ...]:
        heading = self._forward(model)
        placed = [(rolling(found, heading), radius) for found, radius in self._tyres(model)]
        ways = [ahead * left for ahead, left in _CORNERS]
        return tuple(Roller(at, at.turns * radius, way) for (at, radius), way in zip(placed, ways, strict=True))

    def _forward(self, model: RobotModel) -> float:
        if self.heading is not None:
            return self.heading
        wheels = self._wheels(model)
        return heading_of(wheels, wheels[:2], wheels[2:])

    def _placed(self, model: RobotModel) -> list[Rolling]:
        heading = self._forward(model)
        return [rolling(found, heading) for found in self._wheels(model)]

    def _corners(self, model: RobotModel) -> list[tuple[int, int]]:
        """Where each wheel is, seen from the middle of them all: in front or not, on the left or not."""
        placed = self._placed(model)
        ahead, left = fmean(each.ahead for each in placed), fmean(each.left for each in placed)
        return [(1 if each.ahead > ahead else -1, 1 if each.left > left else -1) for each in placed]

    def _force(self, model: RobotModel, gravity: float) -> float:
        return self.force or _HOLD * model.mass * gravity

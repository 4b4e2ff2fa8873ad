"""What is simulated: the robot, the ground, the objects, the physics rate. No engine in sight.

The fields are the keys of a scenario file; the docstrings and descriptions are what `sim-action schema` prints.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from sim_action import geometry
from sim_action.quantities import (
    FrozenModel,
    JointPosition,
    Metres,
    MetresPerSecond,
    Name,
    NonNegativeRatio,
    NonNegativeSeconds,
    PositiveHertz,
    PositiveKilograms,
    PositiveMetres,
    Radians,
    RadiansPerSecond,
)

GROUND = "ground"

GRAVITY: Final = 9.80665
"""m/s^2, standard gravity (CGPM 1901)."""

FASTEST: Final = 10_000.0
"""m/s and rad/s at which engines are told to stop the base and every joint: bounds of speed go no further."""


class Placement(FrozenModel):
    """Where something begins, in the world frame."""

    x: Metres = 0.0
    y: Metres = 0.0
    z: Annotated[Metres | None, Field(description="left out: it stands on the ground")] = None
    roll: Radians = 0.0
    pitch: Radians = 0.0
    yaw: Radians = 0.0

    @property
    def orientation_xyzw(self) -> geometry.Quaternion:
        """The rotation by roll, pitch and yaw."""
        return geometry.quaternion_from_rpy(self.roll, self.pitch, self.yaw)


class Robot(FrozenModel):
    """The robot under test."""

    model: Annotated[
        str,
        Field(min_length=1, description="the name of a built-in model, or the path of a URDF, xacro, SDF or MJCF file"),
    ]
    base: Annotated[
        Literal["free", "fixed"] | None,
        Field(description="fixed: bolted to the world; left out: free, but for a model whose root link is `world`"),
    ] = None
    pose: Annotated[Placement, Field(description="of the base link")] = Placement()
    args: Annotated[dict[str, str | bool | int | float], Field(description="arguments of a xacro file, by name")] = (
        Field(default_factory=dict)
    )
    packages: Annotated[dict[str, str], Field(description="folders of ROS packages, by name")] = Field(
        default_factory=dict
    )
    allow: Annotated[tuple[str, ...], Field(description="rules of the model's audit that need not hold")] = ()
    joints: Annotated[
        dict[str, JointPosition],
        Field(description="where joints begin, by name; left out: at 0, or amid limits that 0 is beyond"),
    ] = Field(default_factory=dict)

    @property
    def is_xacro(self) -> bool:
        """Whether its model has to be evaluated, which runs what is written in it."""
        return self.model.endswith(".xacro")

    @property
    def is_mjcf(self) -> bool:
        """Whether its model is in the format of MuJoCo, which alone reads and simulates it."""
        return self.model.endswith(".xml")


class Ground(FrozenModel):
    """The plane z = 0."""

    friction: Annotated[NonNegativeRatio, Field(description="multiplies with the friction of what touches it")] = 1.0


class Cylinder(FrozenModel):
    """An upright cylinder."""

    radius: PositiveMetres
    height: PositiveMetres


class Sphere(FrozenModel):
    """A ball."""

    radius: PositiveMetres


Share = Annotated[float, Field(ge=0, le=1)]


class Body(FrozenModel):
    """A box, a cylinder or a sphere."""

    name: Name
    box: Annotated[tuple[PositiveMetres, PositiveMetres, PositiveMetres] | None, Field(description="full x, y, z")] = (
        None
    )
    cylinder: Annotated[Cylinder | None, Field(description="upright, about its own z axis")] = None
    sphere: Sphere | None = None
    pose: Annotated[Placement, Field(description="of the centre")] = Placement()
    mass: Annotated[PositiveKilograms | None, Field(description="left out: it is fixed")] = None
    friction: NonNegativeRatio = 0.5
    color: Annotated[
        tuple[Share, Share, Share] | None,
        Field(description="red, green, blue, each 0 to 1, for cameras; left out: one of a row that has no red in it"),
    ] = None

    @model_validator(mode="after")
    def _has_one_shape(self) -> Self:
        if sum(shape is not None for shape in (self.box, self.cylinder, self.sphere)) != 1:
            raise ValueError("an object has exactly one of 'box', 'cylinder' and 'sphere'")
        return self


class World(FrozenModel):
    """What surrounds the robot."""

    ground: Ground = Ground()
    objects: tuple[Body, ...] = ()


class Physics(FrozenModel):
    """How the engine steps."""

    rate: Annotated[PositiveHertz, Field(ge=1, le=100_000, description="steps in a second of sim time")] = 240.0
    settle: Annotated[
        NonNegativeSeconds, Field(le=60, description="longest time to come to rest before t = 0; 0: do not wait")
    ] = 2.0
    max_speed: Annotated[
        MetresPerSecond,
        Field(gt=0, le=FASTEST, description="of the base and of joints that slide; from there on, it is unstable"),
    ] = 100.0
    max_turn_rate: Annotated[
        RadiansPerSecond,
        Field(gt=0, le=FASTEST, description="of the base and of joints that turn; from there on, it is unstable"),
    ] = 1000.0
    max_distance: Annotated[
        PositiveMetres, Field(description="of the base from where it began; from there on, it is unstable")
    ] = 10_000.0
    max_depth: Annotated[
        PositiveMetres | None,
        Field(description="of the base below the ground; left out: as far as its shapes are from it, and 1 m"),
    ] = None

"""The world of a scenario: gravity, ground, objects, disturbances and physics, independent of engines.

The fields are the keys of a scenario file; `sim-action schema` prints the docstrings and descriptions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from sim_action.core.field_types import FrozenModel, Name
from sim_action.core.geometry import Vector3
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.timeline import TimeMark
from sim_action.world.body import Body, Inertia, PathPoint, Shape, path_of, placed
from sim_action.world.physics import (
    GRAVITY,
    GROUND,
    MAX_PHYSICS_RATE_HZ,
    MAX_SPEED,
    Disturbance,
    Gravity,
    Ground,
    Patch,
    Physics,
)
from sim_action.world.shapes import Cylinder, File, Heightfield, MeshFile, OccupancyMap, Ramp, Sphere, Stairs

__all__ = [
    "GRAVITY",
    "GROUND",
    "MAX_ACTORS",
    "MAX_PHYSICS_RATE_HZ",
    "MAX_SPEED",
    "Actor",
    "Body",
    "Cylinder",
    "Disturbance",
    "Ground",
    "Heightfield",
    "Inertia",
    "MeshFile",
    "OccupancyMap",
    "Patch",
    "PathPoint",
    "Physics",
    "Ramp",
    "Shape",
    "Sphere",
    "Stairs",
    "World",
    "path_of",
    "placed",
]

MAX_PATCHES: Final = 50
MAX_ACTORS: Final = 20  # the largest number of robots that are not under test


class Actor(Robot):
    """An additional robot, not under test, which expectations can name like an object."""

    name: Annotated[
        Name, Field(pattern="^[^/]*$", description="name in expectations and reports; its links are NAME/LINK")
    ]


class World(FrozenModel):
    """The surroundings of the robot."""

    file: Annotated[
        File | None, Field(description="a world file of Gazebo (SDF): its models become bodies; 'objects' adds others")
    ] = None
    robot: Annotated[
        str | None, Field(min_length=1, description="name of the model in 'file' that is the robot, if one of them is")
    ] = None
    gravity: Gravity = GRAVITY
    ground: Ground = Ground.model_construct()
    patches: Annotated[
        tuple[Patch, ...], Field(max_length=MAX_PATCHES, description="areas of the ground with their own friction")
    ] = ()
    objects: tuple[Body, ...] = ()
    actors: Annotated[
        tuple[Actor, ...],
        Field(max_length=MAX_ACTORS, description="robots beside the one under test, with their commands"),
    ] = ()
    disturbances: Annotated[
        tuple[Disturbance, ...], Field(description="forces, torques and pushes on the robot or on bodies")
    ] = ()

    @model_validator(mode="after")
    def _has_file_of_robot(self) -> Self:
        if self.robot is not None and self.file is None:
            raise ValueError("'robot' names a model of a world file: add 'file', or name the model in robot.model")
        return self

    def time_marks(self) -> Iterator[TimeMark]:
        """Yield the marks of the timeline that the run cannot change."""
        for body in self.objects:
            yield from body.time_marks()
        yield from (disturbance.time_mark for disturbance in self.disturbances)
        for patch in self.patches:
            if patch.appears is not None:
                yield TimeMark(patch.appears, patch.appears, f"{patch.words} appeared")

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the objects and of the other robots."""
        return (*(body.name for body in self.objects), *(actor.name for actor in self.actors))

    @property
    def gravity_xyz(self) -> Vector3:
        """The gravity vector in m/s^2, world frame."""
        return self.gravity if isinstance(self.gravity, tuple) else (0.0, 0.0, -self.gravity)

    @property
    def weight(self) -> float:
        """The weight of 1 kg in N."""
        return math.hypot(*self.gravity_xyz)

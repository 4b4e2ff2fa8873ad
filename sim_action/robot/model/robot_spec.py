"""The `robot` section of a scenario: the model, its base, and its initial pose and joint positions."""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from sim_action.core.field_types import FrozenModel, JointPosition, NamesFile, Placement
from sim_action.robot.built_in import BUILT_IN, STANDARD_SENSORS

IN_WORLD: Final = "#"
"""Between a world file and the name of a model in it."""


class Robot(FrozenModel):
    """The robot under test."""

    model: Annotated[
        str,
        NamesFile(),
        Field(
            min_length=1,
            description="name of a built-in model, or path of a URDF, xacro, SDF or MJCF file",
            examples=list(BUILT_IN),
        ),
    ]
    base: Annotated[
        Literal["free", "fixed"] | None,
        Field(
            description="`fixed` to the world, or `free`; default: free, unless the root link of the model is `world`"
        ),
    ] = None
    pose: Annotated[Placement, Field(description="initial pose of the base link")] = Placement.model_construct()
    args: Annotated[dict[str, str | bool | int | float], Field(description="arguments for a xacro file, by name")] = (
        Field(default_factory=dict)
    )
    packages: Annotated[dict[str, str], NamesFile(), Field(description="folders of ROS packages, by name")] = Field(
        default_factory=dict
    )
    allow: Annotated[tuple[str, ...], Field(description="rules of the model audit whose errors are accepted")] = ()
    joints: Annotated[
        dict[str, JointPosition],
        Field(
            description="initial positions of joints, by name, by pattern such as `'*_hip'`, or by group of the SRDF; "
            "the name of a joint wins; default: 0, or the middle of limits that exclude 0"
        ),
    ] = Field(default_factory=dict)

    keyframe: Annotated[
        Annotated[str, Field(min_length=1)] | Annotated[int, Field(ge=0)] | None,
        Field(
            description="keyframe of an MJCF file, where the robot begins: its name, or its number from 0 on; "
            "`joints` override it"
        ),
    ] = None

    srdf: Annotated[
        str | None,
        NamesFile(),
        Field(
            min_length=1,
            description="path or package:// address of the SRDF of the model: its groups name joints wherever patterns "
            "do, and links in its <disable_collisions> never touch each other",
        ),
    ] = None
    self_collision: Annotated[
        bool,
        Field(
            description="true: the links of the robot collide with each other, except neighbours, pairs that the SRDF "
            "or MJCF excludes, and pairs that touch at the model's own position; false: they pass through each other"
        ),
    ] = False
    sensors: Annotated[
        Literal["standard"] | None,
        Field(
            description="`standard`: the robot has the sensors that it is sold with, besides those in `sensors` of the "
            f"scenario; of {', '.join(STANDARD_SENSORS)}"
        ),
    ] = None

    @model_validator(mode="after")
    def _has_standard_sensors(self) -> Self:
        if self.sensors is not None and self.model not in STANDARD_SENSORS:
            models = ", ".join(STANDARD_SENSORS)
            raise ValueError(f"sensors: standard ones are known of {models}; remove 'sensors', and list them below it")
        return self

    @model_validator(mode="after")
    def _keyframe_is_read(self) -> Self:
        if self.keyframe is not None and not self.is_mjcf:
            problem = f"only MJCF files have keyframes, and the model is '{self.model}'"
            raise ValueError(f"keyframe: {problem}; remove 'keyframe', and state the positions in 'joints'")
        return self

    @model_validator(mode="after")
    def _args_are_read(self) -> Self:
        if self.args and not self.is_xacro:
            raise ValueError(f"args: only a .xacro file has arguments, and the model is '{self.model}'; remove 'args'")
        return self

    @property
    def file(self) -> str:
        """The model without the name of a model in a world file: `office.world` of `office.world#burger`."""
        file, separator, _ = self.model.rpartition(IN_WORLD)
        return file if separator else self.model

    @property
    def name_in_world(self) -> str:
        """The name of the model in a world file; empty for other files."""
        return self.model.rpartition(IN_WORLD)[2] if IN_WORLD in self.model else ""

    @property
    def is_xacro(self) -> bool:
        """Return True if the model is a xacro file, whose evaluation runs the expressions in it."""
        return self.model.endswith(".xacro")

    @property
    def is_mjcf(self) -> bool:
        """Return True if the model is an MJCF file, which only MuJoCo reads and simulates."""
        return self.model.endswith(".xml")

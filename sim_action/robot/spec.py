"""The robot under test: its model and how it begins."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from sim_action.core.field_types import FrozenModel, JointPosition, NamesFile, Placement


class Robot(FrozenModel):
    """The robot under test."""

    model: Annotated[
        str,
        NamesFile(),
        Field(min_length=1, description="the name of a built-in model, or the path of a URDF, xacro, SDF or MJCF file"),
    ]
    base: Annotated[
        Literal["free", "fixed"] | None,
        Field(description="fixed: bolted to the world; left out: free, but for a model whose root link is `world`"),
    ] = None
    pose: Annotated[Placement, Field(description="of the base link")] = Placement.model_construct()
    args: Annotated[dict[str, str | bool | int | float], Field(description="arguments of a xacro file, by name")] = (
        Field(default_factory=dict)
    )
    packages: Annotated[dict[str, str], NamesFile(), Field(description="folders of ROS packages, by name")] = Field(
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

"""A force and a torque on a link: `wrench: {link: rotor, force: [0, 0, 12 N], frame: rotor}`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, ClassVar, Final, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.commands import Controller, LinkCommands, OpenLoop
from sim_action.commands.twist import missed_by_ticks
from sim_action.core.field_types import Coordinate, FrozenModel, Name, NonNegativeSeconds, PositiveSeconds
from sim_action.core.units import first_step
from sim_action.core.yaml_document import KeyPath, SpecProblems
from sim_action.robot.model.kinematics import why_no_frame
from sim_action.state.command import WORLD_FRAME, LinkWrench
from sim_action.state.timeline import TimeMark
from sim_action.world.claims import ClaimFinding, Findings, Setting
from sim_action.world.physics import NewtonMetres, Newtons
from sim_action.world.scene import Scene

_NONE: Final = (0.0, 0.0, 0.0)


class TimedWrench(FrozenModel):
    """A force and a torque on a link for a time."""

    link: Annotated[Name | None, Field(description="link of the robot; default: its base link")] = None
    force: Annotated[
        tuple[Newtons, Newtons, Newtons] | None, Field(description="x, y, z along the axes of `frame`")
    ] = None
    torque: Annotated[
        tuple[NewtonMetres, NewtonMetres, NewtonMetres] | None, Field(description="x, y, z about the axes of `frame`")
    ] = None
    frame: Annotated[
        Name, Field(description="`world`, `base`, or a link of the robot, with whose axes the wrench turns")
    ] = WORLD_FRAME
    point: Annotated[
        tuple[Coordinate, Coordinate, Coordinate] | None,
        Field(description="where the force acts, in the frame of `link`; default: the origin of that frame"),
    ] = None
    at: Annotated[NonNegativeSeconds, Field(description="sim time at which it begins")] = 0.0
    duration: Annotated[
        PositiveSeconds | None, Field(alias="for", description="duration; default: until the end of the run")
    ] = None

    @property
    def end(self) -> float:
        """The end in s of sim time."""
        return math.inf if self.duration is None else self.at + self.duration

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.force is None and self.torque is None:
            raise ValueError("a wrench needs a 'force', a 'torque' or both")
        if self.point is not None and self.force is None:
            raise ValueError("'point' needs a 'force'")
        return self


class WrenchCommands(LinkCommands):
    """Applies a force and a torque to a link, as a propeller, a thruster or a cable does.

    The wrench acts at every physics step, from the first tick at or after `at` to the first tick at or after its end,
    but not while the robot settles. In the frame of a link it turns with the link. The force acts at the origin of the
    link's frame, or at `point`; a force off the centre of mass also turns the robot. Wrenches add up.

    A push from outside belongs into `world.disturbances`: it can also act on bodies of the world.
    """

    key: ClassVar[str] = "wrench"
    is_written: ClassVar[bool] = True

    wrench: Annotated[TimedWrench, Field(description="the force, the torque, and when they act")]

    @property
    @override
    def begins(self) -> tuple[KeyPath, float]:
        return ("wrench", "at"), self.wrench.at

    @override
    def time_marks(self, sender: str) -> Iterator[TimeMark]:
        yield from super().time_marks(sender)
        end, link = self.wrench.end, self.wrench.link or "the base link"
        yield TimeMark(
            self.wrench.at, None if end == math.inf else end, f"commanded a wrench on {link}", is_planned=True
        )

    @override
    def claims(self, setting: Setting) -> Findings:
        if not any((*(self.wrench.force or ()), *(self.wrench.torque or ()))):
            message = "the force and the torque are zero, so the wrench does nothing; change them, or remove it"
            yield ClaimFinding("silent-controller", ("wrench",), message)

    def model_problems(self, scene: Scene) -> SpecProblems:
        """Yield an unknown link or frame, a link that nothing moves, and a duration without a tick."""
        spec = self.wrench
        if spec.duration is not None and (problem := missed_by_ticks(spec.at, spec.duration, self.rate)):
            yield ("wrench", "for"), problem
        link = self.wrench.link or scene.model.root
        where = ("wrench", "link") if self.wrench.link else ("wrench",)
        if (problem := scene.why_not_moved(link)) is not None:
            yield where, problem
        if (problem := why_no_frame(scene.model, self.wrench.frame)) is not None:
            yield ("wrench", "frame"), problem

    @override
    def open(self, scene: Scene) -> Controller:
        spec, rate = self.wrench, self.rate
        link = spec.link or scene.model.root
        acting = LinkWrench(link, spec.force or _NONE, spec.torque or _NONE, spec.frame, spec.point or _NONE)
        answers = {first_step(spec.at, rate): acting}
        if spec.duration is not None:
            answers[first_step(spec.end, rate)] = LinkWrench(link)
        return OpenLoop(lambda time: answers.get(round(time * rate)))

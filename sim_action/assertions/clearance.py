"""`clearance: {at_least: 20 cm, to: [wall]}`: how near the robot comes to what surrounds it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion, Monitor
from sim_action.assertions.bounds import bounds_title, check_bounds
from sim_action.core.field_types import PositiveMetres
from sim_action.core.messages import FirstFew, did_you_mean
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.robot_model import RobotModel
from sim_action.state.trace_channels import Channels, ClearanceWatch
from sim_action.world import GROUND
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation


class Clearance(Assertion):
    """The least distance between the robot and bodies of the world is not below a bound, or comes down to one.

    It is the distance between collision shapes, in space, at every physics step; inside of each other it is
    negative. The ground counts only where `to` names it. Of two engines, PyBullet rounds the edges of boxes by
    1 mm, and tells distances from them that are up to 0.7 mm greater.
    """

    key: ClassVar[str] = "clearance"

    at_least: Annotated[PositiveMetres | None, Field(description="an invariant: nothing may come nearer than this")] = (
        None
    )
    at_most: Annotated[PositiveMetres | None, Field(description="a goal: something must come as near as this")] = None
    to: Annotated[
        tuple[str, ...] | None, Field(min_length=1, description="names of bodies; left out: all but the ground")
    ] = None
    links: Annotated[tuple[str, ...] | None, Field(min_length=1, description="of the robot; left out: all")] = None

    @model_validator(mode="after")
    def _has_a_bound(self) -> Self:
        check_bounds(self.at_least, self.at_most, "m")
        return self

    @property
    def title(self) -> str:
        """See Assertion.title."""
        whose = f" of {', '.join(self.links)}" if self.links else ""
        where = f" to {', '.join(self.to)}" if self.to else ""
        return f"clearance{whose}{where} {bounds_title(self.at_least, self.at_most, 'm')}"

    @property
    def watch(self) -> ClearanceWatch:
        """What it reads of a trace."""
        return ClearanceWatch(self.links, self.to)

    @property
    def channels(self) -> Channels:
        """See Assertion.channels."""
        return Channels(clearances=frozenset({self.watch}))

    def problems(self, scene: Scene) -> SpecProblems:
        """Names that are none of bodies, or of links, and nothing to be clear of."""
        bodies = [body.name for body in scene.world.objects]
        if self.to is None and not bodies:
            yield (), "the world has no objects to be clear of; put some below world.objects"
        hinted = FirstFew()
        for index, name in enumerate(self.to or ()):
            if name not in (*bodies, GROUND):
                hint = did_you_mean(name, (*bodies, GROUND)) if hinted.one_more() else ""
                yield ("to", index), f"the world has no body '{name}'{hint}"
        links = _links_with_shapes(scene.model)
        for index, name in enumerate(self.links or ()):
            if name not in links:
                hint = did_you_mean(name, links) if hinted.one_more() else ""
                yield ("links", index), f"the robot has no link '{name}' with a collision shape{hint}"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        from sim_action.assertions.clearance_monitor import ClearanceMonitor

        return ClearanceMonitor(self)


def _links_with_shapes(model: RobotModel) -> list[str]:
    # What is in MuJoCo's own format tells its shapes to the engine alone.
    return [link.name for link in model.links if link.collisions or model.mjcf]

"""`upright: {max_tilt: 20 deg}`: the robot does not tip over, or a link is not tilted."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field
from typing_extensions import override

from sim_action.assertions import Reference
from sim_action.assertions.monitors import Monitor
from sim_action.assertions.monitors.bounds import Bounds, SignalMonitor, bounds_formula
from sim_action.assertions.monitors.watched import MotionAssertion, Watched
from sim_action.core import units
from sim_action.core.field_types import PositiveRadians
from sim_action.state.observation import Observation
from sim_action.world.claims import Ceiling
from sim_action.world.scene import Scene


class Upright(MotionAssertion):
    """The angle between the z axes of `frame` and the base link, or `link`, never exceeds `max_tilt`."""

    key: ClassVar[str] = "upright"
    reference: ClassVar[Reference] = Reference(
        "motion",
        "invariant",
        "The tilt was at most `max_tilt` at every step.",
        "The tilt exceeded `max_tilt` at a step.",
    )
    measured_unit: ClassVar[str | None] = "rad"
    ceilings: ClassVar[tuple[Ceiling, ...]] = (Ceiling("max_tilt", "rad", "a tilt is at most 180 deg"),)

    max_tilt: Annotated[PositiveRadians, Field(description="an invariant: must not be exceeded")] = math.radians(20)

    has_truth: ClassVar[bool] = True

    @override
    def meaning(self, scene: Scene) -> str:
        return bounds_formula(self.quantity("tilt", "tilt"), None, self.max_tilt)

    @override
    def title_of(self, watched: Watched) -> str:
        return f"{self.key_of(watched)} within {units.display(self.max_tilt, 'rad')}"

    @override
    def opened_on(self, watched: Watched, scene: Scene, start: Observation) -> Monitor:
        return SignalMonitor("tilt", lambda trace: trace.tilt, Bounds("tilted by", "rad", None, self.max_tilt))

"""How much a robot wobbles: the assertion `wobble`, the command source `sway` and the sensor `inclinometer`."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field

from sim_action import Observation, Trace, Twist
from sim_action.extending import (
    RATIO,
    Assertion,
    Bounds,
    CommandSource,
    Controller,
    Measure,
    MetresPerSecond,
    Monitor,
    Mount,
    OpenLoop,
    PositiveRadians,
    PositiveSeconds,
    Radians,
    ReadingColumn,
    Scene,
    Sensor,
    Sight,
    SignalMonitor,
    Values,
    display,
)


class Wobble(Assertion):
    """The robot never leans further than `at_most` from its tilt at the start."""

    key: ClassVar[str] = "wobble"

    at_most: Annotated[PositiveRadians, Field(description="an invariant: must not be exceeded")] = math.radians(2)

    @property
    def has_truth(self) -> bool:
        """It is true or false at each moment, so that it can be a part of any_of and other assertions."""
        return True

    @property
    def title(self) -> str:
        """The requirement in reports."""
        return f"wobble at most {display(self.at_most, 'rad')}"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """Compare the lean at each physics step with the limit."""
        first = float(Trace.of_observation(start).tilt[0])
        return SignalMonitor(
            "wobble", lambda trace: abs(trace.tilt - first), Bounds("wobbled", "rad", None, self.at_most)
        )


class Sway(CommandSource):
    """Drives the robot to and fro, so that it would wobble."""

    key: ClassVar[str] = "sway"
    needs_drive: ClassVar[bool] = True

    sway: Annotated[MetresPerSecond, Field(description="greatest speed")]
    period: Annotated[PositiveSeconds, Field(description="duration of one sway")] = 2.0

    def open(self, scene: Scene) -> Controller:
        """Return the controller, which depends only on the time."""
        return OpenLoop(lambda time: Twist.planar(self.sway * math.sin(math.tau * time / self.period), 0.0))


class Inclinometer(Sensor):
    """Measures how far its link leans, as the cosine of the angle between its z axis and the vertical."""

    key: ClassVar[str] = "inclinometer"
    columns: ClassVar[dict[str, ReadingColumn]] = {"upright": ReadingColumn(RATIO)}

    noise: Annotated[Radians, Field(ge=0, description="standard deviation of the angle")] = 0.0

    def open(self, mount: Mount) -> Measure:
        """Return the function that measures."""

        def measure(sight: Sight) -> Values:
            x, y, _, _ = sight.probe.link_pose(mount.link).orientation_xyzw
            angle = math.acos(max(-1.0, 1 - 2 * (x * x + y * y)))
            return Values(sight.time, {"upright": math.cos(angle + self.noise * mount.random.standard_normal())})

        return measure

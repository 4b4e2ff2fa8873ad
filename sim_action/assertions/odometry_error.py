"""`odometry_error: {position: 5 cm, drift: 2 %}`: how far the robot is from where its wheels say that it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion, Monitor
from sim_action.core import units
from sim_action.core.field_types import PositiveMetres, PositiveRadians, PositiveShare
from sim_action.core.messages import did_you_mean
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.trace_channels import Channels
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation


class OdometryError(Assertion):
    """An invariant: the odometry sensor's pose is as near to where the base really is as is asked, on the ground.

    Each of its readings is held against the truth at the same moment; it is read for this, whether or not a
    controller listens. `drift` is the error in position as a share of the way that the robot has made since it began,
    of which the first metre counts as a whole one.
    """

    key: ClassVar[str] = "odometry_error"

    position: Annotated[PositiveMetres | None, Field(description="the most that it may be off")] = None
    yaw: Annotated[PositiveRadians | None, Field(description="the most that its heading may be off")] = None
    drift: Annotated[PositiveShare | None, Field(description="the most that it may be off, of the way made")] = None
    name: Annotated[str, Field(min_length=1, description="of the sensor in the scenario")] = "odometry"

    @model_validator(mode="after")
    def _asks_for_something(self) -> Self:
        if self.position is None and self.yaw is None and self.drift is None:
            raise ValueError("give 'position', 'yaw', 'drift' or several of them")
        return self

    @property
    def title(self) -> str:
        """See Assertion.title."""
        drift = None if self.drift is None else _percent(self.drift)
        told = (
            ("position", None if self.position is None else units.display(self.position, "m")),
            ("yaw", None if self.yaw is None else units.display(self.yaw, "rad")),
            ("drift", drift),
        )
        return f"odometry_error {', '.join(f'{name} at most {limit}' for name, limit in told if limit is not None)}"

    @property
    def channels(self) -> Channels:
        """See Assertion.channels."""
        return Channels(sensors=frozenset({self.name}))

    def sensor_problems(self, kinds: Mapping[str, str]) -> SpecProblems:
        """See Assertion.sensor_problems."""
        odometers = [name for name, kind in kinds.items() if kind == "odometry"]
        if self.name in odometers:
            return
        if self.name in kinds:
            yield (
                ("name",),
                f"'{self.name}' is no odometry but '{kinds[self.name]}'{did_you_mean(self.name, odometers)}",
            )
        elif not odometers:
            yield (), "the scenario has no odometry; put it below sensors, such as sensors: [odometry]"
        else:
            yield ("name",), f"the scenario has no sensor '{self.name}'{did_you_mean(self.name, odometers)}"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        from sim_action.assertions.odometry_monitor import OdometryMonitor

        return OdometryMonitor.opened(
            self.name, {"position": self.position, "yaw": self.yaw, "drift": self.drift}, start
        )


def _percent(share: float) -> str:
    """As people read it."""
    return f"{100 * share:.4g} %"

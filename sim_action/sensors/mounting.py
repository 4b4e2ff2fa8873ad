"""What can be said of any sensor, beside its own key; and a sensor with all of that."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from sim_action.core.field_types import FrozenModel, Metres, Name, PositiveHertz, Radians
from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.sensors import Sensor


class SensorPose(FrozenModel):
    """Where a sensor sits on its link, in the link's frame."""

    x: Metres = 0.0
    y: Metres = 0.0
    z: Metres = 0.0
    roll: Radians = 0.0
    pitch: Radians = 0.0
    yaw: Radians = 0.0

    @property
    def pose(self) -> Pose:
        """The same, as position and rotation."""
        return Pose((self.x, self.y, self.z), quaternion_from_rpy(self.roll, self.pitch, self.yaw))


class Mounting(FrozenModel):
    """What can be said of any sensor, beside its own key."""

    name: Annotated[Name | None, Field(description="how controllers find it; left out: its kind")] = None
    link: Annotated[str | None, Field(description="of the robot, that it sits on; left out: the base link")] = None
    pose: Annotated[SensorPose, Field(description="of the sensor, in the frame of its link")] = (
        SensorPose.model_construct()
    )
    rate: Annotated[PositiveHertz, Field(description="at which it is read")] = 10.0
    trace: Annotated[bool, Field(description="whether the trace keeps what it tells")] = False


@dataclass(frozen=True, slots=True)
class MountedSensor:
    """A sensor with its name, its place on the robot and its rate; `link` None: the base link."""

    sensor: Sensor
    name: str
    link: str | None
    pose: Pose
    rate: float
    trace: bool

"""Sensors: what a controller gets to see of the robot and its surroundings, each at a rate of its own.

A sensor is a frozen spec whose fields are the YAML keys; `open` gives the live half. It is read before the commands of
the same moment are asked for, and only if somebody listens: a controller that looks, or a trace that keeps it.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, ClassVar, Final

from pydantic import Field

from sim_action.core.field_types import FrozenModel, Metres, Name, PositiveHertz, Radians
from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.core.registry import Table
from sim_action.core.yaml_errors import SpecProblems
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from numpy.random import Generator

    from sim_action.state.observation import Observation
    from sim_action.state.readings import Reading
    from sim_action.state.sensor_inputs import EngineQueries, WheelMotion


@dataclass(frozen=True)
class Sight:
    """The present, as sensors get to see it: the robot, and an engine that can be asked for more.

    Attributes:
        time: sim time in s.
        look: what the robot is like; looked at once, if a sensor asks for it.
    """

    time: float
    probe: EngineQueries
    look: Callable[[], Observation]

    @cached_property
    def robot(self) -> Observation:
        """Its base, its joints and its contacts."""
        return self.look()


Measure = Callable[[Sight], "Reading"]
"""The live half of a sensor: from the present to what the sensor says of it; may remember what was before."""


@dataclass(frozen=True, slots=True)
class Mount:
    """Where a sensor sits, and what it draws its noise from.

    Attributes:
        link: of the robot.
        pose: of the sensor, in the frame of the link.
        rate: Hz, at which it is read.
        random: its own stream of random numbers.
        wheels: how those of the robot's drive move it; there for what `reads_wheels`.
    """

    scene: Scene
    link: str
    pose: Pose
    rate: float
    random: Generator
    wheels: WheelMotion | None = None


class Sensor(FrozenModel):
    """What all sensors are."""

    key: ClassVar[str]
    """Its name in YAML."""

    watches_contacts: ClassVar[bool] = False
    """Whether it reads `Observation.contacts`; they are computed only when asked for."""

    reads_wheels: ClassVar[bool] = False
    """Whether it is of the wheels of the robot's drive, and thereby of the base alone."""

    @property
    def reading_bytes(self) -> int:
        """How much of a trace a reading takes; 0 where it is not worth counting."""
        return 0

    def problems(self, scene: Scene) -> SpecProblems:
        """What does not fit the scene."""
        yield from ()

    @abstractmethod
    def open(self, mount: Mount) -> Measure:
        """The live half."""


SENSORS: Final = Table[type[Sensor]](
    "sensor",
    {
        "camera": "sim_action.sensors.camera:Camera",
        "contact": "sim_action.sensors.contact:ContactSensor",
        "imu": "sim_action.sensors.imu:Imu",
        "lidar": "sim_action.sensors.lidar:Lidar",
        "odometry": "sim_action.sensors.odometry:Odometry",
    },
)


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

"""Sensors: measurements of the robot and its surroundings for controllers, each at its own rate.

A sensor is a frozen spec whose fields are the YAML keys; `open` returns the function that measures. It is read before
the commands of the same moment, and only if a controller accesses it or the trace records it.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Annotated, ClassVar, Final

from pydantic import Field

from sim_action.core.field_types import FrozenModel, Name, PositiveHertz, RelativePose
from sim_action.core.geometry import Pose
from sim_action.core.lazy_numpy import Generator
from sim_action.core.records import dataclass, field
from sim_action.core.registry import Table
from sim_action.core.yaml_document import SpecProblems
from sim_action.state.observation import Observation
from sim_action.state.readings import EngineQueries, Reading, ReadingColumn, WheelMotion, columns_of, know_columns
from sim_action.state.trace_records import FRAME_RATE
from sim_action.state.transmission import PERFECT, Transmission
from sim_action.world.scene import Scene


@dataclass(frozen=True)
class Sight:
    """The present state as sensors see it: the robot, and queries to the engine."""

    time: float  # sim time in s
    probe: EngineQueries
    look: Callable[[], Observation]  # returns the state of the robot; called at most once

    @cached_property
    def robot(self) -> Observation:
        """The base, the joints and the contacts of the robot."""
        return self.look()


Measure = Callable[[Sight], "Reading"]
"""Returns the reading of a sensor for the present state; it may keep a state of its own."""


@dataclass(frozen=True, slots=True)
class Mount:
    """The mounting of an open sensor, and its source of noise."""

    scene: Scene
    link: str  # name of the robot's link
    pose: Pose  # of the sensor, in the frame of the link
    rate: float  # readings per second, in Hz
    random: Generator  # its own stream of random numbers
    wheels: WheelMotion | None = None  # the wheel kinematics of the robot's drive; only for sensors with `reads_wheels`


class Sensor(FrozenModel):
    """The base class of all sensors."""

    key: ClassVar[str]  # the YAML key of the sensor
    watches_contacts: ClassVar[bool] = False
    """True if it reads `Observation.contacts`, which are computed only on request."""

    reads_wheels: ClassVar[bool] = False
    """True if it reads the wheels of the robot's drive; it then sits on the base link."""

    runs_user_code: ClassVar[bool] = False
    """True for sensors of installed packages. A scenario with one gets an interpreter of its own."""

    columns: ClassVar[Mapping[str, ReadingColumn]] = {}
    """The columns of the readings, for sensors of installed packages; READING_COLUMNS has the built-in sensors."""

    @classmethod
    def __pydantic_init_subclass__(cls, **_: object) -> None:
        """Let the sensors of installed packages count as user code, and make their columns known."""
        if not cls.__module__.startswith("sim_action."):
            cls.runs_user_code = True
            know_columns(getattr(cls, "key", ""), cls.columns)

    range_keys: ClassVar[Mapping[str, str]] = {}
    """Columns of its readings that are distances -> the key that states the greatest one."""

    is_picture: ClassVar[bool] = False
    """True if a reading is a picture, which takes as much memory and time as thousands of other readings."""

    noises: ClassVar[tuple[str, ...]] = ()  # the fields that make its readings random unless they are 0

    @property
    def is_random(self) -> bool:
        """True if its readings depend on the seed, or may do so."""
        return self.runs_user_code or any(getattr(self, name) for name in self.noises)

    def limits(self, reading: str, which: str | None) -> tuple[float, float]:
        """Return the least and the greatest value that a reading can have; `which`: as in the assertion `sensor`."""
        column = columns_of(self.key).get(reading)
        return (-math.inf, math.inf) if column is None else column.limits(which)

    @property
    def reading_bytes(self) -> int:
        """The size of a reading in a trace, in bytes; 0 if negligible."""
        return 0

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield the problems of this sensor in a scene."""
        yield from ()

    @abstractmethod
    def open(self, mount: Mount) -> Measure:
        """Return the function that measures."""


def sensor_named(scene: Scene, name: str) -> Sensor | None:
    """Return the sensor of a scene with a name; None if there is none, or its kind is unknown."""
    keys = next((fitting.keys for fitting in scene.sensors if fitting.name == name), None)
    return keys if isinstance(keys, Sensor) else None


SENSORS: Final = Table[type[Sensor]](
    "sensor",
    {
        "camera": "sim_action.sensors.camera:Camera",
        "contact": "sim_action.sensors.contact:ContactSensor",
        "imu": "sim_action.sensors.imu:Imu",
        "lidar": "sim_action.sensors.lidar:Lidar",
        "odometry": "sim_action.sensors.odometry:Odometry",
    },
    group="sim_action.sensors",
    base=Sensor,
)


class SensorPose(RelativePose):
    """The pose of a sensor in the frame of its link."""


class Mounting(Transmission):
    """The keys that every sensor has in addition to its own."""

    name: Annotated[Name | None, Field(description="name in controllers and reports; default: the kind of sensor")] = (
        None
    )
    link: Annotated[str | None, Field(description="link of the robot that carries it; default: the base link")] = None
    pose: Annotated[SensorPose, Field(description="pose of the sensor in the frame of its link")] = (
        SensorPose.model_construct()
    )
    rate: Annotated[PositiveHertz, Field(description="readings per second")] = 10.0
    trace: Annotated[bool, Field(description="record the readings in the trace")] = False


@dataclass(frozen=True, slots=True)
class MountedSensor:
    """A sensor with its name, mounting and rate; `link` None: the base link."""

    sensor: Sensor
    name: str
    link: str | None
    pose: Pose
    rate: float
    trace: bool
    transmission: Transmission = PERFECT


_PICTURE_RATE: Final = 2.0
_MAX_BYTES: Final = 32_000_000
_SMALL_READING_BYTES: Final = 500  # the size of a reading without arrays, for example of an IMU


@dataclass(slots=True)
class ReadingLog:
    """The readings of one sensor: at most 30 per second, 2 of a camera, and fewer in long runs."""

    mounted: MountedSensor
    every: int = 1  # one of so many readings is kept
    readings: list[Reading] = field(default_factory=list)  # the kept readings, in the order of time
    _seen: int = 0

    @classmethod
    def of(cls, mounted: MountedSensor) -> ReadingLog:
        """Return the empty log of a sensor."""
        most = _PICTURE_RATE if mounted.sensor.is_picture else FRAME_RATE
        return cls(mounted, max(1, math.ceil(mounted.rate / most - 1e-9)))

    def add(self, reading: Reading) -> None:
        """Add the next reading, unless it is one to leave out."""
        if self._seen % self.every == 0:
            self.readings.append(reading)
            if len(self.readings) * max(_SMALL_READING_BYTES, self.mounted.sensor.reading_bytes) > _MAX_BYTES:
                # The first reading and every second one after it stay.
                del self.readings[1::2]
                self.every *= 2
        self._seen += 1

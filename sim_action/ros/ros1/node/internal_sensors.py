"""Sensors of the node itself: states of links and bodies, and sensors that measure only for subscribers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar, Final

from numpy.typing import ArrayLike
from pydantic import PrivateAttr
from typing_extensions import override

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist
from sim_action.core.records import dataclass
from sim_action.sensors import Measure, Mount, MountedSensor, Sensor, Sight
from sim_action.state.observation import Observation
from sim_action.state.readings import Reading

_NAME: Final = "states"


@dataclass(frozen=True, slots=True)
class WorldStates:
    """A reading: name -> pose and twist in the world frame, of links and of bodies.

    Attributes:
        time: sim time in s.
    """

    time: float
    links: Mapping[str, tuple[Pose, Twist]]
    bodies: Mapping[str, tuple[Pose, Twist]]

    def columns(self) -> Mapping[str, ArrayLike]:
        """See Reading.columns: no trace keeps it."""
        return {}


class WorldStatesSensor(Sensor):
    """Reads the states of links and bodies. No key of a scenario leads here."""

    key: ClassVar[str] = "states"

    _wants_links: Callable[[], bool] = PrivateAttr()

    @classmethod
    def wanted(cls, wants_links: Callable[[], bool]) -> WorldStatesSensor:
        """Return a sensor that reads links only when they are wanted: it takes as long as all the rest."""
        sensor = cls()
        sensor._wants_links = wants_links
        return sensor

    @override
    def open(self, mount: Mount) -> Measure:
        links = tuple(mount.scene.model.links_by_name)
        bodies = tuple(body.name for body in mount.scene.world.objects)
        before: dict[str, Pose] = {}

        def measure(sight: Sight) -> WorldStates:
            probe = sight.probe
            poses = {body: probe.body_pose(body) for body in bodies}
            moved = {
                body: (pose, geometry.twist_between(before.get(body, pose), pose, 1 / mount.rate))
                for body, pose in poses.items()
            }
            before.update(poses)
            wanted = links if self._wants_links() else ()
            placed = {link: (probe.link_pose(link), probe.link_twist(link)) for link in wanted}
            return WorldStates(sight.time, placed, moved)

        return measure


def states_sensor(rate: float, wants_links: Callable[[], bool]) -> MountedSensor:
    """Return the mounted sensor that `states_in` reads."""
    return MountedSensor(WorldStatesSensor.wanted(wants_links), _NAME, None, Pose(), rate, trace=False)


def states_in(seen: Observation) -> WorldStates:
    """Return the latest reading."""
    reading = seen.sensors[_NAME]
    assert isinstance(reading, WorldStates)
    return reading


@dataclass(frozen=True, slots=True)
class NotMeasured:
    """A placeholder for a reading that no node wants; `time`: s of sim time."""

    time: float

    def columns(self) -> Mapping[str, ArrayLike]:
        """See Reading.columns: no trace keeps it."""
        return {}


class OnDemandSensor(Sensor):
    """Another sensor, which measures only when it is wanted. No key of a scenario leads here."""

    key: ClassVar[str] = "heard"

    _inner: Sensor = PrivateAttr()
    _is_wanted: Callable[[float], bool] = PrivateAttr()
    _keeps_first: bool = PrivateAttr()

    @classmethod
    def of(cls, inner: Sensor, is_wanted: Callable[[float], bool], *, keeps_first: bool = False) -> OnDemandSensor:
        """Return the sensor.

        Args:
            inner: the sensor that measures.
            is_wanted: called at each of its ticks, with the sim time in s.
            keeps_first: True if a reading does not depend on the one before.
        """
        sensor = cls()
        sensor._inner, sensor._is_wanted, sensor._keeps_first = inner, is_wanted, keeps_first
        return sensor

    def open(self, mount: Mount) -> Measure:
        """See Sensor.open. The first reading after a pause may be dropped: it may cover the whole pause."""
        measure = self._inner.open(mount)
        is_fresh = True

        def measure_on_demand(sight: Sight) -> Reading:
            nonlocal is_fresh
            was_fresh, is_fresh = is_fresh or self._keeps_first, self._is_wanted(sight.time)
            reading = measure(sight) if is_fresh else NotMeasured(sight.time)
            return reading if was_fresh else NotMeasured(sight.time)

        return measure_on_demand

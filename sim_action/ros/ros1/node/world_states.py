"""Where everything is: the links of the robot and the bodies around it, read from the engine at every tick."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

from numpy.typing import ArrayLike
from pydantic import PrivateAttr

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist
from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.sensors.mounting import MountedSensor
from sim_action.state.observation import Observation

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


class StatesSensor(Sensor):
    """Reads them. No key of a scenario leads here."""

    key: ClassVar[str] = "states"

    _wants_links: Callable[[], bool] = PrivateAttr()

    @classmethod
    def wanted(cls, wants_links: Callable[[], bool]) -> StatesSensor:
        """Links are read at moments at which somebody wants to know of them: that takes as long as all the rest."""
        sensor = cls()
        sensor._wants_links = wants_links
        return sensor

    def open(self, mount: Mount) -> Measure:
        """See Sensor.open."""
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
    """The one that `states_in` finds the reading of."""
    return MountedSensor(StatesSensor.wanted(wants_links), _NAME, None, Pose(), rate, trace=False)


def states_in(seen: Observation) -> WorldStates:
    """The latest reading."""
    reading = seen.sensors[_NAME]
    assert isinstance(reading, WorldStates)
    return reading

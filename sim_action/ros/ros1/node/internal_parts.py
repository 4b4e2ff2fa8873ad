"""Parts of a simulation that only the node itself adds: sensors of all states or on demand, and the planar drive.

The drive works like Gazebo's planar_move: it pushes a base over the ground at the commanded velocity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar, Final, Self

from numpy.typing import ArrayLike
from pydantic import PrivateAttr
from typing_extensions import override

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.core.records import dataclass, replace
from sim_action.core.yaml_document import SpecProblems
from sim_action.drives import Drive, is_level
from sim_action.drives.mecanum import NOT_LEVEL
from sim_action.drives.plugins import NoDrive, Stated
from sim_action.drives.wheels import centre_of_mass
from sim_action.robot.model.kinematics import Mobility
from sim_action.robot.model.robot_model import RobotModel
from sim_action.sensors import Measure, Mount, MountedSensor, Sensor, Sight
from sim_action.state.command import NO_PUSH, BasePush, JointTargets
from sim_action.state.observation import Observation
from sim_action.state.readings import Reading
from sim_action.world import GRAVITY
from sim_action.world.scene import Scene

_NAME: Final = "states"
PLUGIN: Final = "gazebo_ros_planar_move"

# Gazebo sets the velocity at every step, even against an obstacle. With this force, 1 m/s takes 10 ms.
_MAX_FORCE_PER_WEIGHT: Final = 10.0
_LEVER_ARM_M: Final = 1.0


@dataclass(frozen=True, slots=True)
class WorldStates:
    """A reading at a sim time in s: name -> pose and twist in the world frame, of links and of bodies."""

    time: float
    links: Mapping[str, tuple[Pose, Twist]]
    bodies: Mapping[str, tuple[Pose, Twist]]

    def links_of_models(self, robot: str) -> dict[str, tuple[Pose, Twist]]:
        """Return the states by `model::link`, as Gazebo names links; nothing if links were not read."""
        bodies = {f"{name}::link": state for name, state in self.bodies.items()}
        links = {f"{robot}::{name}": state for name, state in self.links.items()}
        return {**bodies, **links} if links else {}

    def columns(self) -> Mapping[str, ArrayLike]:
        """See Reading.columns: no trace keeps it."""
        return {}


class WorldStatesSensor(Sensor):
    """Reads the states of links and bodies. No key of a scenario leads here."""

    key: ClassVar[str] = "states"

    _wants_links: Callable[[], bool] = PrivateAttr()

    @classmethod
    def on_demand(cls, wants_links: Callable[[], bool]) -> WorldStatesSensor:
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
            measured_links = links if self._wants_links() else ()
            placed = {link: (probe.link_pose(link), probe.link_twist(link)) for link in measured_links}
            return WorldStates(sight.time, placed, moved)

        return measure


def states_sensor(rate: float, wants_links: Callable[[], bool]) -> MountedSensor:
    """Return the mounted sensor that `states_in` reads."""
    return MountedSensor(WorldStatesSensor.on_demand(wants_links), _NAME, None, Pose(), rate, trace=False)


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
        """Return the sensor; `is_wanted`: called at its ticks; `keeps_first`: a reading does not depend on others."""
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


class PlanarMove(Drive):
    """Pushes the base to its velocity at once, with sliding links. No key of a scenario leads here."""

    key: ClassVar[str] = "planar_move"

    @classmethod
    @override
    def statements(cls, model: RobotModel) -> Stated | None:
        return Stated({}, {}, source="geometry") if any(plugin.name == PLUGIN for plugin in model.plugins) else None

    @classmethod
    def by_wheels(cls, model: RobotModel) -> Self:
        """See Drive.by_wheels. No wheel moves the base."""
        raise NoDrive(f"'{model.name}' has no plugin {PLUGIN}")

    def problems(self, model: RobotModel) -> SpecProblems:
        """Return no problems: any model fits."""
        return iter(())

    @override
    def open(self, model: RobotModel, rate: float, gravity: float = GRAVITY) -> PlanarMotion:
        return PlanarMotion(centre_of_mass(model), _MAX_FORCE_PER_WEIGHT * model.mass * max(gravity, GRAVITY))

    @override
    def wheel_motion(self, model: RobotModel) -> None: ...

    @override
    def figures(self, model: RobotModel, gravity: float) -> str:
        return "planar move (kinematic): the base takes the commanded velocity at once, and its links have no friction"

    @override
    def mobility(self, model: RobotModel) -> Mobility:
        return Mobility()

    def prepared(self, scene: Scene) -> Scene:
        """See Drive.prepared. Links get no friction: a base that is pushed at its centre of mass would tip over."""
        links = tuple(replace(link, surface=replace(link.surface, friction=0.0)) for link in scene.model.links)
        return replace(super().prepared(scene), model=replace(scene.model, links=links))


class PlanarMotion:
    """The motion of the drive; `point_xyz`: m, base frame, where up to `force` N push."""

    joints: Final[frozenset[str]] = frozenset()
    released: Final = JointTargets(base=NO_PUSH)

    def __init__(self, point_xyz: Vector3, force: float) -> None:
        self._point_xyz, self._force = point_xyz, force
        self._was_level = True

    @property
    def notes(self) -> tuple[str, ...]:
        """The remark on a command that was not level, if there was one."""
        return () if self._was_level else (NOT_LEVEL,)

    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        """Return the push of the next steps, which is the same for all of them."""
        self._was_level &= is_level(twist)
        x, y, _ = twist.linear_xyz
        push = BasePush((x, y), twist.angular_xyz[2], self._point_xyz, self._force, self._force * _LEVER_ARM_M)
        return [JointTargets(base=push)]

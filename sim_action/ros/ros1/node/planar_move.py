"""The drive of Gazebo's planar_move: pushes a base over the ground at the commanded velocity."""

from __future__ import annotations

from typing import ClassVar, Final, Self

from typing_extensions import override

from sim_action.core.geometry import Twist, Vector3
from sim_action.core.records import replace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.drives import Drive, NoDrive, is_level
from sim_action.drives.mecanum import NOT_LEVEL
from sim_action.drives.wheels import centre_of_mass
from sim_action.robot.model.kinematics import Mobility
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.command import NO_PUSH, BasePush, JointTargets
from sim_action.world import GRAVITY
from sim_action.world.scene import Scene

PLUGIN: Final = "gazebo_ros_planar_move"

# Gazebo sets the velocity at every step, whatever is in the way. With this force, 1 m/s takes 10 ms.
_MAX_FORCE_PER_WEIGHT: Final = 10.0
_LEVER_ARM_M: Final = 1.0


class PlanarMove(Drive):
    """Pushes the base to its velocity at once, with sliding links. No key of a scenario leads here."""

    key: ClassVar[str] = "planar_move"

    @classmethod
    @override
    def statement(cls, model: RobotModel) -> Self | None:
        return cls() if any(plugin.name == PLUGIN for plugin in model.plugins) else None

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

    def wheel_motion(self, model: RobotModel) -> None:
        """See Drive.wheel_motion."""

    @override
    def describe(self, model: RobotModel, gravity: float = GRAVITY) -> str:
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
        """See DriveMotion.notes."""
        return () if self._was_level else (NOT_LEVEL,)

    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        """See DriveMotion.targets."""
        self._was_level &= is_level(twist)
        x, y, _ = twist.linear_xyz
        push = BasePush((x, y), twist.angular_xyz[2], self._point_xyz, self._force, self._force * _LEVER_ARM_M)
        return [JointTargets(base=push)]

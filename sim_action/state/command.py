"""Commands of controllers: a twist for the robot's base, targets for named joints, or a wrench on a link."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Final

from sim_action.core.geometry import ZERO, Twist, Vector3, number
from sim_action.core.records import dataclass, field

if TYPE_CHECKING:
    from sim_action.state.joint_motion import JointMotion

WORLD_FRAME: Final = "world"


@dataclass(frozen=True, slots=True)
class BasePush:
    """A push on the base by parts that are not modelled, such as rollers: towards a velocity, with a limited force.

    Attributes:
        linear_xy: target velocity of the base link's origin in m/s, along the x and y axes of the base.
        angular_z: target turn rate in rad/s.
        point_xyz: the point where the force acts, in m, base frame.
        max_force: N, horizontal.
        max_torque: N m, about the vertical axis.
    """

    linear_xy: tuple[float, float]
    angular_z: float
    point_xyz: Vector3
    max_force: float
    max_torque: float


NO_PUSH: Final = BasePush((0.0, 0.0), 0.0, (0.0, 0.0, 0.0), max_force=0.0, max_torque=0.0)  # ends a push


@dataclass(frozen=True, slots=True)
class LinkWrench:
    """A force and a torque on a link, applied at every physics step until the source commands this link again.

    Wrenches on one link add up, in one answer and over several command sources. An answer that names a link replaces
    the earlier wrenches of its source on this link; a wrench of zeros ends them.

    Attributes:
        link: name of a link that can move.
        force_xyz: N, along the axes of `frame`.
        torque_xyz: N m, about the axes of `frame`.
        frame: "world", "base" (the base link), or the name of a link, with whose axes the wrench turns at each step.
        point_xyz: the point where the force acts, in m, in the frame of `link`. The default is the origin of the
            link's frame, which is not its centre of mass in general.
    """

    link: str
    force_xyz: Vector3 = ZERO
    torque_xyz: Vector3 = ZERO
    frame: str = WORLD_FRAME
    point_xyz: Vector3 = ZERO


@dataclass(frozen=True, slots=True)
class JointTargets:
    """Targets for the motors of some joints; joints that are not named keep their last target.

    Attributes:
        position: joint name -> rad (or m for a prismatic joint), held by a position servo.
        velocity: joint name -> rad/s (or m/s), held by a velocity servo. With a position for the same joint: the
            velocity of the moving position target, which the servo then follows without lag.
        effort: joint name -> N m (or N), applied directly.
        max_effort: joint name -> N m (or N), the limit for the servo of that joint; default: the limit of the model.
        base: the push on the base; None: as before. For drives, not for scripts.
        wrenches: all wrenches on links; None: as before. For engines: a script answers with a LinkWrench instead.
        motions: position targets that go on to move by themselves, until their joints are named again. For the loop,
            which gives the engine a position and a velocity for each physics step: a script answers with a
            JointMotion instead.
        actors: name of another robot -> its targets at the same step. For engines.
    """

    position: Mapping[str, float] = field(default_factory=dict)
    velocity: Mapping[str, float] = field(default_factory=dict)
    effort: Mapping[str, float] = field(default_factory=dict)
    max_effort: Mapping[str, float] = field(default_factory=dict)
    base: BasePush | None = None
    wrenches: tuple[LinkWrench, ...] | None = None
    motions: tuple[JointMotion, ...] = ()
    actors: Mapping[str, JointTargets] | None = None

    def names(self) -> Iterator[str]:
        """Yield every joint with a target, once."""
        yield from self.position
        yield from (name for name in self.velocity if name not in self.position)
        yield from self.effort
        for motion in self.motions:
            yield from motion.names

    @property
    def kinds(self) -> dict[str, str]:
        """Joint -> the commanded quantity: "position", "velocity" or "effort"."""
        moving = (name for motion in self.motions for name in motion.names)
        groups = {"velocity": self.velocity, "effort": self.effort, "position": (*self.position, *moving)}
        return {name: kind for kind, names in groups.items() for name in names}

    def updated_by(self, later: JointTargets) -> JointTargets:
        """Return these targets; `later` replaces the targets of the joints that it names."""
        if not any(self.names()) and self.base is None and self.wrenches is None:
            return later
        renamed = set(later.names())
        motions = self.motions and without_joints(self.motions, renamed)

        def kept(group: Mapping[str, float]) -> dict[str, float]:
            return {name: value for name, value in group.items() if name not in renamed}

        return JointTargets(
            position={**kept(self.position), **later.position},
            velocity={**kept(self.velocity), **later.velocity},
            effort={**kept(self.effort), **later.effort},
            max_effort={**kept(self.max_effort), **later.max_effort},
            base=later.base or self.base,
            wrenches=self.wrenches if later.wrenches is None else later.wrenches,
            motions=(*motions, *later.motions),
        )


def without_joints(motions: Iterable[JointMotion], joints: Collection[str]) -> tuple[JointMotion, ...]:
    """Return motions without some joints, and drop motions that have no other joint."""
    left = (motion.only(name for name in motion.names if name not in joints) for motion in motions)
    return tuple(motion for motion in left if motion.names)


Command = Twist | JointTargets | LinkWrench
Answer = Command | tuple[Command, ...] | None
"""The answer of a controller at a tick: a command, several that act together, or None to keep the last ones."""


def commands_of(answer: Answer) -> tuple[Command, ...]:
    """Return all commands of a controller's answer."""
    if answer is None:
        return ()
    return answer if isinstance(answer, tuple) else (answer,)


def is_finite(command: Command) -> bool:
    """Return True if all numbers of the command are finite. Raise TypeError for a value that is not a number."""
    return all(math.isfinite(number(value)) for value in _numbers(command))


def _numbers(command: Command) -> Iterable[float]:
    if isinstance(command, Twist):
        return (*command.linear_xyz, *command.angular_xyz)
    if isinstance(command, LinkWrench):
        return (*command.force_xyz, *command.torque_xyz, *command.point_xyz)
    groups = (command.position, command.velocity, command.effort, command.max_effort)
    return (value for group in groups for value in group.values())

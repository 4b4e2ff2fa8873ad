"""What a command is: a twist for the robot's base, or targets for named joints."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from sim_action.core.geometry import Twist, Vector3


@dataclass(frozen=True, slots=True)
class BasePush:
    """How a base is pushed over the ground by what is not modelled, such as rollers: to a velocity, by a limited force.

    Attributes:
        linear_xy: m/s, of the base link's origin, along the base's own x and y.
        angular_z: rad/s.
        point_xyz: m, base frame: where the force acts.
        max_force: N, level.
        max_torque: N m, about the upright.
    """

    linear_xy: tuple[float, float]
    angular_z: float
    point_xyz: Vector3
    max_force: float
    max_torque: float


NO_PUSH: Final = BasePush((0.0, 0.0), 0.0, (0.0, 0.0, 0.0), max_force=0.0, max_torque=0.0)
"""Lets a base go that was pushed."""


@dataclass(frozen=True, slots=True)
class JointTargets:
    """Where the motors of some joints shall go; joints that are not named keep what they were told before.

    Attributes:
        position: joint name -> rad (or m for a prismatic joint), held by a position servo.
        velocity: joint name -> rad/s (or m/s), held by a velocity servo. Of a joint that has a position as well: how
            fast that position is moving on, which its servo follows without falling behind.
        effort: joint name -> N m (or N), applied as it is.
        max_effort: joint name -> N m (or N) that the servo of that joint may use; left out: the model's own limit.
        base: how the base is pushed; None: as before. For drives, not for scripts.
    """

    position: Mapping[str, float] = field(default_factory=dict)
    velocity: Mapping[str, float] = field(default_factory=dict)
    effort: Mapping[str, float] = field(default_factory=dict)
    max_effort: Mapping[str, float] = field(default_factory=dict)
    base: BasePush | None = None

    def names(self) -> Iterator[str]:
        """Every joint that is given a target, once."""
        yield from self.position
        yield from (name for name in self.velocity if name not in self.position)
        yield from self.effort

    def updated_by(self, later: JointTargets) -> JointTargets:
        """These targets, but for the joints that `later` names."""
        if not any(self.names()) and self.base is None:
            return later
        renamed = set(later.names())

        def kept(group: Mapping[str, float]) -> dict[str, float]:
            return {name: value for name, value in group.items() if name not in renamed}

        return JointTargets(
            position={**kept(self.position), **later.position},
            velocity={**kept(self.velocity), **later.velocity},
            effort={**kept(self.effort), **later.effort},
            max_effort={**kept(self.max_effort), **later.max_effort},
            base=later.base or self.base,
        )


Command = Twist | JointTargets

Answer = Command | tuple[Command, ...] | None
"""What a controller says at a tick: a command, several for different joints, or none: the last ones stand."""


def commands_of(answer: Answer) -> tuple[Command, ...]:
    """Each command of an answer."""
    if answer is None:
        return ()
    return answer if isinstance(answer, tuple) else (answer,)


def is_finite(command: Command) -> bool:
    """Whether every number of the command is one that a motor can be given."""
    if isinstance(command, Twist):
        return all(map(math.isfinite, (*command.linear_xyz, *command.angular_xyz)))
    if command.base is not None and not is_finite_push(command.base):
        return False
    groups = (command.position, command.velocity, command.effort, command.max_effort)
    return all(math.isfinite(value) for group in groups for value in group.values())


def is_finite_push(push: BasePush) -> bool:
    """Whether every number of it is finite."""
    numbers = (*push.linear_xy, push.angular_z, *push.point_xyz, push.max_force, push.max_torque)
    return all(map(math.isfinite, numbers))

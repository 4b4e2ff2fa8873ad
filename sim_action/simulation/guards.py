"""The guards of a run: each looks at every physics step, and ends a run that can have no verdict.

The watchdog checks that the state is physically possible. It detects values that are not numbers, speeds that explode
(in an engine they often stay finite, see `world.MAX_SPEED`), and a robot that falls through the ground: such a robot
would stay upright for ever.

The ground fills all space below z = 0. The distance from the base link's origin to the nearest collision shape is at
most the sum of the joint offsets on the way there. If the origin is deeper than that, the shape is inside the ground.
One more metre is allowed for a fast fall within one step, and for meshes away from their own origin. Smaller sinking
is not detected. A fixed base cannot sink.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Final, Self

import numpy as np
from typing_extensions import override

from sim_action.core.errors import RunError, SimulationUnstable
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass
from sim_action.robot.model.robot_model import Joint, RobotModel
from sim_action.state.observation import Clash, Observation, Overlap
from sim_action.state.trace import Trace
from sim_action.world import MAX_SPEED, Physics
from sim_action.world.scene import Scene

NO_BODIES: Final = np.empty((0, 0, 7))  # the poses of no bodies
_SINK_MARGIN_M: Final = 1.0
# Three components of at most this size have a norm below 1.
_IN_EACH_DIRECTION: Final = 1 / math.sqrt(3) - 1e-9
_ANY_NUMBER: Final = float(np.finfo(np.float64).max)

_EXPLODES: Final = (
    "usual causes: an inertia that is too small for the forces, time steps that are too long (raise physics.rate), "
    "the gains of a controller"
)
_SINKS: Final = (
    "usual causes: no collision shape that carries the robot, a start below the ground (robot.pose.z), "
    "an inertia that does not fit mass and size, time steps that are too long (raise physics.rate)"
)


def last_speed(trace: Trace) -> float:
    """Return the greatest of all speeds in m/s or rad/s at the last moment: of the base and its turn, and of joints."""
    last = (trace.speed[-1:], trace.turn_rate[-1:], np.abs(trace.joint_velocity[-1]))
    return float(np.concatenate(last).max())


class Guard:
    """A guard of one run. It gets every block of steps in order, from t = 0 on."""

    def watch(self, trace: Trace, bodies: FloatArray) -> tuple[Trace, RunError | None]:
        """Return the moments before the first one that can have no verdict, and its error.

        :param bodies: the poses (T, M, 7) of the bodies with a mass; rows beyond the end of `trace` are ignored.
        """
        return trace, None

    def judged(self, trace: Trace, touching: Iterable[Overlap | Clash]) -> None:
        """Take the moments that the expectations have judged, and the contacts of the last of them."""

    def follow(self, scene: Scene) -> None:
        """Take a scene that states the times of events in the world since t = 0."""

    def notes(self, end: float) -> Iterable[str]:
        """Return notes on a run that ended at this sim time in s."""
        return ()


@dataclass(frozen=True, slots=True, eq=False)
class _Watch:
    """A watched quantity over the moments of a trace."""

    where: str  # the part of the robot
    values: FloatArray  # (T,) magnitudes; NaN where a value in the state of this part is not a number
    bound: float
    unit: str
    key: str  # the key of the scenario that sets the bound
    most: float = math.inf  # the largest allowed bound
    causes: str = _EXPLODES

    @property
    def excess(self) -> FloatArray:
        """The values divided by the bound, (T,); 1 and above is not physical."""
        return np.nan_to_num(self.values / self.bound, nan=np.inf)

    def fault(self, moment: int) -> str:
        """Return the problem at a moment, and the next step for the user."""
        value = float(self.values[moment])
        if not math.isfinite(value):
            return f"first in {self.where}: its state is not a number; {self.causes}"
        measured = f"{value:.4g} {self.unit}, and the bound is {self.bound:.4g} {self.unit.split()[0]}"
        remedy = f"if this is intended, raise {self.key}" if self.bound < self.most else "no engine allows more"
        return f"first in {self.where}: {measured}; {self.causes}; {remedy}"


@dataclass(frozen=True, eq=False)
class Watchdog(Guard):
    """The bounds of a physical state."""

    physics: Physics
    model: RobotModel
    depth: float  # the allowed depth of the base link's origin below the ground, in m
    centre: FloatArray  # (14 + 3 J,) a row of `Trace.state`: the start position, and zeros
    safe: FloatArray  # (14 + 3 J,) a state within this distance of `centre` is physical, if the robot has not sunk

    @classmethod
    def of(cls, scene: Scene, start: Observation) -> Self:
        """Return the watchdog of a robot that has just been placed."""
        physics, model, position = scene.physics, scene.model, start.pose.position_xyz
        centre = np.zeros(14 + 3 * len(model.moving_joints))
        centre[1:4] = position
        return cls(physics, model, _depth(scene, position[2]), centre, _safe(physics, model.moving_joints))

    @override
    def watch(self, trace: Trace, bodies: FloatArray = NO_BODIES) -> tuple[Trace, RunError | None]:
        # Comparisons with NaN are False.
        plainly = (np.abs(trace.state - self.centre) <= self.safe).all()
        if plainly and (trace.base_position_xyz[:, 2] > -self.depth).all():
            return trace, None
        with np.errstate(all="ignore"):
            # If joints and base fail in the same step, the joints are the cause: they move the base.
            groups = list(self._joints(trace)), list(self._base(trace))
            over = np.array([watch.excess >= 1 for group in groups for watch in group]).any(axis=0)
            if not over.any():
                return trace, None
            first = int(np.argmax(over))
            worst = (max(group, key=lambda watch: float(watch.excess[first])) for group in groups if group)
            fault = next(watch.fault(first) for watch in worst if watch.excess[first] >= 1)
            message = f"simulation unstable {self._when(float(trace.time[first]))}, {fault}"
            unstable = SimulationUnstable(message, keys=("robot", "model"))
            return trace.first(first), unstable

    def _joints(self, trace: Trace) -> Iterator[_Watch]:
        physics, readings = self.physics, (trace.joint_position, trace.joint_velocity, trace.joint_effort)
        for index, joint in enumerate(self.model.moving_joints):
            where, (position, velocity, effort) = f"joint {joint.name}", (reading[:, index] for reading in readings)
            velocity = np.where(np.isfinite(position) & np.isfinite(effort), np.abs(velocity), np.nan)
            if joint.type != "prismatic":
                yield _Watch(where, velocity, physics.max_turn_rate, "rad/s", "physics.max_turn_rate", MAX_SPEED)
                continue
            yield _Watch(where, velocity, physics.max_speed, "m/s", "physics.max_speed", MAX_SPEED)
            yield _Watch(where, np.abs(position), physics.max_distance, "m", "physics.max_distance")

    def _base(self, trace: Trace) -> Iterator[_Watch]:
        physics, where = self.physics, f"the base link {self.model.root}"
        finite = np.isfinite(trace.state[:, 1:14]).all(axis=1)
        turning, speed = (np.where(finite, values, np.nan) for values in (trace.turn_rate, trace.speed))
        x, y, z = self.centre[1:4].tolist()
        yield _Watch(where, turning, physics.max_turn_rate, "rad/s", "physics.max_turn_rate", MAX_SPEED)
        yield _Watch(where, speed, physics.max_speed, "m/s", "physics.max_speed", MAX_SPEED)
        away, below = trace.distance_to((x, y, z)), -trace.base_position_xyz[:, 2]
        yield _Watch(where, away, physics.max_distance, "m from where it began", "physics.max_distance")
        yield _Watch(where, below, self.depth, "m below the ground", "physics.max_depth", causes=_SINKS)

    def _when(self, time: float) -> str:
        if time > 0:
            return f"at t = {time:.3f} s (step {round(time * self.physics.rate)})"
        return f"while the robot settled, {self.physics.settle + time:.3f} s after its release"


def _safe(physics: Physics, joints: tuple[Joint, ...]) -> FloatArray:
    slides = np.array([joint.type == "prismatic" for joint in joints], dtype=np.bool_)
    distance, speed, turning = (
        [bound * _IN_EACH_DIRECTION] * 3 for bound in (physics.max_distance, physics.max_speed, physics.max_turn_rate)
    )
    position = np.where(slides, physics.max_distance, _ANY_NUMBER)
    velocity = np.nextafter(np.where(slides, physics.max_speed, physics.max_turn_rate), 0.0)
    base = [_ANY_NUMBER, *distance, *[_ANY_NUMBER] * 4, *speed, *turning]
    return np.concatenate((base, position, velocity, [_ANY_NUMBER] * len(joints)))


def _depth(scene: Scene, start: float) -> float:
    """Return the depth in m that the base link's origin may reach, from a start at the height `start`."""
    if scene.bolted:
        return math.inf
    # A robot that was placed on the ground is above it, wherever its origin is.
    drawn_below = -start if scene.placement.z is None else 0.0
    return scene.physics.max_depth or _SINK_MARGIN_M + max(_way_to_shape(scene.model), drawn_below)


def _way_to_shape(model: RobotModel) -> float:
    """Return a bound in m on the distance from the base link's origin to a collision shape; 0 without shapes."""
    ways = {model.root: 0.0}
    waiting = [model.root]
    while waiting:
        parent = waiting.pop()
        for joint in (joint for joint in model.joints if joint.parent == parent):
            ways[joint.child] = ways[parent] + math.hypot(*joint.origin.position_xyz) + _stroke(joint)
            waiting.append(joint.child)
    shapes = ((link.name, shape) for link in model.links for shape in link.collisions if link.name in ways)
    return min((ways[name] + math.hypot(*shape.pose.position_xyz) for name, shape in shapes), default=0.0)


def _stroke(joint: Joint) -> float:
    return max(abs(joint.lower or 0.0), abs(joint.upper or 0.0)) if joint.type == "prismatic" else 0.0

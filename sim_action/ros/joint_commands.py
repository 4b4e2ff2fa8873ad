"""Commands of joints in ROS: trajectories between points, targets of one kind, and limits."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

from sim_action.core.records import dataclass
from sim_action.robot.model.robot_model import Joint, Reading
from sim_action.state.command import JointTargets
from sim_action.state.observation import JointState


def targets(reading: Reading, values: Mapping[str, float]) -> JointTargets:
    """Return joint targets of one kind."""
    return JointTargets(
        position=values if reading == "position" else {},
        velocity=values if reading == "velocity" else {},
        effort=values if reading == "effort" else {},
    )


def resting(reading: Reading, joints: Iterable[Joint], states: Mapping[str, JointState]) -> dict[str, float]:
    """Return the values by which joints rest before the first command: their positions, or 0."""
    return {joint.name: states[joint.name].position if reading == "position" else 0.0 for joint in joints}


def within_limits(joint: Joint, reading: Reading, value: float) -> float:
    """Return a command cut off at the limits of the joint, as gazebo_ros_control does."""
    if reading == "position":
        lower = value if joint.lower is None else joint.lower
        upper = value if joint.upper is None else joint.upper
        return max(lower, min(upper, value))
    most = joint.max_velocity if reading == "velocity" else joint.max_effort
    return value if most is None else max(-most, min(most, value))


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A position in rad (or m) at a time in s; velocity and acceleration are None if they are not given."""

    time: float
    position: float
    velocity: float | None = None
    acceleration: float | None = None


@dataclass(frozen=True, slots=True)
class JointCurve:
    """The trajectory of one joint; `points`: at least one, at increasing times. It rests before and after them."""

    points: tuple[Waypoint, ...]

    def at(self, time: float) -> tuple[float, float]:
        """Return position and velocity at a time in s."""
        state = self.state(time)
        return state.position, state.velocity or 0.0

    def state(self, time: float) -> Waypoint:
        """Return position, velocity and acceleration at a time in s: linear, cubic or quintic, as its points state."""
        after = bisect_left([point.time for point in self.points], time)
        if after in (0, len(self.points)):
            return Waypoint(time, self.points[min(after, len(self.points) - 1)].position, 0.0, 0.0)
        first, last = self.points[after - 1 : after + 1]
        if first.velocity is None or last.velocity is None:
            return _straight(first, last, time)
        if first.acceleration is None or last.acceleration is None:
            return _cubic(first, first.velocity, last, last.velocity, time)
        return _quintic(first, last, time)


def curve_targets(joints: Mapping[str, Joint], curves: Mapping[str, JointCurve], time: float) -> JointTargets:
    """Return the targets of joints on their curves at a time in s, within the limits of the joints."""
    states = {name: curve.at(time) for name, curve in curves.items()}
    return JointTargets(
        position={name: within_limits(joints[name], "position", state[0]) for name, state in states.items()},
        velocity={name: within_limits(joints[name], "velocity", state[1]) for name, state in states.items()},
    )


@dataclass(frozen=True, slots=True)
class TrajectoryPoint:
    """A point of a trajectory of several joints; `time` in s. Velocities and accelerations may be empty."""

    time: float
    positions: Sequence[float]
    velocities: Sequence[float] = ()
    accelerations: Sequence[float] = ()

    def of_joint(self, index: int) -> Waypoint:
        """Return the point of one joint."""
        velocity = self.velocities[index] if self.velocities else None
        acceleration = self.accelerations[index] if self.accelerations else None
        return Waypoint(self.time, self.positions[index], velocity, acceleration)


def joint_curves(
    names: Sequence[str], start: Sequence[Waypoint], points: Sequence[TrajectoryPoint]
) -> dict[str, JointCurve]:
    """Return joint -> its trajectory, from its current state.

    A segment is cubic if both its ends have velocities, and quintic if they have accelerations, too. Points in the past
    are left out. Raises ValueError if no point is left, times do not increase, or a point has not all joints.
    """
    points = [point for point in points if point.time > start[0].time]
    if not points:
        raise ValueError("all its points are in the past")
    if any(later.time <= earlier.time for earlier, later in pairwise(points)):
        raise ValueError("the times of its points do not increase")
    if any(len(point.positions) != len(names) or not _fits(point, len(names)) for point in points):
        raise ValueError(f"each point needs {len(names)} positions, and as many velocities and accelerations or none")
    return {
        name: JointCurve((start[index], *(point.of_joint(index) for point in points)))
        for index, name in enumerate(names)
    }


def _fits(point: TrajectoryPoint, count: int) -> bool:
    return all(len(values) in (0, count) for values in (point.velocities, point.accelerations))


def _straight(first: Waypoint, last: Waypoint, time: float) -> Waypoint:
    speed = (last.position - first.position) / (last.time - first.time)
    return Waypoint(time, first.position + speed * (time - first.time), speed, 0.0)


def _cubic(first: Waypoint, speed: float, last: Waypoint, end_speed: float, time: float) -> Waypoint:
    """Return the state on the cubic Hermite curve between two points."""
    span = last.time - first.time
    part = (time - first.time) / span
    way = last.position - first.position
    a, b = span * speed - way, way - span * end_speed
    # p + s way + s (1 - s) (a (1 - s) + b s), and its derivatives by s.
    position = first.position + part * way + part * (1 - part) * (a * (1 - part) + b * part)
    growth = way + (1 - 2 * part) * (a * (1 - part) + b * part) + part * (1 - part) * (b - a)
    bend = 2 * (1 - 2 * part) * (b - a) - 2 * (a * (1 - part) + b * part)
    return Waypoint(time, position, growth / span, bend / span**2)


def _quintic(first: Waypoint, last: Waypoint, time: float) -> Waypoint:
    """Return the state on the polynomial of degree 5 between two points with velocities and accelerations."""
    span = last.time - first.time
    part = (time - first.time) / span
    way = last.position - first.position
    # In units of the segment: from 0 to `way` in a time of 1.
    v0, v1 = ((point.velocity or 0.0) * span for point in (first, last))
    a0, a1 = ((point.acceleration or 0.0) * span**2 for point in (first, last))
    c3 = 10 * way - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15 * way + 8 * v0 + 7 * v1 + 1.5 * a0 - a1
    c5 = 6 * way - 3 * (v0 + v1) - 0.5 * (a0 - a1)
    position = first.position + part * (v0 + part * (a0 / 2 + part * (c3 + part * (c4 + part * c5))))
    growth = v0 + part * (a0 + part * (3 * c3 + part * (4 * c4 + part * 5 * c5)))
    bend = a0 + part * (6 * c3 + part * (12 * c4 + part * 20 * c5))
    return Waypoint(time, position, growth / span, bend / span**2)

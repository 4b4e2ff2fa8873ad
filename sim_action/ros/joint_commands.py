"""Commands of joints in ROS: trajectories between points, targets of one kind, and limits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import groupby, pairwise

from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass
from sim_action.robot.model.robot_model import Joint, Reading
from sim_action.state.command import JointTargets
from sim_action.state.joint_motion import Curve, JointMotion, held, straight
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


@dataclass(frozen=True)
class JointCurve:
    """The trajectory of one joint; `points`: at least one, at increasing times. It rests before and after them."""

    points: tuple[Waypoint, ...]

    def at(self, time: float) -> tuple[float, float]:
        """Return position and velocity at a time in s."""
        position, velocity, _ = self.curve.at(time)
        return position, velocity

    def state(self, time: float) -> Waypoint:
        """Return position, velocity and acceleration at a time in s: linear, cubic or quintic, as its points state."""
        return Waypoint(time, *self.curve.at(time))

    @cached_property
    def curve(self) -> Curve:
        """The curve through the points; straight ways have ramps at points where they change their speed."""
        times: list[FloatArray] = []
        pieces: list[FloatArray] = []
        for is_smooth, group in groupby(
            pairwise(self.points), lambda way: None not in (way[0].velocity, way[1].velocity)
        ):
            ways = list(group)
            points = [ways[0][0], *(last for _, last in ways)]
            at, values = [point.time for point in points], [point.position for point in points]
            if not is_smooth:
                parts = [straight(at, values, points[0].velocity or 0.0, points[-1].velocity or 0.0)]
            else:
                parts = [_smooth(first, last) for first, last in ways]
            times += [part.times[:-1] for part in parts]
            pieces += [part.coefficients[:-1] for part in parts]
        last = self.points[-1]
        end = held([last.time], [last.position])
        return Curve(np.concatenate([*times, end.times]), np.concatenate([*pieces, end.coefficients]))


def _smooth(first: Waypoint, last: Waypoint) -> Curve:
    """Return the cubic or quintic curve between two points with velocities."""
    ends = (first, last)
    bends = [end.acceleration for end in ends]
    accelerations = None if None in bends else [bend or 0.0 for bend in bends]
    times, values = [end.time for end in ends], [end.position for end in ends]
    return Curve.through(times, values, [end.velocity or 0.0 for end in ends], accelerations)


def curve_targets(joints: Mapping[str, Joint], curves: Mapping[str, JointCurve], time: float) -> JointTargets:
    """Return the targets of joints on their curves from a time in s on, within the limits of the joints."""
    states = {name: curve.at(time) for name, curve in curves.items()}
    limits = [(joints[name].lower, joints[name].upper) for name in curves]
    ways = JointMotion(
        tuple(curves),
        tuple(curve.curve for curve in curves.values()),
        tuple(-math.inf if lower is None else lower for lower, _ in limits),
        tuple(math.inf if upper is None else upper for _, upper in limits),
    )
    return JointTargets(
        position={name: within_limits(joints[name], "position", state[0]) for name, state in states.items()},
        velocity={name: within_limits(joints[name], "velocity", state[1]) for name, state in states.items()},
        motions=(ways,),
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
    count = len(names)
    fit = (
        len(point.positions) == count and {len(point.velocities), len(point.accelerations)} <= {0, count}
        for point in points
    )
    if not all(fit):
        raise ValueError(f"each point needs {len(names)} positions, and as many velocities and accelerations or none")
    return {
        name: JointCurve((start[index], *(point.of_joint(index) for point in points)))
        for index, name in enumerate(names)
    }

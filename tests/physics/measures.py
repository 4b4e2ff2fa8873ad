"""The quantities of the zoo: functions that take a run, or several, and return one number."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from sim_action.core.geometry import Vector3
from sim_action.core.lazy_numpy import FloatArray
from tests.physics.case import Run

Measure = Callable[[Run], float]
GRAVITY = 9.80665


def yaw(run: Run) -> FloatArray:
    """The heading at all moments in rad, without jumps by whole turns."""
    return np.unwrap(run.trace.yaw)


def steady_speed(start: float, end: float, axes: int = 2) -> Measure:
    """The mean speed between two times in m/s; `axes`: 2 on the ground plane, 3 in space."""

    def measure(run: Run) -> float:
        first, last = (run.trace.base_position_xyz[run.row(time), :axes] for time in (start, end))
        return float(np.linalg.norm(last - first)) / (end - start)

    return measure


def path_between(run: Run, start: float, end: float) -> float:
    """The length of the path on the ground plane between two times, in m."""
    places = run.trace.base_position_xyz[run.row(start) : run.row(end) + 1, :2]
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())


def curve_speed(start: float, end: float) -> Measure:
    """The mean speed along a path between two times, in m/s."""
    return lambda run: path_between(run, start, end) / (end - start)


def turning(run: Run, start: float, end: float) -> float:
    """The turn between two times, in rad."""
    headings = yaw(run)
    return float(headings[run.row(end)] - headings[run.row(start)])


def steady_turn(start: float, end: float) -> Measure:
    """The mean turn rate between two times, in rad/s."""
    return lambda run: turning(run, start, end) / (end - start)


def turned(run: Run) -> float:
    return float(yaw(run)[-1] - run.trace.yaw[0])


def _apart(positions: FloatArray) -> float:
    """The distance on the ground plane between the first and the last position."""
    first, last = positions[[0, -1], :2]
    return float(np.linalg.norm(last - first))


def travelled(run: Run) -> float:
    return _apart(run.trace.base_position_xyz)


def path_length(run: Run) -> float:
    return path_between(run, 0.0, run.setup.seconds)


def radius(start: float, end: float) -> Measure:
    """The radius of the curve between two times, in m: the length of the path over the turning."""
    return lambda run: path_between(run, start, end) / abs(turning(run, start, end))


def final_speed(run: Run) -> float:
    return float(run.trace.speed[-1])


def acceleration_between(start: float, end: float, *, in_space: bool = False) -> Measure:
    """The mean acceleration along x between two times in m/s^2, or the mean change of the speed in space."""

    def measure(run: Run) -> float:
        speeds = run.trace.speed if in_space else run.trace.base_linear_xyz[:, 0]
        return float(speeds[run.row(end)] - speeds[run.row(start)]) / (end - start)

    return measure


def highest_tilt(run: Run) -> float:
    """The largest angle by which the base turns away from its attitude at t = 0, in degrees."""
    attitudes = run.trace.base_orientation_xyzw
    return math.degrees(2 * float(np.arccos(np.clip(np.abs(attitudes @ attitudes[0]), 0.0, 1.0)).max()))


def final_tilt(run: Run) -> float:
    """The tilt at the end, in degrees."""
    return math.degrees(float(run.trace.tilt[-1]))


def body_speed(name: str, start: float, end: float) -> Measure:
    """The mean speed of a body of the world on the ground plane between two times, in m/s."""

    def measure(run: Run) -> float:
        record = run.bodies[name]
        first, last = (int(np.argmin(np.abs(record.time - time))) for time in (start, end))
        way = np.linalg.norm(record.position_xyz[last, :2] - record.position_xyz[first, :2])
        return float(way / (record.time[last] - record.time[first]))

    return measure


def final_height(run: Run) -> float:
    return float(run.trace.base_position_xyz[-1, 2])


def _rise(positions: FloatArray) -> float:
    """How far a body rises above its height at t = 0, in m."""
    return float(positions[:, 2].max() - positions[0, 2])


def highest_rise(run: Run) -> float:
    return _rise(run.trace.base_position_xyz)


def energy_gain(mass: float, inertia: Vector3, after: float) -> Measure:
    """The highest energy after a moment, less that of the moment, over its kinetic energy.

    Of a loose body whose link frame is its centre of mass.
    """

    def measure(run: Run) -> float:
        kinetic = mass * run.trace.speed**2 / 2 + _turning(run, inertia)
        total = kinetic + mass * GRAVITY * run.trace.base_position_xyz[:, 2]
        first = run.row(after)
        return float((total[first:].max() - total[first]) / kinetic[first])

    return measure


def _turning(run: Run, inertia: Vector3) -> FloatArray:
    """The energy of rotation at all moments in J, for any attitude."""
    return np.asarray((own_rates(run) ** 2 @ np.asarray(inertia)) / 2)


def own_rates(run: Run) -> FloatArray:
    """The angular velocity in the frame of the base, (T, 3) rad/s."""
    x, y, z, w = run.trace.base_orientation_xyzw.T
    axes = (
        (1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)),
        (2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)),
        (2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)),
    )
    rates = run.trace.base_angular_xyz.T
    return np.column_stack([sum(part * rate for part, rate in zip(axis, rates, strict=True)) for axis in axes])


def angular_momentum(inertia: Vector3) -> Measure:
    """The angular momentum at the end, about the centre of mass, in N m s."""
    return lambda run: float(np.linalg.norm(own_rates(run)[-1] * np.asarray(inertia)))


def joint_angle(run: Run, name: str) -> FloatArray:
    return np.asarray(run.trace.joint_position[:, run.trace.joint_names.index(name)])


def passages(time: FloatArray, values: FloatArray) -> FloatArray:
    """The times at which values fall through 0."""
    before = np.flatnonzero((values[:-1] > 0) & (values[1:] <= 0))
    share = values[before] / (values[before] - values[before + 1])
    return np.asarray(time[before] + share * (time[before + 1] - time[before]))


def first_time_below(height: float) -> Measure:
    """The first time at which the base is at or below a height, between steps by a straight line."""

    def measure(run: Run) -> float:
        heights, times = run.trace.base_position_xyz[:, 2], run.trace.time
        below = int(np.argmax(heights <= height))
        if below == 0:
            return math.inf
        share = (heights[below - 1] - height) / (heights[below - 1] - heights[below])
        return float(times[below - 1] + share * (times[below] - times[below - 1]))

    return measure


def rebound(run: Run) -> float:
    """The greatest height after the lowest one of the first second, less that at the end."""
    heights = run.trace.base_position_xyz[:, 2]
    lowest = int(np.argmax(heights <= heights[-1] + 5e-4))
    return float(heights[lowest:].max() - heights[-1])


def impulse(start: float, end: float) -> Measure:
    """The sum of normal forces with bodies of the world between two times, times the step, in N s."""

    def measure(run: Run) -> float:
        return sum(contact.force for contact in run.trace.contacts if start < contact.time <= end) / run.setup.rate

    return measure


def body_rise(name: str) -> Measure:
    """The rise of a body of the world, seen 30 times a second."""
    return lambda run: _rise(run.bodies[name].position_xyz)


def body_travel(name: str) -> Measure:
    return lambda run: _apart(run.bodies[name].position_xyz)


def spread(measure: Measure) -> Callable[..., float]:
    """The range of a quantity over several runs, as a share of its mean."""

    def over(*runs: Run) -> float:
        values = [measure(run) for run in runs]
        return (max(values) - min(values)) / abs(math.fsum(values) / len(values))

    return over


def apart(one: Run, other: Run) -> float:
    """The distance between the final positions of two runs, in m."""
    return float(np.linalg.norm(one.trace.base_position_xyz[-1] - other.trace.base_position_xyz[-1]))


def ratio(measure: Measure) -> Callable[[Run, Run], float]:
    """How far a quantity of two runs differs, as a share of the first's."""

    def between(one: Run, other: Run) -> float:
        first, second = measure(one), measure(other)
        return abs(second - first) / abs(first)

    return between

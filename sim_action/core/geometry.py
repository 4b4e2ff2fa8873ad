"""Poses, twists and quaternions as plain floats.

Lengths in m, angles in rad. Quaternions are (x, y, z, w) and of unit length. Conventions of ROS REP 103: x forward,
y left, z up; roll, pitch, yaw turn about the fixed x, y, z axes in this order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, Self

from sim_action.core.records import dataclass

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Box = tuple[Vector3, Vector3]  # the lower and the upper corner of a box along the axes of a frame
ZERO: Final[Vector3] = (0.0, 0.0, 0.0)
IDENTITY: Final[Quaternion] = (0.0, 0.0, 0.0, 1.0)
AXES: Final[tuple[Vector3, Vector3, Vector3]] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""The unit vectors along x, y and z."""


@dataclass(frozen=True, slots=True)
class Pose:
    """The position and orientation of a frame, seen from its parent frame.

    Attributes:
        position_xyz: the position of its origin in m.
        orientation_xyzw: the orientation as a unit quaternion; `yaw` is the heading in rad.
    """

    position_xyz: Vector3 = ZERO
    orientation_xyzw: Quaternion = IDENTITY

    @property
    def yaw(self) -> float:
        """The heading about the parent's z axis, in rad, in (-pi, pi]."""
        x, y, z, w = self.orientation_xyzw
        return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


@dataclass(frozen=True, slots=True)
class Twist:
    """The linear and angular velocity of a frame; `Twist.planar(0.5, 0.2)` drives a base forward and to the left.

    Attributes:
        linear_xyz: the linear velocity in m/s.
        angular_xyz: the angular velocity about each axis in rad/s.
    """

    linear_xyz: Vector3 = ZERO
    angular_xyz: Vector3 = ZERO

    @classmethod
    def planar(cls, linear: float = 0.0, angular: float = 0.0, *, lateral: float = 0.0) -> Self:
        """Return the twist of a base: forward speed (m/s), turn rate to the left (rad/s), speed to the left (m/s)."""
        return cls((number(linear), number(lateral), 0.0), (0.0, 0.0, number(angular)))


def number(value: Any) -> float:
    """Return a number of any type as a float. Raise TypeError for other values, also for True, False and texts."""
    if isinstance(value, str) or type(value).__name__ in {"bool", "bool_"}:  # numpy has types of these names, too
        raise TypeError(f"expected a number, found {value!r}")
    return float(value)


def quaternion_from_rpy(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the rotation by roll, pitch and yaw about the fixed x, y, z axes, in rad."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def rpy_from_quaternion(rotation: Quaternion) -> Vector3:
    """Return roll, pitch and yaw of a rotation in rad; together they are exact, also at a pitch of 90 degrees."""
    x, y, z, w = rotation
    forward = rotate(rotation, (1.0, 0.0, 0.0))
    pitch = math.atan2(-forward[2], math.hypot(forward[0], forward[1]))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    # Turning yaw and pitch back leaves the roll, even near a pitch of 90 deg, where yaw and roll are hard to separate.
    rx, _, _, rw = multiply(conjugate(quaternion_from_rpy(0.0, pitch, yaw)), rotation)
    return (math.remainder(2 * math.atan2(rx, rw), 2 * math.pi), pitch, yaw)


def multiply(first: Quaternion, second: Quaternion) -> Quaternion:
    """Return the rotation that applies `second`, then `first`."""
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def rotate(rotation: Quaternion, vector: Vector3) -> Vector3:
    """Return the rotated vector."""
    qx, qy, qz, w = rotation
    vx, vy, vz = vector
    # v + w t + axis x t, where t = 2 axis x v.
    tx, ty, tz = cross((2 * qx, 2 * qy, 2 * qz), vector)
    ux, uy, uz = cross((qx, qy, qz), (tx, ty, tz))
    return (vx + w * tx + ux, vy + w * ty + uy, vz + w * tz + uz)


def cross(first: Vector3, second: Vector3) -> Vector3:
    """Return the vector product."""
    ax, ay, az = first
    bx, by, bz = second
    return (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


def dot(first: Vector3, second: Vector3) -> float:
    """Return the scalar product."""
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


def add(first: Vector3, second: Vector3) -> Vector3:
    """Return the sum."""
    return (first[0] + second[0], first[1] + second[1], first[2] + second[2])


def subtract(first: Vector3, second: Vector3) -> Vector3:
    """Return `first` less `second`."""
    return (first[0] - second[0], first[1] - second[1], first[2] - second[2])


def scale(vector: Vector3, factor: float) -> Vector3:
    """Return the vector times a factor."""
    return (vector[0] * factor, vector[1] * factor, vector[2] * factor)


def conjugate(rotation: Quaternion) -> Quaternion:
    """Return the inverse rotation."""
    x, y, z, w = rotation
    return (-x, -y, -z, w)


def compose(outer: Pose, inner: Pose) -> Pose:
    """Return the pose of `inner`, given in the frame `outer`, seen from the parent of `outer`."""
    ox, oy, oz = outer.position_xyz
    ix, iy, iz = rotate(outer.orientation_xyzw, inner.position_xyz)
    return Pose((ox + ix, oy + iy, oz + iz), multiply(outer.orientation_xyzw, inner.orientation_xyzw))


def inverse(pose: Pose) -> Pose:
    """Return the pose of the parent frame, seen from the frame that `pose` places in it."""
    back = conjugate(pose.orientation_xyzw)
    x, y, z = rotate(back, pose.position_xyz)
    return Pose((-x, -y, -z), back)


def twist_between(start: Pose, end: Pose, seconds: float) -> Twist:
    """Return the velocity that moves a frame from one pose to another on the short way; in the parent frame."""
    moved = [(to - at) / seconds for at, to in zip(start.position_xyz, end.position_xyz, strict=True)]
    qx, qy, qz, qw = multiply(end.orientation_xyzw, conjugate(start.orientation_xyzw))
    sine = math.hypot(qx, qy, qz)
    # A quaternion and its negative are the same rotation.
    rate = 2 * math.atan2(math.copysign(sine, qw), abs(qw)) / (sine * seconds) if sine * seconds else 0.0
    vx, vy, vz = moved
    return Twist((vx, vy, vz), (qx * rate, qy * rate, qz * rate))


def symmetric_eigenvalues(diagonal: Vector3, xy: float, xz: float, yz: float) -> Vector3:
    """Return the eigenvalues of a symmetric 3 x 3 matrix, in rising order; from rounding, the first two may swap.

    See O. K. Smith, Communications of the ACM 4(4), 1961.
    """
    xx, yy, zz = diagonal
    mean = (xx + yy + zz) / 3
    off = xy**2 + xz**2 + yz**2
    spread = math.sqrt(((xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2 * off) / 6)
    if spread == 0:
        return (mean, mean, mean)
    u, v, w = ((value - mean) / spread for value in (xx, yy, zz))
    p, q, r = xy / spread, xz / spread, yz / spread
    half_determinant = (u * (v * w - r * r) - p * (p * w - r * q) + q * (p * r - v * q)) / 2
    angle = math.acos(max(-1.0, min(1.0, half_determinant))) / 3
    largest = mean + 2 * spread * math.cos(angle)
    least = mean + 2 * spread * math.cos(angle + 2 * math.pi / 3)
    return (least, 3 * mean - largest - least, largest)


@dataclass(frozen=True, slots=True)
class Solid:
    """A solid of uniform density.

    Attributes:
        volume: its volume in m^3.
        moments: the moments of inertia of 1 kg about its centre, along its own axes, in m^2.
    """

    volume: float
    moments: Vector3


def box_solid(size_xyz: Vector3) -> Solid:
    """Return the solid box with these full sizes in m."""
    x, y, z = size_xyz
    return Solid(x * y * z, ((y * y + z * z) / 12, (x * x + z * z) / 12, (x * x + y * y) / 12))


def cylinder_solid(radius: float, height: float) -> Solid:
    """Return the solid cylinder about its z axis; sizes in m."""
    across = (3 * radius * radius + height * height) / 12
    return Solid(math.pi * radius * radius * height, (across, across, radius * radius / 2))


def ellipsoid_solid(radii_xyz: Vector3) -> Solid:
    """Return the solid ellipsoid with these radii in m; a sphere has three equal ones."""
    a, b, c = radii_xyz
    return Solid(4 / 3 * math.pi * a * b * c, ((b * b + c * c) / 5, (a * a + c * c) / 5, (a * a + b * b) / 5))


def convex_hull(ordered: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the corners of the convex hull of different points in ascending order, counter-clockwise."""
    return _half(ordered)[:-1] + _half(ordered[::-1])[:-1]


def _half(ordered: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    kept = list(ordered[:2])
    for point in ordered[2:]:
        x, y = point
        bx, by = kept[-1]
        while len(kept) > 1:
            ax, ay = kept[-2]
            if (bx - ax) * (y - ay) > (by - ay) * (x - ax):
                break
            kept.pop()
            bx, by = ax, ay
        kept.append(point)
    return kept

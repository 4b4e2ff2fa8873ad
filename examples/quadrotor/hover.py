"""Hover at a height: position -> acceleration -> tilt -> torques -> the thrusts of four rotors.

hover.c is the same controller in C. Both compute the same numbers, because they use only + - * / and square roots, in
the same order.
"""

from __future__ import annotations

import math

from sim_action import LinkWrench, Observation

Vector = tuple[float, float, float]

MASS = 1.2  # kg, with the rotors
INERTIA = (0.0134, 0.0134, 0.0176)  # kg m^2 about x, y, z
GRAVITY = 9.80665
# Rotor -> x and y in m, and the direction of its drag about z: neighbours turn in opposite directions.
ARM = 0.16
ROTORS = {
    "front_left_rotor": (ARM, ARM, -1.0),
    "rear_left_rotor": (-ARM, ARM, 1.0),
    "rear_right_rotor": (-ARM, -ARM, -1.0),
    "front_right_rotor": (ARM, -ARM, 1.0),
}
DRAG = 0.02  # N m per N of thrust
MAX_THRUST = 6.0  # N, of one rotor

POSITION, SPEED = 6.0, 4.5  # gains: m/s^2 per m and per m/s
MAX_ACCELERATION = 4.0
TILT, TURN = 120.0, 20.0  # gains: rad/s^2 per rad and per rad/s
HEADING, YAW_RATE = 10.0, 6.0


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


class Controller:
    """Holds the robot above the origin of the world, with its nose ahead."""

    def __init__(self, height: float = 1.0) -> None:
        self.target = (0.0, 0.0, height)

    def step(self, observation: Observation) -> tuple[LinkWrench, ...]:
        """Return the thrust of each rotor, and the drag of its propeller."""
        place, speed, spin = observation.pose.position_xyz, observation.twist.linear_xyz, observation.twist.angular_xyz
        x, y, z, w = observation.pose.orientation_xyzw
        # The axes of the body in the world.
        ahead = (1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w))
        left = (2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w))
        up = (2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y))

        wanted = [POSITION * (self.target[i] - place[i]) - SPEED * speed[i] for i in range(3)]
        ax, ay, az = (max(-MAX_ACCELERATION, min(MAX_ACCELERATION, each)) for each in wanted)
        force = (MASS * ax, MASS * ay, MASS * (az + GRAVITY))
        thrust = dot(force, up)

        # The rotation that turns the thrust into the wanted direction, about the axes of the body.
        size = math.sqrt(dot(force, force))
        tilt = cross(up, (force[0] / size, force[1] / size, force[2] / size))
        roll_torque = INERTIA[0] * (TILT * dot(tilt, ahead) - TURN * dot(spin, ahead))
        pitch_torque = INERTIA[1] * (TILT * dot(tilt, left) - TURN * dot(spin, left))
        yaw_torque = INERTIA[2] * (-HEADING * ahead[1] - YAW_RATE * dot(spin, up))

        answer = []
        for rotor, (rotor_x, rotor_y, direction) in ROTORS.items():
            lift = thrust / 4 + roll_torque * rotor_y / (4 * ARM * ARM) - pitch_torque * rotor_x / (4 * ARM * ARM)
            lift = max(0.0, min(MAX_THRUST, lift + direction * yaw_torque / (4 * DRAG)))
            answer.append(LinkWrench(rotor, (0.0, 0.0, lift), (0.0, 0.0, direction * DRAG * lift), frame=rotor))
        return tuple(answer)

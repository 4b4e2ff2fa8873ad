"""Turns to the left until its gyroscope has added up to a right angle, and drives on that way."""

import math

from sim_action import Observation, Twist

GOAL = math.radians(90)
PERIOD = 1 / 40

# What a script keeps from one call to the next: the angle so far, in rad.
turned = [0.0]


def control(observation: Observation) -> Twist:
    """The angle that is left is made up for at all times, and the robot drives when there is hardly any."""
    turned[0] += observation.sensors["imu"].angular_velocity_xyz[2] * PERIOD
    left = GOAL - turned[0]
    return Twist.planar(linear=0.2 if abs(left) < math.radians(3) else 0.0, angular=2 * left)

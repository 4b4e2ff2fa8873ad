"""Turn left until the integrated gyroscope shows a right angle, then drive in that direction."""

import math

from sim_action import Observation, Twist

GOAL = math.radians(90)
PERIOD = 1 / 40

# The angle so far in rad, kept from one call to the next.
turned = [0.0]


def control(observation: Observation) -> Twist:
    """Always correct the remaining angle; drive when it is small."""
    turned[0] += observation.sensors["imu"].angular_velocity_xyz[2] * PERIOD
    left = GOAL - turned[0]
    return Twist.planar(linear=0.2 if abs(left) < math.radians(3) else 0.0, angular=2 * left)

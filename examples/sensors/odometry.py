"""Drive a square of one metre, using only wheel odometry."""

import math

from sim_action import Observation, Twist

NEAR = 0.03

# The remaining corners, kept from one call to the next.
corners = [(1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)]


def control(observation: Observation) -> Twist:
    """Turn to the next corner and drive there."""
    pose = observation.sensors["odometry"].pose
    x, y, _ = pose.position_xyz
    if corners and math.dist(corners[0], (x, y)) < NEAR:
        corners.pop(0)
    if not corners:
        return Twist()
    to_x, to_y = corners[0]
    off = math.remainder(math.atan2(to_y - y, to_x - x) - pose.yaw, 2 * math.pi)
    return Twist.planar(linear=0.3 if abs(off) < math.radians(10) else 0.0, angular=max(-1.0, min(1.0, 2 * off)))

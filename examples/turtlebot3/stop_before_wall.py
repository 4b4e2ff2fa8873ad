"""Drive towards the wall, slow down near it, and stop half a metre before it."""

from sim_action import Observation, Twist

WALL = 2.95  # m, its near side
GAP = 0.5  # m
FRONT = 0.038  # m, from the origin of the burger to its front
TOP_SPEED = 0.5  # m/s
GAIN = 2.0  # 1/s


def control(observation: Observation) -> Twist:
    """Return a speed that is proportional to the remaining distance."""
    x, _, _ = observation.pose.position_xyz
    left = WALL - GAP - FRONT - x
    return Twist.planar(linear=max(0.0, min(TOP_SPEED, GAIN * left)))

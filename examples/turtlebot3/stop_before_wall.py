"""Drive towards the wall, slow down near it, and stop half a metre in front of it."""

from sim_action import Observation, Twist

WALL_FACE_X = 2.95  # m, x of the side of the wall that faces the robot
GAP = 0.5  # m, between the wall and the robot
FRONT = 0.038  # m, from the origin of the burger to its front
TOP_SPEED = 0.5  # m/s
GAIN = 2.0  # 1/s


def control(observation: Observation) -> Twist:
    """Return a speed that is proportional to the remaining distance."""
    x, _, _ = observation.pose.position_xyz
    remaining = WALL_FACE_X - GAP - FRONT - x
    return Twist.planar(linear=max(0.0, min(TOP_SPEED, GAIN * remaining)))

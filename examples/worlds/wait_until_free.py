"""Drive ahead while the way is free, and wait while it is not."""

from math import radians

from sim_action import Observation, Twist

FREE = 0.4  # m, the distance ahead that must be free
SPEED = 0.2  # m/s
AHEAD = radians(15)  # to the left and to the right of straight ahead


def control(observation: Observation) -> Twist:
    """Look at the 30 degrees ahead in the last scan."""
    scan = observation.sensors["scan"]
    return Twist.planar(SPEED if scan.nearest(-AHEAD, AHEAD) > FREE else 0.0)

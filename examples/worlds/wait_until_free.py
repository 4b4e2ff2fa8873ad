"""Drives ahead while nothing is in its way, and waits where something is."""

from math import radians

from sim_action import Observation, Twist

FREE = 0.4  # m
SPEED = 0.2  # m/s
AHEAD = radians(15)


def control(observation: Observation) -> Twist:
    """A third of a right angle of the last scan says whether the way is free."""
    scan = observation.sensors["scan"]
    return Twist.planar(SPEED if scan.nearest(-AHEAD, AHEAD) > FREE else 0.0)

"""Drives at the wall, slows down on the last metre, and stops half a metre before it."""

from sim_action import Observation, Twist

GOAL = 2.5
TOP_SPEED = 0.5


def control(observation: Observation) -> Twist:
    """The speed falls in proportion to what is left of the way."""
    x, _, _ = observation.pose.position_xyz
    return Twist.planar(linear=max(0.0, min(TOP_SPEED, GOAL - x)))

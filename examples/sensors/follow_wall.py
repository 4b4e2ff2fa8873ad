"""Follow the wall to the right, using only a lidar."""

from math import atan2, cos, pi, sin

from sim_action import Observation, Twist

DISTANCE = 0.5  # m, from the wall
TOP_SPEED = 0.3  # m/s
FAR = 1.5  # m; a wall farther away is not followed


def control(observation: Observation) -> Twist:
    """Steer by three ranges of the last scan: ahead, ahead to the right, to the right."""
    scan = observation.sensors["scan"]
    ahead = scan.nearest(-pi / 8, pi / 8)
    linear, angular = steer(ahead, scan.nearest(-pi / 4, -pi / 4), scan.nearest(-pi / 2, -pi / 2))
    return Twist.planar(linear, angular)


def steer(ahead: float, diagonal: float, beside: float) -> tuple[float, float]:
    """Return speed in m/s and turn rate in rad/s from ranges in m: ahead, 45 and 90 degrees to the right."""
    diagonal, beside = (max(0.0, min(FAR, distance)) for distance in (diagonal, beside))
    # The angle of the wall, which passes through the ends of two rays, to the left of the heading.
    wall = atan2(beside - diagonal * sin(pi / 4), diagonal * cos(pi / 4))
    too_near = DISTANCE - beside * cos(wall)
    turn = 2.0 * wall + 3.0 * too_near
    if ahead < 1.5 * DISTANCE:
        turn = 1.5
    return TOP_SPEED * max(0.2, min(1.0, ahead)), max(-1.5, min(1.5, turn))

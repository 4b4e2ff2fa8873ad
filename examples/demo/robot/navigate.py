"""Drive to the dock, keep away from obstacles, and stop for everything that is in the way."""

from math import atan2, hypot, pi, radians, remainder

from sim_action import Observation, Twist

DOCK = (4.0, 0.0)  # m, in the world frame
ARRIVED = 0.05  # m, distance from the dock at which the robot stops
TOP_SPEED = 0.5  # m/s
STOP = 0.45  # m from the lidar; nearer obstacles ahead stop the robot
BRAKE = 0.9  # m from the lidar; from here on, the robot slows down
NEAR = 0.8  # m from the lidar; nearer obstacles push the robot to the other side
AHEAD = radians(12)  # half the angle in which an obstacle is in the way
SIDE = radians(70)  # how far to each side obstacles are avoided


def control(observation: Observation) -> Twist:
    """Return the next command; sim-action calls this function ten times per second of sim time."""
    x, y, _ = observation.pose.position_xyz
    distance = hypot(DOCK[0] - x, DOCK[1] - y)
    if distance < ARRIVED:
        return Twist.planar()
    scan = observation.sensors["scan"]

    bearing = remainder(atan2(DOCK[1] - y, DOCK[0] - x) - observation.pose.yaw, 2 * pi)
    # Angles of a scan grow counter-clockwise: those to the left are positive.
    left, right = scan.nearest(0, SIDE), scan.nearest(-SIDE, 0)
    turn = 1.2 * bearing + push(right) - push(left)

    free = (scan.nearest(-AHEAD, AHEAD) - STOP) / (BRAKE - STOP)
    speed = min(TOP_SPEED * max(0.0, min(1.0, free)), distance)
    return Twist.planar(linear=speed, angular=max(-1.2, min(1.2, turn)) if speed > 0 else 0.0)


def push(distance: float) -> float:
    """Return the turn rate in rad/s with which an obstacle at a distance in m pushes the robot away."""
    return 2.5 * max(0.0, NEAR - distance) / NEAR

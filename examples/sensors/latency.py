"""Stop in front of a wall with late scans: each says how far the wall was, and when."""

from sim_action import Observation, Twist

STOP = 0.27  # m, from the lidar; the front of the robot is then 20 cm from the wall
TOP_SPEED = 0.5  # m/s
GAIN = 2.0  # 1/s
PERIOD = 1 / 40  # s, of its commands
LATENCY = 0.05  # s, of its commands

# The time and the speed of each command, kept from one call to the next.
commands: list[tuple[float, float]] = []


def control(observation: Observation) -> Twist:
    """Return a speed that is proportional to the distance that will be left after all commands on their way."""
    scan = observation.sensors["lidar"]
    since = PERIOD * sum(speed for time, speed in commands if time >= scan.time - LATENCY)
    remaining = float(scan.ranges.min()) - since - STOP
    speed = max(0.0, min(TOP_SPEED, GAIN * remaining))
    commands.append((observation.time, speed))
    return Twist.planar(speed)

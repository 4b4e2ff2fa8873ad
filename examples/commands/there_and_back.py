"""Drives to half a metre before the wall, and back; what it remembers is which of the two is next."""

from sim_action import Observation, RobotDescription, Twist

TURNING_POINT = 1.5
CLOSE = 0.02
TOP_SPEED = 0.5


class Controller:
    """The speed falls in proportion to what is left of the way."""

    def reset(self, robot: RobotDescription) -> None:
        """Called once, before the robot moves."""
        print(f"{robot.name} is asked {robot.rate:g} times a second")
        self.goals = [TURNING_POINT, 0.0]

    def step(self, observation: Observation) -> Twist:
        """Called at every tick."""
        x, _, _ = observation.pose.position_xyz
        if len(self.goals) > 1 and abs(self.goals[0] - x) < CLOSE:
            self.goals.pop(0)
        way = self.goals[0] - x
        return Twist.planar(linear=max(-TOP_SPEED, min(TOP_SPEED, way)))

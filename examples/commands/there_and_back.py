"""Drive to half a metre in front of the wall and back; the controller remembers which of the two is next."""

from sim_action import Observation, RobotDescription, Twist

WALL_FACE_X = 1.95  # m, x of the side of the wall that faces the robot
FRONT = 0.038  # m, from the origin of the burger to its front
TURNING_POINT = WALL_FACE_X - 0.5 - FRONT
CLOSE = 0.02  # m
TOP_SPEED = 0.5  # m/s


class Controller:
    """The speed is proportional to the remaining distance."""

    def reset(self, robot: RobotDescription) -> None:
        """Start; called once, before the robot moves."""
        print(f"{robot.name} is asked {robot.rate:g} times a second")
        self.goals = [TURNING_POINT, 0.0]

    def step(self, observation: Observation) -> Twist:
        """Return a command; called at every tick."""
        x, _, _ = observation.pose.position_xyz
        if len(self.goals) > 1 and abs(self.goals[0] - x) < CLOSE:
            self.goals.pop(0)
        remaining = self.goals[0] - x
        return Twist.planar(linear=max(-TOP_SPEED, min(TOP_SPEED, remaining)))

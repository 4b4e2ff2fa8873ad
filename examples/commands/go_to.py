"""Drive straight to a place in front of the robot; the scenario sets the place and the gain."""

from sim_action import Observation, Twist


class GoTo:
    """The speed is proportional to the remaining distance."""

    def __init__(self, goal: float, gain: float = 1.0, top_speed: float = 0.5) -> None:
        """Start with `goal`, the x to reach in m, `gain` in 1/s and `top_speed` in m/s."""
        self.goal, self.gain, self.top_speed = goal, gain, top_speed

    def step(self, observation: Observation) -> Twist:
        """Return a command; called at every tick."""
        x, _, _ = observation.pose.position_xyz
        speed = self.gain * (self.goal - x)
        return Twist.planar(linear=max(-self.top_speed, min(self.top_speed, speed)))

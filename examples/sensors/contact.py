"""Drives ahead until its bumper touches something, and backs off from there."""

from sim_action import Observation, Twist

# What a script keeps from one call to the next.
touched_at: list[float] = []


def control(observation: Observation) -> Twist:
    """Ahead, back for two seconds, and then it stands."""
    if observation.sensors["bumper"].touching:
        touched_at.append(observation.time)
    if not touched_at:
        return Twist.planar(0.2)
    return Twist.planar(-0.1 if observation.time < touched_at[0] + 2.0 else 0.0)

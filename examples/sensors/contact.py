"""Drive ahead until the bumper touches something, then back off by 20 cm."""

from sim_action import Observation, Twist

# The times of contact, kept from one call to the next.
touched_at: list[float] = []


def control(observation: Observation) -> Twist:
    """Drive ahead; after the first contact, drive back for two seconds, then stop."""
    if observation.sensors["bumper"].touching:
        touched_at.append(observation.time)
    if not touched_at:
        return Twist.planar(0.2)
    return Twist.planar(-0.1 if observation.time < touched_at[0] + 2.0 else 0.0)

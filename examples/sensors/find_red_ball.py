"""Turn until something red is in view, drive towards its middle, and stop half a metre in front of it."""

import numpy as np

from sim_action import Observation, Twist

STOP = 0.5


def control(observation: Observation) -> Twist:
    """Use the depth as the distance of the ball, and the column of its middle as its direction."""
    eye = observation.sensors["eye"]
    # Twice a byte can overflow a byte.
    red, green, _ = np.moveaxis(eye.rgb.astype(int), 2, 0)
    rows, columns = np.nonzero(red > 2 * green)
    if len(columns) == 0:
        return Twist.planar(angular=0.5)
    to_the_left = 0.5 - (columns.mean() + 0.5) / eye.rgb.shape[1]
    too_far = eye.depth[rows, columns].min() - STOP
    return Twist.planar(linear=max(0.0, min(0.3, too_far)), angular=1.5 * to_the_left)

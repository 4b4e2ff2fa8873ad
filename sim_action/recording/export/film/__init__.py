"""Films of a run by `rendering`: a camera that follows the robot, the time in a corner. The same on every machine."""

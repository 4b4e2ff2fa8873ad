"""MJCF, the format of MuJoCo: its files, its parts, and the robot model that they make."""

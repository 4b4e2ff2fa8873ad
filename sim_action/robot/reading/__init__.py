"""The formats of robot models: URDF, xacro, SDF, MJCF and SRDF, each read into a `RobotModel`."""

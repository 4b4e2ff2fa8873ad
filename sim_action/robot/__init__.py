"""Robot description files (URDF, xacro, SDF, MJCF) -> `RobotModel`, one clean model for every engine.

`loading.py` is the entry point. `audit/` checks a model, `sdf/` converts SDF to URDF.
"""

"""Robot description files (URDF, xacro, SDF, MJCF) -> `RobotModel`, one clean model for every engine.

Four floors, each of which imports only those below it. `reading` reads the formats; `reading/loading.py` is the entry
point. `audit` checks elements and drafts. `documents` finds and parses files. `model` is the data.
"""

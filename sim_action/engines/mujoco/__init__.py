"""The MuJoCo engine: `engine.py` holds `MuJoCoEngine`, which steps the simulation."""

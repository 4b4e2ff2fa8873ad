"""The PyBullet engine: `engine.py` holds `PyBulletEngine`, which steps the simulation."""

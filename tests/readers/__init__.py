"""Drawn URDFs, and how six readers understand them: ours, MuJoCo, PyBullet, Drake, Pinocchio and urchin."""

"""A golden trajectory as a replay, so that it can be a ghost.

The file has the position and heading of the base link and perhaps some joints. So the robot is drawn level, and its
other joints are where they were at the start of the run.
"""

from __future__ import annotations

import numpy as np

from sim_action.recording.replay.columns import Column
from sim_action.recording.replay.golden import GoldenData
from sim_action.recording.replay.replay_data import Frames, Replay

_QUATERNION_SCALE = 1e-5


def golden_replay(replay: Replay, golden: GoldenData) -> Replay:
    """Return the motion of a golden trajectory for the robot of a run."""
    count = golden.count
    x, y, z, yaw = golden.base
    half = yaw.decoded(count) / 2
    turned, upright = (Column.encoded(part(half), _QUATERNION_SCALE) for part in (np.sin, np.cos))
    level = Column(scale=1.0, first=0)
    unknown = Column(scale=1.0, first=0, gaps=((0, count),))
    known = dict(golden.joints)
    frames = Frames(
        time=golden.time,
        base=(x, y, z, level, level, turned, upright),
        joints=tuple(
            known.get(number, column.model_copy(update={"deltas": (), "gaps": ()}))
            for number, column in enumerate(replay.frames.joints)
        ),
        speed=unknown,
        tilt=unknown,
    )
    # Nothing is known of the bodies.
    scene = replay.scene.model_copy(update={"bodies": ()})
    return Replay.model_construct(version=replay.version, scene=scene, joint_names=replay.joint_names, frames=frames)

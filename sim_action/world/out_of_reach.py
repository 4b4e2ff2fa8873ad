"""Bodies and patches that a robot did not come near to in a run, for the audit of claims."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from sim_action.core import geometry
from sim_action.world.body import Body, placed
from sim_action.world.ground import Patch
from sim_action.world.parts import lowest, reach
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.trace import Trace

# m: a robot that came so near to an object has passed it.
_PASSED_M: Final = 0.5
# m: a robot that came nearer by less has not passed anything.
_DRIVEN_M: Final = 0.1
# m: the stored trace has gaps.
_SLACK_M: Final = 0.05
_UPSIDE_DOWN_XYZW: Final = (1.0, 0.0, 0.0, 0.0)


def passed_by(scene: Scene, trace: Trace, body: Body) -> bool:
    """Return True if the robot came near to the initial place of a body, on the ground."""
    parts = scene.parts_of(body)
    x, y, _ = placed(body, parts).position_xyz
    near = scene.extent + max(map(reach, parts)) + _PASSED_M
    away = trace.planar_distance_to(x, y)
    return bool(away.min() <= near and away.max() - away.min() > _DRIVEN_M)


def is_out_of_reach(scene: Scene, trace: Trace, body: Body) -> bool:
    """Return True if a fixed body was always below the ground and the robot, or always above the robot."""
    if body.mass is not None or body.path or not len(trace):
        return False
    parts = scene.parts_of(body)
    _, _, z = (pose := placed(body, parts)).position_xyz
    bottom = z + lowest(parts, pose.orientation_xyzw)
    top = z - lowest(parts, geometry.multiply(_UPSIDE_DOWN_XYZW, pose.orientation_xyzw))
    heights, extent = trace.base_position_xyz[:, 2], _stretched(scene)
    # A robot that falls below the ground may touch what is there.
    return top < min(0.0, float(heights.min()) + _SLACK_M) or bottom > float(heights.max()) + extent


def is_untouched(scene: Scene, trace: Trace, patch: Patch) -> bool:
    """Return True if the robot was never above a patch of the ground."""
    away = (
        abs(trace.base_position_xyz[:, axis] - (low + high) / 2) - (high - low) / 2
        for axis, (low, high) in enumerate(patch.bounds)
    )
    x, y = away
    extent = _stretched(scene)
    return bool(((x > extent) | (y > extent)).all())


def _stretched(scene: Scene) -> float:
    """Return the extent of the robot in m with all links of its arms in a line."""
    joints = (joint for joint in scene.model.moving_joints if joint.type != "continuous")
    return scene.extent + sum(math.hypot(*joint.origin.position_xyz) for joint in joints) + _SLACK_M

"""The space that a robot at its start and objects take, as boxes along the axes of the world."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Box, Pose, compose, multiply, quaternion_from_rpy
from sim_action.robot.model.kinematics import link_poses, shape_box
from sim_action.runner.mutation.mutant import Original
from sim_action.world import Body
from sim_action.world.body import placed
from sim_action.world.parts import lowest

if TYPE_CHECKING:
    from sim_action.world.parts import Part

LEAST_MOVE_M: Final = 0.02
"""Objects move at least this far."""

# Boxes that are nearer than this in m count as touching.
_GAP_M: Final = 0.02


def robot_boxes(original: Original) -> list[Box]:
    """Return a box around each collision shape of the robot at its start, in the world frame."""
    model, trace = original.loaded.model, original.trace
    if model is None:
        return []
    x, y, z = trace.base_position_xyz[0].tolist()
    i, j, k, w = trace.base_orientation_xyzw[0].tolist()
    base = Pose((x, y, z), (i, j, k, w))
    positions = dict(zip(trace.joint_names, trace.joint_position[0].tolist(), strict=True))
    frames = link_poses(model, positions)
    placed_shapes = [(compose(base, frames[link.name]), shape) for link in model.links for shape in link.collisions]
    return [shape_box(compose(frame, shape.pose), shape) for frame, shape in placed_shapes]


def body_box(original: Original, body: Body) -> Box:
    """Return the box around an object at its initial place, in the world frame."""
    parts, at = parts_of(original, body), body.beginning
    x, y, z = placed(body, parts).position_xyz
    upside_down = multiply(quaternion_from_rpy(math.pi, 0.0, 0.0), at.orientation_xyzw)
    lower = (x - extent(parts, at, -1.0, 0.0), y - extent(parts, at, 0.0, -1.0), z + lowest(parts, at.orientation_xyzw))
    upper = (x + extent(parts, at, 1.0, 0.0), y + extent(parts, at, 0.0, 1.0), z - lowest(parts, upside_down))
    return lower, upper


def free_place(original: Original, body: Body, way: tuple[float, float], most: float) -> tuple[float, float] | None:
    """Return the farthest place on a way, in m, at which an object does not touch an arm at its start."""
    taken = robot_boxes(original)
    for shift in (most, most / 2, most / 4):
        x, y = body.pose.x + shift * way[0], body.pose.y + shift * way[1]
        there = body.model_copy(update={"pose": body.pose.model_copy(update={"x": x, "y": y})})
        if shift >= LEAST_MOVE_M and not touches(body_box(original, there), taken):
            return x, y
    return None


def parts_of(original: Original, body: Body) -> Sequence[Part]:
    """Return the parts of an object of the scenario, or of one that a mutant adds."""
    return original.loaded.parts[body.name] if body.is_read else body.parts()


def extent(parts: Sequence[Part], place: Placement, x: float, y: float) -> float:
    """Return how far parts reach from their frame in a direction on the ground plane, in m."""
    down = multiply(quaternion_from_rpy(0.0, math.pi / 2, 0.0), quaternion_from_rpy(0.0, 0.0, -math.atan2(y, x)))
    return max(0.0, -lowest(parts, multiply(down, place.orientation_xyzw)))


def touches(box: Box, others: Iterable[Box]) -> bool:
    """Return True if a box touches another one, or nearly does."""
    return any(_touch(box, other) for other in others)


def _touch(box: Box, other: Box) -> bool:
    (lower, upper), (least, most) = box, other
    return all(lower[axis] < most[axis] + _GAP_M and least[axis] < upper[axis] + _GAP_M for axis in range(3))

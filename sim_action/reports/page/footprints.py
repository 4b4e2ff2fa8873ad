"""Where a replay's solids stand, seen from above: convex outlines on the ground plane."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.recording.replay.models import JointMotion, Replay
from sim_action.recording.replay.shapes import (
    BoxShape,
    CapsuleShape,
    CylinderShape,
    EllipsoidShape,
    MeshData,
    MeshShape,
)

FloatArray = NDArray[np.float64]
Shape = BoxShape | CylinderShape | EllipsoidShape | CapsuleShape | MeshShape

_ROUND: Final = 16
_MOST_POINTS: Final = 500


@dataclass(frozen=True, eq=False)
class Frame:
    """Where a frame is: rotation (3, 3) and position (3,) in m, seen from its parent or the world."""

    rotation: FloatArray
    position: FloatArray

    @classmethod
    def of(cls, numbers: Iterable[float]) -> Frame:
        """From x, y, z and a quaternion x, y, z, w, of whatever length."""
        px, py, pz, *quaternion = numbers
        x, y, z, w = np.array(quaternion) / (math.hypot(*quaternion) or 1.0)
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        return cls(np.array(rows), np.array([px, py, pz]))

    def after(self, other: Frame) -> Frame:
        """This frame, given in the other one, as that one's parent sees it."""
        return Frame(other.rotation @ self.rotation, other.rotation @ self.position + other.position)

    def place(self, points: FloatArray) -> FloatArray:
        """Points (N, 3) of this frame, as its parent sees them."""
        return points @ self.rotation.T + self.position


def robot_outlines(replay: Replay, moment: int) -> list[FloatArray]:
    """Of each shape of the robot at one of its moments: (N, 2) in m, world frame."""
    frames = _link_frames(replay, moment)
    solids = ((shape, frame) for link, frame in zip(replay.scene.links, frames, strict=True) for shape in link.shapes)
    return [outline(shape, frame, replay.scene.meshes) for shape, frame in solids]


def outline(shape: Shape, owner: Frame, meshes: dict[str, MeshData]) -> FloatArray:
    """Of one shape of what stands at `owner`: the corners of its hull, seen from above."""
    points = Frame.of(shape.pose).after(owner).place(_points(shape, meshes))
    return _hull(points[:, :2])


def _link_frames(replay: Replay, moment: int) -> list[Frame]:
    count = replay.frames.count
    joints = [float(column.decoded(count)[moment]) for column in replay.frames.joints]
    found = [Frame.of(float(column.decoded(count)[moment]) for column in replay.frames.base)]
    for link in replay.scene.links[1:]:
        assert link.parent is not None
        own = Frame.of(link.origin)
        if link.joint is not None:
            own = _motion(link.joint, joints[link.joint.column]).after(own)
        found.append(own.after(found[link.parent]))
    return found


def _motion(joint: JointMotion, value: float) -> Frame:
    moved = joint.multiplier * value + joint.offset
    axis = np.array(joint.axis)
    if joint.type == "prismatic":
        return Frame(np.eye(3), axis * moved)
    return Frame.of((0.0, 0.0, 0.0, *(axis * math.sin(moved / 2)), math.cos(moved / 2)))


def _points(shape: Shape, meshes: dict[str, MeshData]) -> FloatArray:
    """Points (N, 3) in the frame of the shape, whose hull is near enough its own."""
    match shape:
        case BoxShape():
            signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            return np.asarray(signs * np.array(shape.size) / 2)
        case EllipsoidShape():
            return np.asarray(_ball() * np.array(shape.half))
        case CapsuleShape():
            caps = [_ball() * shape.radius + np.array([0, 0, end * shape.length / 2]) for end in (-1, 1)]
            return np.concatenate(caps)
        case CylinderShape():
            return np.concatenate([_ring(shape.radius, end * shape.length / 2) for end in (-1, 1)])
        case MeshShape():
            mesh = meshes[shape.mesh]
            points = np.asarray(mesh.decoded()[0] * mesh.scale, dtype=np.float64)
            return points[:: max(1, len(points) // _MOST_POINTS)]


def _ring(radius: float, height: float) -> FloatArray:
    angles = np.linspace(0, 2 * math.pi, _ROUND, endpoint=False)
    return np.column_stack((radius * np.cos(angles), radius * np.sin(angles), np.full(_ROUND, height)))


def _ball() -> FloatArray:
    heights = np.linspace(-1, 1, 7)
    return np.concatenate([_ring(math.sqrt(1 - height**2), height) for height in heights])


def _hull(points: FloatArray) -> FloatArray:
    """Corners of the convex hull of points (N, 2), against the clock."""
    ordered = sorted({(round(float(x), 4), round(float(y), 4)) for x, y in points})
    if len(ordered) < 3:
        return np.array(ordered)
    return np.array(_half(ordered)[:-1] + _half(ordered[::-1])[:-1])


def _half(ordered: list[tuple[float, float]]) -> list[tuple[float, float]]:
    kept: list[tuple[float, float]] = []
    for x, y in ordered:
        while len(kept) > 1:
            (ax, ay), (bx, by) = kept[-2:]
            if (bx - ax) * (y - ay) > (by - ay) * (x - ax):
                break
            kept.pop()
        kept.append((x, y))
    return kept

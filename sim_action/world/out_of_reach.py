"""Bodies and patches that a robot did not come near to in a run, for the audit of claims."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from sim_action.core import geometry
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.wording import quoted
from sim_action.state.timeline import TimeMark
from sim_action.state.trace import Trace
from sim_action.world.body import Body, placed
from sim_action.world.claims import ClaimFinding, Findings, JudgedRun
from sim_action.world.ground import Patch
from sim_action.world.parts import lowest, reach
from sim_action.world.scene import Scene

_PASSED_M: Final = 0.5  # m: a robot that came so near to an object has passed it
_DRIVEN_M: Final = 0.1  # m: a robot that came nearer by less has not passed anything
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


def out_of_reach(run: JudgedRun, bodies: Sequence[Body], distance: float = 0.0) -> Findings:
    """Yield the finding that no robot comes within a distance in m of some bodies: they are too low, or too high."""
    if run.verdict.passed and bodies and all(_is_out_of_reach(run, body, distance) for body in bodies):
        names = quoted([body.name for body in bodies])
        message = f"{names} is below the ground, or above the robot, so the robot cannot come near"
        yield ClaimFinding("nothing-to-touch", (), f"{message}; check 'z' of its pose")


def _is_out_of_reach(run: JudgedRun, body: Body, distance: float) -> bool:
    if body.mass is not None or body.path or not len(run.trace):
        return False
    bottom, top = _heights(run.scene, body)
    heights, extent = run.trace.base_position_xyz[:, 2], _stretched(run.scene)
    low, high = float(heights.min()), float(heights.max())
    # A robot that falls below the ground may touch what is there, one that flies may touch what is above it.
    if top + distance < min(0.0, low + _SLACK_M):
        return True
    return bottom > high + extent + distance and low <= extent and high - low <= _DRIVEN_M


def _heights(scene: Scene, body: Body) -> tuple[float, float]:
    """Return the z of the lowest and of the highest point of a body in m, where it starts."""
    parts = scene.parts_of(body)
    _, _, z = (pose := placed(body, parts)).position_xyz
    upside_down = geometry.multiply(_UPSIDE_DOWN_XYZW, pose.orientation_xyzw)
    return z + lowest(parts, pose.orientation_xyzw), z - lowest(parts, upside_down)


def is_untouched(scene: Scene, trace: Trace, patch: Patch) -> bool:
    """Return True if neither the robot nor an object that stays in its place was above a patch after it appeared."""
    for body in scene.world.objects:
        parts = scene.parts_of(body)
        place = np.array([placed(body, parts).position_xyz])
        if body.mass is not None and not _is_off(patch, place, max(map(reach, parts))):
            return False
    return _is_off(patch, trace.base_position_xyz[trace.time >= (patch.appears or 0.0)], _stretched(scene))


def reached_patches(scene: Scene, trace: Trace) -> Iterator[TimeMark]:
    """Yield the marks of the timeline at which the robot first came to a patch, within its extent."""
    for patch in scene.world.patches:
        near = ~_are_off(patch, trace.base_position_xyz, scene.extent) & (trace.time >= (patch.appears or 0.0))
        if near.any():
            time = float(trace.time[near.argmax()])
            yield TimeMark(time, time, f"reached {patch.words}")


def _is_off(patch: Patch, places: FloatArray, extent: float) -> bool:
    """Return True if a circle with a radius of `extent` in m about each of the places is off a patch."""
    return bool(_are_off(patch, places, extent).all())


def _are_off(patch: Patch, places: FloatArray, extent: float) -> NDArray[np.bool_]:
    """Return True for each place whose circle with a radius of `extent` in m is off a patch."""
    low, high = np.transpose(patch.bounds)
    off: NDArray[np.bool_] = ((places[:, :2] < low - extent) | (places[:, :2] > high + extent)).any(axis=1)
    return off


def _stretched(scene: Scene) -> float:
    """Return the extent of the robot in m with all links of its arms in a line."""
    joints = (joint for joint in scene.model.moving_joints if joint.type != "continuous")
    return scene.extent + sum(math.hypot(*joint.origin.position_xyz) for joint in joints) + _SLACK_M

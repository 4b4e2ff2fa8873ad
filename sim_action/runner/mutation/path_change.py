"""The difference between the motion of a mutant and that of its original, for mutants that nothing noticed."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Final

import numpy as np

from sim_action.core import units
from sim_action.core.units import TIME_EPSILON_S
from sim_action.results.proof import PathChange
from sim_action.state.trace import Trace, rotation_angles

LEAST_DISTANCE_M: Final = 0.1
LEAST_ANGLE: Final = math.radians(5)
"""The smallest changes that count: of the base in m and in rad, and of the joints of a base that stays, in rad or m."""

# Rounding must not decide which of two equal changes is told.
_DIGITS: Final = 6


def path_change(original: Trace, mutant: Trace, sliding: Collection[str] = ()) -> PathChange | None:
    """Return the greatest change of the motion at equal times, and at the end; None if none is large enough.

    `sliding`: the joints whose positions are in m, not in rad.
    """
    ours, theirs = _pairs(original, mutant)
    apart = mutant.base_position_xyz[theirs] - original.base_position_xyz[ours]
    distances = np.linalg.norm(apart, axis=1).round(_DIGITS)
    angles = rotation_angles(original.base_orientation_xyzw[ours], mutant.base_orientation_xyzw[theirs]).round(_DIGITS)
    row = int(np.argmax(distances))
    if distances[row] >= LEAST_DISTANCE_M:
        forward = float(original.yaw[ours[row]])
        words = f"the robot was {_where(apart[row].tolist(), forward)}{_when(mutant, theirs, row)}"
        return PathChange(text=words, distance=float(distances[row]), angle=float(angles.max()))
    row = int(np.argmax(angles))
    if angles[row] >= LEAST_ANGLE:
        words = f"the robot was turned by {units.display(float(angles[row]), 'rad')} more{_when(mutant, theirs, row)}"
        return PathChange(text=words, distance=float(distances.max()), angle=float(angles[row]))
    return _joint_change(original, mutant, ours, theirs, sliding)


def _joint_change(
    original: Trace,
    mutant: Trace,
    ours: np.ndarray[tuple[int], np.dtype[np.intp]],
    theirs: np.ndarray[tuple[int], np.dtype[np.intp]],
    sliding: Collection[str],
) -> PathChange | None:
    """Return the greatest change of a joint of a base that stays where it is; wheels of others turn anyhow."""
    travel = np.linalg.norm(np.ptp(original.base_position_xyz, axis=0))
    if not original.joint_names or travel >= LEAST_DISTANCE_M:
        return None
    changes = np.abs(mutant.joint_position[theirs] - original.joint_position[ours]).round(_DIGITS)
    row, column = (int(index) for index in np.unravel_index(int(np.argmax(changes)), changes.shape))
    change = float(changes[row, column])
    if change < LEAST_ANGLE:
        return None
    joint = original.joint_names[column]
    apart = units.display(change, "m" if joint in sliding else "rad")
    words = f"joint '{joint}' was {apart} elsewhere{_when(mutant, theirs, row)}"
    return PathChange(text=words, distance=0.0, angle=0.0, joint=joint, joint_change=change)


def _pairs(
    original: Trace, mutant: Trace
) -> tuple[np.ndarray[tuple[int], np.dtype[np.intp]], np.ndarray[tuple[int], np.dtype[np.intp]]]:
    """Return the rows of both traces at equal times, and at last those of both ends."""
    ends = min(original.time[-1], mutant.time[-1]) + TIME_EPSILON_S
    ours = np.flatnonzero(original.time <= ends)
    theirs = np.searchsorted(mutant.time, original.time[ours] + TIME_EPSILON_S, side="right") - 1
    return np.append(ours, len(original) - 1), np.append(np.maximum(theirs, 0), len(mutant) - 1)


def _when(mutant: Trace, theirs: np.ndarray[tuple[int], np.dtype[np.intp]], row: int) -> str:
    return " at the end" if row == len(theirs) - 1 else f" at {float(mutant.time[theirs[row]]):.2f} s"


def _where(apart_xyz: list[float], forward: float) -> str:
    """Return the way from one place to another in words, such as "0.8 m further left", by its greatest component.

    `forward`: the yaw of the robot in rad.
    """
    x, y, z = apart_xyz
    ahead = math.cos(forward) * x + math.sin(forward) * y
    left = math.cos(forward) * y - math.sin(forward) * x
    amounts = {"further ahead": ahead, "behind": -ahead, "further left": left, "further right": -left}
    amounts |= {"higher": z, "lower": -z}
    return f"{math.hypot(x, y, z):.2f} m {max(amounts, key=lambda word: amounts[word])}"

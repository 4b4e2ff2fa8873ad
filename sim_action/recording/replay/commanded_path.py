"""The path that the commands ask for: through the waypoints, or where the commanded twists would lead."""

from __future__ import annotations

from typing import Final

import numpy as np

from sim_action.commands.waypoints import WaypointCommands
from sim_action.recording.replay.columns import FloatArray
from sim_action.recording.replay.shapes import MAX_ABS_VALUE, Place, numbers
from sim_action.scenario.model import Scenario
from sim_action.simulation.recorder import TWIST_NAMES
from sim_action.state.observation import Observation
from sim_action.state.trace_records import CommandedValues

MAX_PATH_POINTS: Final = 1_000


def commanded_path(
    scenario: Scenario, start: Observation, twists: CommandedValues | None, time: FloatArray
) -> tuple[Place, ...]:
    """Return the commanded path of the base; empty if no twists were commanded.

    `start` is the settled state at t = 0, `twists` are in the frame of the base, `time` has the moments (T,) in s.
    """
    if twists is None or len(time) < 2:
        return ()
    waypoints = [
        point for source in scenario.commands if isinstance(source, WaypointCommands) for point in source.waypoints
    ]
    if waypoints:
        x, y, _ = start.pose.position_xyz
        points = np.array([(x, y), *((point.x, point.y) for point in waypoints)])
    else:
        points = _led(start, twists, time)
    # The first call of np.unique would take 10 ms: it imports masked arrays.
    kept = points[np.linspace(0, len(points) - 1, min(len(points), MAX_PATH_POINTS)).round().astype(np.intp)]
    if not np.isfinite(kept).all() or np.abs(kept).max() > MAX_ABS_VALUE:
        return ()
    height = numbers(start.pose.position_xyz)[2]
    return tuple((round(x, 5), round(y, 5), height) for x, y in kept.tolist())


def _led(start: Observation, twists: CommandedValues, time: FloatArray) -> FloatArray:
    """Return the points (T, 2) to which the twists lead without slip and delay, on level ground."""
    ahead, left, turn = (np.nan_to_num(twists.at(TWIST_NAMES[place], time[:-1])) for place in (0, 1, 5))
    step = np.diff(time)
    yaw = start.pose.yaw + np.concatenate(([0.0], np.cumsum(turn * step)))
    # The heading half way is exact to second order.
    half = (yaw[1:] + yaw[:-1]) / 2
    moved = np.column_stack((ahead * np.cos(half) - left * np.sin(half), ahead * np.sin(half) + left * np.cos(half)))
    x, y, _ = start.pose.position_xyz
    led: FloatArray = np.vstack((np.zeros(2), np.cumsum(moved * step[:, None], axis=0))) + np.array((x, y))
    return led

"""The path that commands ask for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_action.assertions.upright import Upright
from sim_action.commands.waypoints import Waypoint, WaypointCommands
from sim_action.recording.replay.build import MAX_PATH_POINTS, commanded_path
from sim_action.simulation.recorder import TWIST_NAMES
from sim_action.state.trace_records import CommandedValues
from tests.outcomes import like
from tests.traces import START, expectation, scenario

DRIVE = scenario(expectation(Upright()))
TIME = np.linspace(0.0, 2.0, 61)


def twists(*told: tuple[float, float, float]) -> CommandedValues:
    """Times in s with the commanded speed ahead and turn rate."""
    return CommandedValues.of([(time, {TWIST_NAMES[0]: ahead, TWIST_NAMES[5]: turn}) for time, ahead, turn in told])


def test_twists_lead_along_an_arc() -> None:
    # Half a circle of 1 m/s in 1 s, then standstill.
    path = commanded_path(DRIVE, START, twists((0.0, 1.0, math.pi), (1.0, 0.0, 0.0)), TIME)
    x, y, _ = START.pose.position_xyz
    assert path[0][:2] == pytest.approx((x, y))
    assert path[-1][:2] == pytest.approx((x, y + 2 / math.pi), abs=1e-3)
    assert path[-1] == path[-20]


def test_waypoints_are_the_path() -> None:
    drives = WaypointCommands(waypoints=(Waypoint(x=1.0, y=0.0), Waypoint(x=1.0, y=2.0)))
    path = commanded_path(like(DRIVE, commands=(drives,)), START, twists((0.0, 1.0, 0.0)), TIME)
    assert [point[:2] for point in path[1:]] == [(1.0, 0.0), (1.0, 2.0)]


def test_a_long_path_has_fewer_points() -> None:
    path = commanded_path(DRIVE, START, twists((0.0, 1.0, 0.1)), np.linspace(0.0, 600.0, 18_001))
    assert len(path) == MAX_PATH_POINTS


def test_without_twists_there_is_no_path() -> None:
    assert commanded_path(DRIVE, START, None, TIME) == ()
    assert commanded_path(DRIVE, START, twists((0.0, 1e300, 0.0)), TIME) == ()

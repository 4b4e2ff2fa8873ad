"""How near the robot came to bodies."""

from __future__ import annotations

from dataclasses import replace

from sim_action.assertions.monitors.proximity import nearest_of
from sim_action.state.trace_channels import ClearanceWatch
from sim_action.state.trace_records import ClearanceRecord, Nearness
from tests.traces import trace

WALL = ClearanceWatch(bodies=("wall",))
FAR, NEAR = Nearness(1.0, 2.0, "base_scan", "wall"), Nearness(2.0, 0.5, "base_scan", "wall")


def test_the_least_of_what_was_and_what_comes_is_kept() -> None:
    told = replace(trace([1.0, 2.0]), clearances={WALL: ClearanceRecord.of([FAR, NEAR])})
    assert nearest_of(told, WALL, None) == NEAR
    nearer = Nearness(0.5, 0.25, "base_scan", "wall")
    assert nearest_of(told, WALL, nearer) == nearer


def test_what_is_not_told_changes_nothing() -> None:
    nothing = replace(trace([1.0]), clearances={WALL: ClearanceRecord.of([])})
    assert nearest_of(nothing, WALL, FAR) == FAR
    assert nearest_of(trace([1.0]), WALL, FAR) == FAR
    assert nearest_of(nothing, None, None) is None

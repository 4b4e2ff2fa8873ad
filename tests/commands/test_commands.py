from __future__ import annotations

import pickle

import pytest

from sim_action.commands import COMMANDS, CommandSource
from sim_action.commands.external_program import ProcessCommands
from sim_action.commands.script import ScriptCommands
from sim_action.commands.twist import TwistCommands, TwistSegment
from sim_action.commands.waypoints import Waypoint, WaypointCommands
from tests.traces import HERE


def test_the_table_holds_what_a_scenario_can_say() -> None:
    written = ["twist", "waypoints", "joints", "pose", "wrench"]
    assert list(COMMANDS) == [*written, "script", "process", "policy", "replay", "ros1", "ros2"]


@pytest.mark.parametrize(
    "spec",
    [
        TwistCommands(twist=(TwistSegment(linear=1.0),)),
        WaypointCommands(waypoints=(Waypoint(x=1.0, y=0.0),)),
        ScriptCommands(script="a.py"),
        ProcessCommands(process=("node", "a.js")),
    ],
)
def test_specs_survive_pickling(spec: CommandSource) -> None:
    assert pickle.loads(pickle.dumps(spec)) == spec


def test_a_source_without_files_has_no_problems_with_them() -> None:
    assert list(TwistCommands(twist=(TwistSegment(),)).problems(HERE)) == []

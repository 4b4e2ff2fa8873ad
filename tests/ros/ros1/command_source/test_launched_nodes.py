"""Events of a launcher, as they arrive."""

from __future__ import annotations

import json
from pathlib import Path

from sim_action.ros.launches import EventFile
from sim_action.ros.ros1.command_source.launched_nodes import Event


def told(path: Path, text: str) -> None:
    with path.open("a") as file:
        file.write(text)


def test_who_has_ended_well_is_told_from_who_has_not(tmp_path: Path) -> None:
    events = EventFile(tmp_path / "events", Event)
    for code, required in ((0, False), (0, True), (1, False), (-11, False), (None, False)):
        told(tmp_path / "events", json.dumps({"event": "died", "exit_code": code, "required": required}) + "\n")

    assert [event.is_failure for event in events.new()] == [False, True, True, True, True]
    events.close()


def test_arguments_with_an_open_quote_are_words() -> None:
    left_out = ("gazebo_ros/gzserver",), ("-e 'ode /a/yard.world",)
    event = Event(event="read", left_out=left_out[0], left_out_args=left_out[1], world="empty.world")
    (message,) = event.losses
    assert message.startswith("the world 'yard.world' of the launch file is not simulated")

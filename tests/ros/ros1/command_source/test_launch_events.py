"""Events of a launcher, as they arrive."""

from __future__ import annotations

import json
from pathlib import Path

from sim_action.ros.ros1.command_source.launch_events import Events


def told(path: Path, text: str) -> None:
    with path.open("a") as file:
        file.write(text)


def test_events_are_read_once_and_when_they_are_whole(tmp_path: Path) -> None:
    events = Events(tmp_path / "events")
    line = json.dumps({"event": "started", "pid": 7}) + "\n"

    assert events.new() == []
    told(tmp_path / "events", line + line[:10])
    assert [event.pid for event in events.new()] == [7]
    told(tmp_path / "events", line[10:])
    assert [event.event for event in events.new()] == ["started"]
    assert events.new() == []
    events.close()


def test_who_has_ended_well_is_told_from_who_has_not(tmp_path: Path) -> None:
    events = Events(tmp_path / "events")
    for code, required in ((0, False), (0, True), (1, False), (-11, False), (None, False)):
        told(tmp_path / "events", json.dumps({"event": "died", "exit_code": code, "required": required}) + "\n")

    assert [event.is_failure for event in events.new()] == [False, True, True, True, True]
    events.close()

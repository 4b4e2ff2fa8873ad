"""The events of a launcher, read while it writes them."""

from __future__ import annotations

from pathlib import Path

from sim_action.ros.ros2.launch.launch_events import Event, Events


def test_an_event_is_read_once_its_line_is_complete(tmp_path: Path) -> None:
    events = Events(tmp_path / "events")
    with (tmp_path / "events").open("ab", buffering=0) as file:
        assert events.new() == []
        file.write(b'{"event": "calm", "time": 0.5, "pid": 7}\n{"event": "refused", "places": [["a.py", ')
        assert events.new() == [Event(event="calm", time=0.5, pid=7)]
        file.write(b"3]]}\n")
        assert events.new() == [Event(event="refused", places=(("a.py", 3),))]
    events.close()

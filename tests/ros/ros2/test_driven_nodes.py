"""Errors that nodes log, as they are heard on /rosout."""

from __future__ import annotations

from pathlib import Path

from sim_action.ros.ros2.driven_nodes import LoggedErrors, errors_endpoint
from sim_action.ros.ros2.graph import TopicEnd


def log(text: str, level: int = 40, line: int = 7, file: str = "") -> dict[str, object]:
    return {"name": "mover", "level": level, "msg": text, "file": file, "line": line}


def test_errors_of_a_line_are_counted(tmp_path: Path) -> None:
    errors, file = LoggedErrors(tmp_path), str(tmp_path / "mover.py")
    errors.take(log("no map", level=50, line=3, file=file), None)
    for seconds in (0.5, 0.6):
        errors.take(log(f"no plan at {seconds}\n", file=file), seconds)
    errors.take(log("in C++", file="/opt/ros/jazzy/src/planner.cpp"), 1.0)
    assert errors.messages == [
        f"the node 'mover' logged a fatal error before sim time began: no map ({file}:3)",
        f"the node 'mover' logged an error 2 times, first at 0.5 s of sim time: no plan at 0.5 ({file}:7)",
        "the node 'mover' logged an error at 1 s of sim time: in C++",
    ]


def test_messages_are_limited(tmp_path: Path) -> None:
    errors = LoggedErrors(tmp_path)
    for line in range(30):
        errors.take(log("\x1b" + "x" * 10_000, line=line), 1.0)
    assert len(errors.messages) == 11
    assert all(len(message) < 400 and message.isprintable() for message in errors.messages)
    assert errors.messages[-1] == "nodes logged errors in more places"


def test_the_subscription_has_the_durability_of_the_publishers() -> None:
    old = TopicEnd("/a", "rcl_interfaces/msg/Log", "reliable", "transient_local")
    new = TopicEnd("/b", "rcl_interfaces/msg/Log", "reliable", "volatile")
    assert errors_endpoint([old]).qos.durability == "transient_local"
    assert errors_endpoint([old, new]).qos.durability == "volatile"

"""The parts that a program can build are those that a file can name."""

from __future__ import annotations

from sim_action import parts
from sim_action.assertions import ASSERTIONS
from sim_action.commands import COMMANDS
from sim_action.drives import DRIVES
from sim_action.sensors import SENSORS


def test_every_part_of_a_file_has_its_class() -> None:
    named = {table.paths[name].partition(":")[2] for table in (ASSERTIONS, COMMANDS, DRIVES, SENSORS) for name in table}
    assert set(parts.__all__) == named | {"DrivenRobot"}
    assert all(getattr(parts, name).__name__ == name for name in parts.__all__)

"""The tables of docs/ros1/reference.md list everything that is supported."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sim_action.core.registry import Table
from sim_action.ros.ros1.gazebo_plugins import DRIVE_PLUGINS, PLUGINS
from sim_action.ros.ros1.ros_control import CONTROLLERS

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/ros1/reference.md").read_text(encoding="utf-8")
NODE = ROOT / "sim_action/ros/ros1/node"


def listed(heading: str) -> list[str]:
    """What stands in the first column of the table below a heading."""
    section = PAGE.partition(f"## {heading}\n")[2].partition("\n## ")[0]
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    return [name for row in rows for name in re.findall(r"`([^`]+)`", row)]


@pytest.mark.parametrize(("heading", "table"), [("Plugins", PLUGINS), ("Controllers", CONTROLLERS)])
def test_tables_list_what_is_known(heading: str, table: Table[object]) -> None:
    assert sorted(listed(heading)) == sorted(table)


def test_services_are_those_that_are_offered() -> None:
    modules = [NODE / f"{name}.py" for name in ("services",)]
    offered = re.findall(r'^ {12}\("(\w+)", ', "\n".join(path.read_text() for path in modules), re.MULTILINE)
    assert len(offered) > 20
    assert sorted(listed("Services and topics")) == sorted(offered)


def test_plugins_that_drive_are_plugins() -> None:
    assert set(PLUGINS) >= DRIVE_PLUGINS

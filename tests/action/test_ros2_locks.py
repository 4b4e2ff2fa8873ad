"""The lock files of ROS 2 name the packages that messages tell users to install."""

from __future__ import annotations

from pathlib import Path

import pytest

from action.lock import entries
from sim_action.ros.ros2.installation import WHEELS

ROOT = Path(__file__).parents[2]
LOCKS = {"jazzy": "requirements-ros2.lock", "kilted": "requirements-ros2-kilted.lock"}


@pytest.mark.parametrize("distribution", WHEELS)
def test_what_users_install_is_what_is_locked(distribution: str) -> None:
    stated = (ROOT / f"tools/ros2/{distribution}.in").read_text(encoding="utf-8").splitlines()
    assert tuple(line for line in stated if not line.startswith("#")) == WHEELS[distribution]
    locked = entries((ROOT / "action/locks" / LOCKS[distribution]).read_text(encoding="utf-8"))
    assert {name.partition("[")[0] for name in WHEELS[distribution]} <= {entry.name for entry in locked}
    assert all(entry.hashes for entry in locked)

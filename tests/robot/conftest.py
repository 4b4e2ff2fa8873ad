"""A workspace of ROS, and a folder beside it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ros_workspace import RosWorkspace, ros_workspace


@pytest.fixture
def ros(tmp_path: Path) -> RosWorkspace:
    return ros_workspace(tmp_path)


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """A folder beside the repository."""
    folder = tmp_path.resolve() / "elsewhere"
    folder.mkdir()
    return folder

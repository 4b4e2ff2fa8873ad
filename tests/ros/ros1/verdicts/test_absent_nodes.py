"""Nodes that roslaunch could not start."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sim_action.core.errors import Location
from sim_action.ros.ros1.verdicts import absent_nodes
from sim_action.ros.ros1.verdicts.absent_nodes import AbsentNodes
from sim_action.ros.ros1.verdicts.launch_tags import LaunchTag, LaunchTags
from tests.ros.ros1.launches import package

ERROR = "ERROR: cannot launch node of type [{}]: {}\n"
PLACE = Location("a.launch", 3)

# ROS is looked for with its own Python.
pytestmark = pytest.mark.process


def absent(folder: Path, text: str, **given: str) -> AbsentNodes:
    tag = LaunchTag("node", {"pkg": "pkg", "type": "no.py", "name": "driver", **given}, PLACE)
    return AbsentNodes.of(text, LaunchTags("a.launch", (tag,)), folder)


def test_a_required_node_that_does_not_exist_is_an_invalid_launch(tmp_path: Path) -> None:
    package(tmp_path, "pkg", {"now.py": ""})
    found = absent(tmp_path, ERROR.format("pkg/no.py", "Cannot locate node"), required="true")

    (failure,) = found.failures
    assert (failure.kind, failure.location, found.losses) == ("invalid", PLACE, ())
    assert failure.message == (
        "the node 'driver' (pkg/no.py) was not started: the package 'pkg' has no node 'no.py'; "
        "did you mean 'now.py'? (allowed: now.py); add the file, or correct its name; the node is required"
    )


@pytest.mark.parametrize("required", ["false", "0", ""])
def test_another_node_is_a_loss(required: str, tmp_path: Path) -> None:
    package(tmp_path, "pkg", {"no.py": ""}).joinpath("no.py").chmod(0o644)
    found = absent(tmp_path, ERROR.format("pkg/no.py", "Cannot locate node"), required=required)

    (loss,) = found.losses
    assert (loss.location, found.failures) == (PLACE, ())
    assert "'no.py' of 'pkg' is not executable; run chmod +x no.py" in loss.message


def test_a_node_of_an_unknown_place_is_at_the_launch_file(tmp_path: Path) -> None:
    (loss,) = absent(tmp_path, ERROR.format("elsewhere/x", "elsewhere")).losses
    assert loss.location == Location("a.launch")
    assert "elsewhere" in loss.message


@pytest.mark.parametrize("name", ["rviz", "rqt_graph", "rqt_robot_steering", "image_view"])
def test_a_window_that_is_not_installed_is_no_loss(name: str, tmp_path: Path) -> None:
    assert absent(tmp_path, ERROR.format(f"{name}/{name}", name)) == AbsentNodes()


def test_every_window_has_a_reason() -> None:
    for pattern, reason in absent_nodes.WINDOW_PACKAGES.items():
        assert re.compile(pattern)
        assert reason


def test_a_launch_that_starts_everything_lacks_nothing(tmp_path: Path) -> None:
    assert absent(tmp_path, "process[driver-1]: started with pid [7]\n") == AbsentNodes()

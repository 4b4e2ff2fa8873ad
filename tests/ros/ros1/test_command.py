"""The command line of a call, and its request."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from sim_action.cli.ros import rostest
from sim_action.ros.ros1 import command
from sim_action.ros.ros1.launch_request import LaunchRequest


def test_what_nobody_has_asked_for_is_not_typed_again() -> None:
    asked = LaunchRequest("rostest", "driver", "mover.test", ("speed:=1",))
    assert asked.words == ("sim-action", "rostest", "driver", "mover.test", "speed:=1")


def test_all_that_makes_the_run_what_it_is_is_typed_again() -> None:
    asked = LaunchRequest(
        "roslaunch",
        "driver",
        "mover.launch",
        workspace=Path("catkin_ws"),
        backend="mujoco",
        seed=2**60 + 1,
        sim_time_limit=12.5,
        real_time_factor=1e7,
        wall_limit=60.0,
    )
    options = "--workspace catkin_ws --backend mujoco --seed 1152921504606846977 --sim-time-limit 12.5"
    more = f"{options} --rtf 10000000 --wall-limit 60"
    assert " ".join(asked.words) == f"sim-action roslaunch {more} driver mover.launch"


def test_what_is_typed_again_is_the_same_call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ws").mkdir()
    monkeypatch.chdir(tmp_path)
    calls: list[LaunchRequest] = []
    monkeypatch.setattr(command, "run", lambda request, *_: calls.append(request))
    asked = LaunchRequest("rostest", "driver", "mover.test", ("x:=-1",), Path("ws"), "pybullet", 7, 1 / 3, 0.1, 1e-5)
    CliRunner().invoke(rostest, asked.words[2:])
    assert calls == [asked]

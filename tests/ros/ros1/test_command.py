"""Commands rostest and roslaunch: the command line of a call, its request, and its losses."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from sim_action.cli.ros import rostest
from sim_action.core.errors import Location
from sim_action.core.records import replace
from sim_action.ros.launches import LaunchRequest
from sim_action.ros.ros1 import command, launch_request
from sim_action.world.world_files.losses import Loss

HERE = Location("a.launch")
WALL = Loss(message="the wall is left out", location=Location("a.world", 3))


def test_what_is_asked_for_is_typed_again() -> None:
    asked = LaunchRequest("rostest", "driver", "mover.test", ("speed:=1",))
    assert asked.words == ("sim-action", "rostest", "driver", "mover.test", "speed:=1")
    asked = LaunchRequest("launchtest", "driver", "a.py", backend="mujoco", allows_losses=True)
    assert asked.words == ("sim-action", "launchtest", "--backend", "mujoco", "--allow-losses", "driver", "a.py")
    limits = (2**60 + 1, 12.5, 1e7, 60.0)
    asked = LaunchRequest("roslaunch", "driver", "mover.launch", (), Path("catkin_ws"), "mujoco", *limits)
    options = "--workspace catkin_ws --backend mujoco --seed 1152921504606846977 --sim-time-limit 12.5"
    more = f"{options} --rtf 10000000 --wall-limit 60"
    assert " ".join(asked.words) == f"sim-action roslaunch {more} driver mover.launch"


def test_what_is_typed_again_is_the_same_call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ws").mkdir()
    monkeypatch.chdir(tmp_path)
    calls: list[LaunchRequest] = []
    monkeypatch.setattr(command, "run", lambda request, *_: calls.append(request))
    asked = LaunchRequest("rostest", "driver", "mover.test", ("x:=-1",), Path("ws"), "pybullet", 7, 1 / 3, 0.1, 1e-5)
    asked = replace(asked, strict=True)
    CliRunner().invoke(rostest, asked.words[2:])
    assert calls == [asked]


def test_each_start_has_a_folder_of_its_own_in_the_order_of_starts(tmp_path: Path) -> None:
    made = [launch_request.new_run_folder(tmp_path) for _ in range(11)]
    (tmp_path / "results").mkdir()
    assert launch_request.run_folders(tmp_path) == made
    assert made[-1].name == "11"


def test_a_result_is_read_again_and_one_that_cannot_be_understood_is_nothing(tmp_path: Path) -> None:
    assert launch_request.SimulationResult.read(tmp_path) is None
    messages = {"/clock published": 3000}
    told = launch_request.SimulationResult(end="time limit", sim_time=30.0, travelled=0.0, messages=messages)
    told.write(tmp_path)
    assert launch_request.SimulationResult.read(tmp_path) == told
    (tmp_path / launch_request.RUN_FILE).write_text('{"end": "tired"}')
    assert launch_request.SimulationResult.read(tmp_path) is None


def test_a_loss_is_a_failure_with_its_place_and_the_option() -> None:
    (failure,) = launch_request.loss_failures([WALL, WALL])
    assert (failure.kind, failure.location) == ("invalid", Location("a.world", 3))
    assert failure.message == "the wall is left out; to run without it: --allow-losses"
    # An allowed one is a warning.
    placed, unplaced = launch_request.loss_warnings([WALL, Loss(message="a\nplugin")], HERE)
    assert str(placed) == "the wall is left out [not-simulated]"
    assert placed.location == Location("a.world", 3)
    assert (unplaced.message, unplaced.location) == ("a\\nplugin", HERE)
    # Many are counted.
    losses = [Loss(message=f"part {number}") for number in range(30)]
    assert len(launch_request.loss_failures(losses)) == 21
    assert launch_request.loss_warnings(losses, HERE)[-1].message == "10 more parts of the launch"

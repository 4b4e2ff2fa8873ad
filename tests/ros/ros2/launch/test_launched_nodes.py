"""The messages for launch files that cannot be run, for processes that end, and the packages that stand for Gazebo."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sim_action.ros.launch_events import Event, EventFile
from sim_action.ros.lost_parts import LeftOutProgram
from sim_action.ros.program_failures import node_error
from sim_action.ros.ros2.installation import packages_of_prefix
from sim_action.ros.ros2.launch.launched_nodes import end_error, refusal_error, text_of, unheard_bridges, write_prefix

REFUSED = "the launch file cannot be run: "
ELSE = "; add it to the workspace, or use a ROS 2 that has it, such as ros:jazzy"


@pytest.mark.parametrize(
    ("about", "message"),
    [
        (
            {"kind": "package", "name": "robt", "names": ("robot",)},
            f"there is no package 'robt' in the workspace or ROS 2; did you mean 'robot'? (allowed: robot){ELSE}",
        ),
        (
            {
                "kind": "PackageNotFoundError",
                "message": "package 'nav' not found, searching: ['/opt']",
                "names": ("nav2",),
            },
            f"there is no package 'nav' in the workspace or ROS 2; did you mean 'nav2'? (allowed: nav2){ELSE}",
        ),
        (
            {"kind": "program", "package": "my_robot", "name": "moover", "names": ("mover",)},
            "the package 'my_robot' has no executable 'moover'; did you mean 'mover'? (allowed: mover)",
        ),
        (
            {"kind": "argument", "name": "sped", "names": ("speed",)},
            "it has no argument 'sped'; did you mean 'speed'? (allowed: speed)",
        ),
        (
            {"kind": "start", "name": "/bin/x", "message": "[Errno 13] Permission denied"},
            "'/bin/x' cannot be started: [Errno 13] Permission denied",
        ),
        ({"kind": "ValueError", "message": "no plan\nand more"}, "ValueError: no plan"),
    ],
)
def test_why_a_launch_file_cannot_be_run(tmp_path: Path, about: dict[str, Any], message: str) -> None:
    error = refusal_error(Event(event="refused", **about), "all output", tmp_path)
    assert str(error) == REFUSED + message
    assert error.details == "all output"


def test_the_place_is_the_innermost_one_in_the_workspace(tmp_path: Path) -> None:
    places = (("/opt/launch.py", 1), (str(tmp_path / "a.launch.py"), 7), ("/opt/other.py", 9))
    error = refusal_error(Event(event="refused", kind="KeyError", places=places), "", tmp_path)
    assert error.location is not None
    assert (Path(error.location.file).name, error.location.line) == ("a.launch.py", 7)
    assert refusal_error(Event(event="refused", places=places[:1]), "", tmp_path).location is None


def test_a_process_that_fails_is_named_with_its_exception(tmp_path: Path) -> None:
    output = (
        "[INFO] [launch]: hello\n[other-2] Traceback (most recent call last):\n[other-2] KeyError: 1\n"
        "[mover-1] Traceback (most recent call last):\n"
        f'[mover-1]   File "{tmp_path}/mover.py", line 7, in on_timer\n[mover-1] ValueError: no plan\n'
    )
    error = node_error("the node 'mover-1'", 1, text_of("mover-1", output), tmp_path)
    assert str(error) == "the node 'mover-1' ended with exit code 1: ValueError: no plan"
    assert error.location is not None
    assert error.location.line == 7
    assert str(node_error("the node 'mover-1'", -9, "", tmp_path)) == "the node 'mover-1' ended with SIGKILL"
    assert text_of("other-2", output) == "Traceback (most recent call last):\nKeyError: 1"


def test_ends_of_the_launch() -> None:
    assert str(end_error(-9, "")) == "the launcher ended with SIGKILL, and its nodes ended with it"
    missing = end_error(1, "Traceback\nModuleNotFoundError: No module named 'launch'\n")
    assert str(missing).startswith("launch files need the Python package 'launch' of ROS 2, which this ROS 2 lacks")


def test_an_event_is_read_once_its_line_is_complete(tmp_path: Path) -> None:
    events = EventFile(tmp_path / "events")
    with (tmp_path / "events").open("ab", buffering=0) as file:
        assert events.new() == []
        file.write(b'{"event": "calm", "time": 0.5, "pid": 7}\n{"event": "refused", "places": [["a.py", ')
        assert events.new() == [Event(event="calm", time=0.5, pid=7)]
        file.write(b"3]]}\n")
        assert events.new() == [Event(event="refused", places=(("a.py", 3),))]
        # A file name that is not UTF-8.
        file.write(b'{"event": "left out", "args": ["\\udcff"]}\n')
        assert events.new() == [Event(event="left out", args=("\udcff",))]
    events.close()


def test_bridged_topics_that_the_robot_does_not_publish() -> None:
    program = LeftOutProgram(
        "ros_gz_bridge/parameter_bridge",
        (
            "/scan@sensor_msgs/msg/LaserScan[gz.msgs.LaserScan",
            "/depth@sensor_msgs/msg/Image[gz.msgs.Image",
            "/lidar@sensor_msgs/msg/LaserScan[gz.msgs.LaserScan",
            "/cmd_vel@geometry_msgs/msg/Twist]gz.msgs.Twist",
            *("--ros-args", "-r", "/lidar:=scan"),
        ),
    )
    assert list(unheard_bridges([program], {"/scan"})) == [
        "the launch file bridges /depth to ROS 2, and the robot does not publish it"
    ]


def test_packages_are_indexed_and_their_launch_files_compile(tmp_path: Path) -> None:
    prefix = write_prefix(tmp_path / "gazebo")
    assert {"ros_gz_sim", "ros_gz_bridge", "gazebo_ros"} <= set(packages_of_prefix(prefix))
    files = {path.name: path.read_text() for path in prefix.rglob("*.launch.py")}
    assert {"gz_sim.launch.py", "gz_spawn_model.launch.py", "gzserver.launch.py"} <= set(files)
    for name, text in files.items():
        compile(text, name, "exec")
    assert "('gz', 'sim', '{gz_args}', '{ign_args}')" in files["gz_sim.launch.py"]
    assert 'startswith("{")' in files["gz_sim.launch.py"]

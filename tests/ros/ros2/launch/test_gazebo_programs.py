"""Bridges of a launch file, and the packages that stand for Gazebo."""

from __future__ import annotations

from pathlib import Path

from sim_action.ros.lost_parts import LeftOutProgram
from sim_action.ros.ros2.installation import packages_of_prefix
from sim_action.ros.ros2.launch.gazebo_programs import unheard_bridges, write_prefix


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

"""Starts the mover: ros2 launch my_robot drive.launch.py distance:=1.5"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description():
    return LaunchDescription(
        [
            DeclareLaunchArgument("distance", default_value="1.5"),
            Node(package="my_robot", executable="mover", parameters=[{"distance": LaunchConfiguration("distance")}]),
        ]
    )

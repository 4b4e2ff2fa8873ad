"""The built-in robots, each in a URDF file of this folder."""

from __future__ import annotations

from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parent

BUILT_IN: Final = {
    "turtlebot3_burger": "two-wheeled robot, 1 kg, diff drive: wheel radius 0.033 m, separation 0.160 m",
    "husky_a200": "four-wheeled rover, 50 kg, skid steer: wheel radius 0.1651 m, separation 0.555 m, at most 1 m/s",
    "f1tenth": "car of scale 1:10, 3.74 kg, Ackermann steering: wheelbase 0.33 m, turning radius 0.87 m",
    "ur5e_gripper": "six-axis arm with a parallel gripper, 21.5 kg, fixed to the world: reach 0.85 m, stroke 85 mm",
    "quadruped": "robot on four legs, 9 kg, 12 motors: hips 0.38 m apart, legs of 0.209 and 0.175 m",
}
"""Name of each model that comes with sim-action -> its description."""

STANDARD_SENSORS: Final = {
    "turtlebot3_burger": (
        {
            "lidar": {"rays": 360, "angle_min": "0 deg", "min_range": "12 cm", "range": "3.5 m"},
            "name": "scan",
            "link": "base_scan",
            "rate": "5 Hz",
        },
        {"imu": {}, "name": "imu", "rate": "40 Hz"},
        {"odometry": {}, "name": "odom", "rate": "40 Hz"},
    )
}
"""Name of a built-in model -> the sensors that the robot is sold with, as a scenario has them (emanual.robotis.com)."""

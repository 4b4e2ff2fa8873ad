"""The types of ROS messages that tell a robot where to go."""

from __future__ import annotations

from typing import Final, Literal

MessageType = Literal["geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped", "sensor_msgs/msg/JointState"]

TWISTS: Final[frozenset[str]] = frozenset({"geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"})
"""Those that drive a base."""

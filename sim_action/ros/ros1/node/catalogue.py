"""What is known here of Gazebo's plugins and of ros_control's controllers; read without rospy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from sim_action.core.registry import Table

if TYPE_CHECKING:
    from sim_action.ros.ros1.node.control import Opener as ControllerOpener
    from sim_action.ros.ros1.node.devices import Opener

_DRIVE: Final = "sim_action.ros.ros1.node.devices.drive:open_drive"
_LASER: Final = "sim_action.ros.ros1.node.devices.laser:open_laser"
_IMU: Final = "sim_action.ros.ros1.node.devices.imu:open_imu"

DEVICES: Final[Table[Opener]] = Table(
    "plugin",
    {
        "gazebo_ros_diff_drive": _DRIVE,
        "gazebo_ros_skid_steer_drive": _DRIVE,
        "gazebo_ros_laser": _LASER,
        "gazebo_ros_gpu_laser": _LASER,
        "gazebo_ros_imu": _IMU,
        "gazebo_ros_imu_sensor": _IMU,
        "gazebo_ros_control": "sim_action.ros.ros1.node.devices.control:open_control",
        "gazebo_ros_planar_move": "sim_action.ros.ros1.node.devices.planar_move:open_planar_move",
        "gazebo_ros_joint_state_publisher": "sim_action.ros.ros1.node.devices.joint_states:open_joint_states",
        "gazebo_ros_p3d": "sim_action.ros.ros1.node.devices.ground_truth:open_ground_truth",
    },
)
"""Name of a plugin's file, without "lib" and ".so" -> what does the same here."""

DRIVING: Final = frozenset(
    {"gazebo_ros_control", "gazebo_ros_diff_drive", "gazebo_ros_planar_move", "gazebo_ros_skid_steer_drive"}
)
"""Those that move a robot: a model of a world with one of them is no thing that stands about."""

_FORWARD: Final = "sim_action.ros.ros1.node.control.forward"

_JOINT_STATES: Final = "sim_action.ros.ros1.node.control.joint_states:open_joint_states"
_TRAJECTORY: Final = "sim_action.ros.ros1.node.control.trajectory"

CONTROLLERS: Final[Table[ControllerOpener]] = Table(
    "controller",
    {
        "joint_state_controller/JointStateController": _JOINT_STATES,
        "diff_drive_controller/DiffDriveController": "sim_action.ros.ros1.node.control.diff_drive:open_diff_drive",
        "position_controllers/JointPositionController": f"{_FORWARD}:open_position",
        "position_controllers/JointGroupPositionController": f"{_FORWARD}:open_group_position",
        "velocity_controllers/JointVelocityController": f"{_FORWARD}:open_velocity",
        "velocity_controllers/JointGroupVelocityController": f"{_FORWARD}:open_group_velocity",
        "velocity_controllers/JointPositionController": f"{_FORWARD}:open_servo_on_velocity",
        "effort_controllers/JointEffortController": f"{_FORWARD}:open_effort",
        "effort_controllers/JointGroupEffortController": f"{_FORWARD}:open_group_effort",
        "effort_controllers/JointPositionController": f"{_FORWARD}:open_servo",
        "effort_controllers/JointGroupPositionController": f"{_FORWARD}:open_group_servo",
        "effort_controllers/JointVelocityController": f"{_FORWARD}:open_motor",
        "position_controllers/JointTrajectoryController": f"{_TRAJECTORY}:open_on_position",
        "velocity_controllers/JointTrajectoryController": f"{_TRAJECTORY}:open_on_velocity",
        "effort_controllers/JointTrajectoryController": f"{_TRAJECTORY}:open_on_effort",
    },
)
"""Type of a controller -> what does the same here."""

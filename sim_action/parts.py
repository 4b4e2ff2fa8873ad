"""The parts of a scenario that a program builds: assertions, command sources, drives and sensors.

Each part has the keys that it has in a scenario file. Numbers are in SI units. A quantity with another unit is text in
a map instead: `{"upright": {"max_tilt": "5 deg"}}`.

Example:
    from sim_action import Scenario
    from sim_action.parts import Travel, Upright

    Scenario(..., expect=[Travel(at_least=1.5), Upright(max_tilt=0.1)])
"""

from __future__ import annotations

from sim_action.assertions.clearance import Clearance
from sim_action.assertions.combined import AllOf, AnyOf, AtOnce, Negation
from sim_action.assertions.contact import Touch
from sim_action.assertions.distance import PathLength, Travel
from sim_action.assertions.effort import Effort
from sim_action.assertions.energy import Energy
from sim_action.assertions.final_pose import FinalPose
from sim_action.assertions.follow_path import FollowPath
from sim_action.assertions.grasped import Grasped
from sim_action.assertions.joint import JointReading, JointWithin
from sim_action.assertions.legs import FeetOnGround, SupportMargin
from sim_action.assertions.matches import Matches
from sim_action.assertions.max_speed import MaxSpeed
from sim_action.assertions.no_collision import NoCollision
from sim_action.assertions.object import ObjectAssertion
from sim_action.assertions.odometry_error import OdometryError
from sim_action.assertions.reach import Reach
from sim_action.assertions.self_collision import SelfCollision
from sim_action.assertions.sensor import SensorReading
from sim_action.assertions.settled import Settled
from sim_action.assertions.stay_within import StayWithin
from sim_action.assertions.stops_before import StopsBefore
from sim_action.assertions.temporal_logic.stl_assertion import Stl
from sim_action.assertions.upright import Upright
from sim_action.assertions.user_assertion import UserAssertion
from sim_action.commands.external_program import ProcessCommands
from sim_action.commands.joints import JointCommands
from sim_action.commands.policy import PolicyCommands
from sim_action.commands.pose import PoseCommands
from sim_action.commands.replay import ReplayCommands
from sim_action.commands.script import ScriptCommands
from sim_action.commands.twist import TwistCommands
from sim_action.commands.waypoints import WaypointCommands
from sim_action.commands.wrench import WrenchCommands
from sim_action.drives.ackermann import AckermannDrive
from sim_action.drives.diff import DiffDrive
from sim_action.drives.mecanum import MecanumDrive
from sim_action.drives.skid import SkidSteer
from sim_action.ros.ros1.command_source.spec import RosCommands
from sim_action.ros.ros2.spec import Ros2Commands
from sim_action.scenario.model import DrivenRobot
from sim_action.sensors.camera import Camera
from sim_action.sensors.contact import ContactSensor
from sim_action.sensors.imu import Imu
from sim_action.sensors.lidar import Lidar
from sim_action.sensors.odometry import Odometry

__all__ = [
    "AckermannDrive",
    "AllOf",
    "AnyOf",
    "AtOnce",
    "Camera",
    "Clearance",
    "ContactSensor",
    "DiffDrive",
    "DrivenRobot",
    "Effort",
    "Energy",
    "FeetOnGround",
    "FinalPose",
    "FollowPath",
    "Grasped",
    "Imu",
    "JointCommands",
    "JointReading",
    "JointWithin",
    "Lidar",
    "Matches",
    "MaxSpeed",
    "MecanumDrive",
    "Negation",
    "NoCollision",
    "ObjectAssertion",
    "Odometry",
    "OdometryError",
    "PathLength",
    "PolicyCommands",
    "PoseCommands",
    "ProcessCommands",
    "Reach",
    "ReplayCommands",
    "Ros2Commands",
    "RosCommands",
    "ScriptCommands",
    "SelfCollision",
    "SensorReading",
    "Settled",
    "SkidSteer",
    "StayWithin",
    "Stl",
    "StopsBefore",
    "SupportMargin",
    "Touch",
    "Travel",
    "TwistCommands",
    "Upright",
    "UserAssertion",
    "WaypointCommands",
    "WrenchCommands",
]

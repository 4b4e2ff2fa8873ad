"""The parts of a scenario that a program builds: assertions, command sources, drives and sensors.

Each part has the keys that it has in a scenario file. Numbers are in SI units. A quantity with another unit is text in
a map instead: `{"upright": {"max_tilt": "5 deg"}}`.

Example:
    from sim_action import Scenario
    from sim_action.parts import Travel, Upright

    Scenario(..., expect=[Travel(at_least=1.5), Upright(max_tilt=0.1)])
"""

from sim_action.assertions.clearance import Clearance as Clearance
from sim_action.assertions.combined import AllOf as AllOf
from sim_action.assertions.combined import AnyOf as AnyOf
from sim_action.assertions.combined import AtOnce as AtOnce
from sim_action.assertions.combined import Negation as Negation
from sim_action.assertions.contact import Touch as Touch
from sim_action.assertions.distance import PathLength as PathLength
from sim_action.assertions.distance import Travel as Travel
from sim_action.assertions.effort import Effort as Effort
from sim_action.assertions.effort import Energy as Energy
from sim_action.assertions.follow_path import FollowPath as FollowPath
from sim_action.assertions.grasped import Grasped as Grasped
from sim_action.assertions.joint import JointReading as JointReading
from sim_action.assertions.joint import JointWithin as JointWithin
from sim_action.assertions.legs import FeetOnGround as FeetOnGround
from sim_action.assertions.legs import SupportMargin as SupportMargin
from sim_action.assertions.matches import Matches as Matches
from sim_action.assertions.max_speed import MaxSpeed as MaxSpeed
from sim_action.assertions.no_collision import NoCollision as NoCollision
from sim_action.assertions.no_collision import SelfCollision as SelfCollision
from sim_action.assertions.object import ObjectAssertion as ObjectAssertion
from sim_action.assertions.odometry_error import OdometryError as OdometryError
from sim_action.assertions.reach import FinalPose as FinalPose
from sim_action.assertions.reach import Reach as Reach
from sim_action.assertions.sensor import SensorReading as SensorReading
from sim_action.assertions.settled import Settled as Settled
from sim_action.assertions.settled import StopsBefore as StopsBefore
from sim_action.assertions.stay_within import StayWithin as StayWithin
from sim_action.assertions.temporal_logic.stl_assertion import Stl as Stl
from sim_action.assertions.upright import Upright as Upright
from sim_action.assertions.user_assertion import UserAssertion as UserAssertion
from sim_action.commands.external_program import ProcessCommands as ProcessCommands
from sim_action.commands.joints import JointCommands as JointCommands
from sim_action.commands.policy import PolicyCommands as PolicyCommands
from sim_action.commands.pose import PoseCommands as PoseCommands
from sim_action.commands.replay import ReplayCommands as ReplayCommands
from sim_action.commands.script import ScriptCommands as ScriptCommands
from sim_action.commands.twist import TwistCommands as TwistCommands
from sim_action.commands.waypoints import WaypointCommands as WaypointCommands
from sim_action.commands.wrench import WrenchCommands as WrenchCommands
from sim_action.drives.ackermann import AckermannDrive as AckermannDrive
from sim_action.drives.diff import DiffDrive as DiffDrive
from sim_action.drives.mecanum import MecanumDrive as MecanumDrive
from sim_action.drives.skid import SkidSteer as SkidSteer
from sim_action.ros.ros1.command_source.spec import RosCommands as RosCommands
from sim_action.ros.ros2.spec import Ros2Commands as Ros2Commands
from sim_action.scenario.model import DrivenRobot as DrivenRobot
from sim_action.sensors.camera import Camera as Camera
from sim_action.sensors.contact import ContactSensor as ContactSensor
from sim_action.sensors.imu import Imu as Imu
from sim_action.sensors.lidar import Lidar as Lidar
from sim_action.sensors.odometry import Odometry as Odometry

"""A rostest of a robot with planar_move and ros_control, as text: it runs on ROS's own Python."""

MACHINE = """\
<robot name="machine">
  <link name="base_footprint">
    <inertial><origin xyz="0 0 0.1"/><mass value="8"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.1"/><geometry><box size="0.4 0.4 0.2"/></geometry></collision>
  </link>
  <joint name="pan" type="revolute">
    <parent link="base_footprint"/><child link="head"/><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="10" velocity="10"/>
  </joint>
  <link name="head"><inertial><mass value="0.5"/>
    <inertia ixx="0.002" iyy="0.002" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="spin" type="continuous">
    <parent link="base_footprint"/><child link="rotor"/><origin xyz="0.1 0 0.3"/><axis xyz="0 0 1"/>
    <limit effort="5" velocity="20"/>
  </joint>
  <link name="rotor"><inertial><mass value="0.2"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="flywheel" type="continuous">
    <parent link="base_footprint"/><child link="disc"/><origin xyz="-0.1 0 0.3"/><axis xyz="0 0 1"/>
  </joint>
  <link name="disc"><inertial><mass value="0.5"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <transmission name="t1"><type>transmission_interface/SimpleTransmission</type>
    <joint name="pan"><hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface></joint>
    <actuator name="m1"><mechanicalReduction>1</mechanicalReduction></actuator></transmission>
  <transmission name="t2"><type>transmission_interface/SimpleTransmission</type>
    <joint name="spin"><hardwareInterface>VelocityJointInterface</hardwareInterface></joint>
    <actuator name="m2"><mechanicalReduction>1</mechanicalReduction></actuator></transmission>
  <transmission name="t3"><type>transmission_interface/SimpleTransmission</type>
    <joint name="flywheel"/>
    <actuator name="m3"><hardwareInterface>EffortJointInterface</hardwareInterface></actuator></transmission>
  <gazebo><plugin name="control" filename="libgazebo_ros_control.so"/></gazebo>
  <gazebo><plugin name="base" filename="libgazebo_ros_planar_move.so">
    <commandTopic>base/cmd_vel</commandTopic><odometryTopic>base/odom</odometryTopic>
    <odometryFrame>map</odometryFrame><odometryRate>10</odometryRate><robotBaseFrame>foot</robotBaseFrame>
  </plugin></gazebo>
  <gazebo><plugin name="smoke" filename="libsmoke_machine.so"/></gazebo>
</robot>
"""

MACHINE_LAUNCH = """\
<launch>
  <include file="$(find gazebo_ros)/launch/empty_world.launch"/>
  <param name="robot_description" textfile="$(find machine)/machine.urdf"/>
  <group ns="m">
    <rosparam>
      joint_state_controller: {type: joint_state_controller/JointStateController, publish_rate: 200}
      head: {type: position_controllers/JointPositionController, joint: pan}
      rotor: {type: velocity_controllers/JointVelocityController, joint: spin}
      disc: {type: effort_controllers/JointGroupEffortController, joints: [flywheel]}
      disc_speed: {type: effort_controllers/JointVelocityController, joint: flywheel}
      wrong: {type: position_controllers/JointPositionController, joint: spin}
      way: {type: position_controllers/JointTrajectoryController, joints: [pan]}
      grip: {type: position_controllers/GripperActionController, joint: pan}
    </rosparam>
    <node name="spawn" pkg="gazebo_ros" type="spawn_model" args="-urdf -model machine -param /robot_description"/>
    <node name="spawner" pkg="controller_manager" type="spawner"
          args="joint_state_controller head rotor disc wrong grip"/>
  </group>
  <test test-name="machine" pkg="machine" type="test_machine.py" time-limit="60"/>
</launch>
"""

MACHINE_TEST = r"""#!/usr/bin/env python
import unittest

import rospy
from controller_manager_msgs.srv import ListControllers, ListControllerTypes, SwitchController, UnloadController
from controller_manager_msgs.srv import LoadController
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint


def manager(name, kind, *arguments):
    rospy.wait_for_service("/m/controller_manager/" + name, 5)
    return rospy.ServiceProxy("/m/controller_manager/" + name, kind)(*arguments)


class Latest:

    def __init__(self, topic, kind):
        self.message = None
        rospy.Subscriber(topic, kind, self.hear)

    def hear(self, message):
        self.message = message


class Machine(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("test_machine")
        cls.base = rospy.Publisher("/m/base/cmd_vel", Twist, queue_size=1)
        cls.head = rospy.Publisher("/m/head/command", Float64, queue_size=1)
        cls.rotor = rospy.Publisher("/m/rotor/command", Float64, queue_size=1)
        cls.disc = rospy.Publisher("/m/disc/command", Float64MultiArray, queue_size=1)
        cls.way = rospy.Publisher("/m/way/command", JointTrajectory, queue_size=1)
        cls.odom, cls.states = Latest("/m/base/odom", Odometry), Latest("/m/joint_states", JointState)
        rospy.sleep(0.25)

    def joints(self):
        told = self.states.message
        return {name: (told.position[i], told.velocity[i]) for i, name in enumerate(told.name)}

    def test_1_the_base_goes_sideways_at_once(self):
        twist = Twist()
        twist.linear.y, twist.angular.z = 0.5, 0.0
        before = self.odom.message
        self.base.publish(twist)
        rospy.sleep(1.0)
        after = self.odom.message
        seconds = (after.header.stamp - before.header.stamp).to_sec()
        self.assertAlmostEqual(seconds, 1.0, delta=1e-6)
        self.assertEqual((after.header.frame_id, after.child_frame_id), ("map", "foot"))
        self.assertAlmostEqual(after.twist.twist.linear.y, 0.5, delta=0.03)
        moved = after.pose.pose.position.y - before.pose.pose.position.y
        # It was told half way between two messages.
        self.assertAlmostEqual(moved, 0.5 * 0.95, delta=0.015)
        twist.linear.y, twist.angular.z = 0, 1.0
        self.base.publish(twist)
        rospy.sleep(0.5)
        self.assertAlmostEqual(self.odom.message.twist.twist.angular.z, 1.0, delta=0.05)
        self.base.publish(Twist())
        rospy.sleep(0.3)
        self.assertAlmostEqual(self.odom.message.twist.twist.angular.z, 0, delta=0.05)

    def test_2_controllers_are_listed(self):
        found = {each.name: each for each in manager("list_controllers", ListControllers).controller}
        self.assertEqual(set(found), {"joint_state_controller", "head", "rotor", "disc", "grip"})
        self.assertEqual({each.state for each in found.values()}, {"running"})
        self.assertEqual(found["head"].type, "position_controllers/JointPositionController")
        self.assertEqual(found["head"].claimed_resources[0].hardware_interface,
                         "hardware_interface::PositionJointInterface")
        self.assertEqual(found["head"].claimed_resources[0].resources, ["pan"])
        self.assertIn("effort_controllers/JointEffortController",
                      manager("list_controller_types", ListControllerTypes).types)

    def test_3_joints_go_where_they_are_told(self):
        self.head.publish(0.5)
        self.rotor.publish(6.0)
        self.disc.publish(data=[0.2])
        rospy.sleep(1.0)
        found = self.joints()
        self.assertEqual(sorted(found), ["flywheel", "pan", "spin"])
        self.assertAlmostEqual(found["pan"][0], 0.5, delta=0.01)
        self.assertAlmostEqual(found["spin"][1], 6.0, delta=0.05)
        # 0.2 N m on 0.1 kg m^2 for a second, more or less some ticks.
        self.assertAlmostEqual(found["flywheel"][1], 2.0, delta=0.1)
        self.head.publish(4.0)
        rospy.sleep(1.0)
        self.assertAlmostEqual(self.joints()["pan"][0], 1.0, delta=0.01)

    def test_4_controllers_are_switched(self):
        self.assertTrue(manager("load_controller", LoadController, "disc_speed").ok)
        self.assertFalse(manager("load_controller", LoadController, "disc_speed").ok)
        self.assertFalse(manager("load_controller", LoadController, "nobody").ok)
        self.assertFalse(manager("switch_controller", SwitchController, ["disc_speed"], [], 2, False, 0.0).ok)
        self.assertFalse(manager("unload_controller", UnloadController, "disc").ok)
        self.assertTrue(manager("switch_controller", SwitchController, ["disc_speed"], ["disc"], 2, False, 0.0).ok)
        self.assertTrue(manager("unload_controller", UnloadController, "disc").ok)
        rospy.sleep(0.5)
        self.assertAlmostEqual(self.joints()["flywheel"][1], 0.0, delta=0.05)

    def test_5_a_joint_goes_along_a_trajectory(self):
        self.assertTrue(manager("load_controller", LoadController, "way").ok)
        self.assertTrue(manager("switch_controller", SwitchController, ["way"], ["head"], 2, False, 0.0).ok)
        rospy.sleep(0.2)
        points = [JointTrajectoryPoint([0.0], [], [], [], rospy.Duration(1)),
                  JointTrajectoryPoint([-0.5], [], [], [], rospy.Duration(1.5))]
        self.way.publish(JointTrajectory(joint_names=["pan"], points=points))
        rospy.sleep(0.5)
        self.assertAlmostEqual(self.joints()["pan"][0], 0.5, delta=0.03)
        self.assertAlmostEqual(self.joints()["pan"][1], -1.0, delta=0.1)
        rospy.sleep(1.2)
        self.assertAlmostEqual(self.joints()["pan"][0], -0.5, delta=0.01)


if __name__ == "__main__":
    import rostest

    rostest.rosrun("machine", "machine", Machine)
"""

"""A rostest of robots in SDF, one in a world and one spawned, as text: it runs on ROS's own Python."""

_WHEEL = """
  <link name="{side}_wheel"><pose>-0.1 {y} 0.1 -1.5707963 0 0</pose>
    <inertial><mass>0.5</mass>
      <inertia><ixx>0.002</ixx><iyy>0.002</iyy><izz>0.003</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial>
    <collision name="c"><geometry><sphere><radius>0.1</radius></sphere></geometry></collision></link>
  <joint name="{side}_joint" type="revolute"><parent>chassis</parent><child>{side}_wheel</child>
    <axis><xyz>0 0 1</xyz><limit><effort>20</effort></limit></axis></joint>
"""

ROVER = f"""\
<?xml version="1.0"?>
<sdf version="1.6"><model name="rover">
  <link name="chassis"><pose>0 0 0.15 0 0 0</pose>
    <inertial><pose>-0.05 0 0 0 0 0</pose><mass>5</mass>
      <inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.1</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial>
    <collision name="c"><geometry><box><size>0.4 0.2 0.1</size></box></geometry></collision>
    <collision name="caster"><pose>0.15 0 -0.1 0 0 0</pose><geometry><sphere><radius>0.05</radius></sphere></geometry>
      <surface><friction><ode><mu>0</mu><mu2>0</mu2></ode></friction></surface></collision>
    <sensor name="lidar" type="ray"><pose>0.2 0 0.1 0 0 0</pose><update_rate>10</update_rate>
      <ray><scan><horizontal><samples>9</samples><min_angle>-0.4</min_angle><max_angle>0.4</max_angle></horizontal></scan>
        <range><min>0.05</min><max>5</max></range></ray>
      <plugin name="l" filename="libgazebo_ros_laser.so"><topicName>scan</topicName><frameName>top</frameName></plugin>
    </sensor>
    <sensor name="imu" type="imu"><update_rate>50</update_rate>
      <plugin name="i" filename="libgazebo_ros_imu_sensor.so"><topicName>imu</topicName></plugin></sensor>
  </link>
  {_WHEEL.format(side="left", y=0.15)}{_WHEEL.format(side="right", y=-0.15)}
  <plugin name="drive" filename="libgazebo_ros_diff_drive.so">
    <commandTopic>cmd_vel</commandTopic><odometryTopic>odom</odometryTopic><legacyMode>false</legacyMode>
    <leftJoint>left_joint</leftJoint><rightJoint>right_joint</rightJoint><updateRate>50</updateRate>
    <wheelSeparation>0.3</wheelSeparation><wheelDiameter>0.2</wheelDiameter>
    <wheelAcceleration>1</wheelAcceleration><wheelTorque>20</wheelTorque></plugin>
</model></sdf>
"""

YARD = """\
<sdf version="1.6"><world name="yard">
  <include><uri>model://ground_plane</uri></include>
  <include><uri>model://rover</uri><pose>0 1 0 0 0 0</pose></include>
  <model name="wall"><static>true</static><pose>3 1 0.5 0 0 0</pose><link name="link">
    <collision name="c"><geometry><box><size>0.2 4 1</size></box></geometry></collision></link></model>
</world></sdf>
"""

PACKAGE = """\
<?xml version="1.0"?>
<package format="2"><name>yard</name><version>0.0.0</version><description>a yard</description>
  <maintainer email="a@b.example">a</maintainer><license>none</license>
  <export><gazebo_ros gazebo_model_path="${prefix}/models"/></export>
</package>
"""

YARD_TEST = """\
<launch>
  <param name="/use_sim_time" value="true"/>
  <node name="gazebo" pkg="gazebo_ros" type="gazebo" args="-e ode $(find yard)/yard.world"/>
  <node name="gazebo_gui" pkg="gazebo_ros" type="gzclient"/>
  <test test-name="yard" pkg="yard" type="test_yard.py" time-limit="60"/>
</launch>
"""

TEST = r"""#!/usr/bin/env python
import os
import signal
import subprocess
import time
import unittest

import rospy
from gazebo_msgs.srv import DeleteModel, GetModelState, GetWorldProperties
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, LaserScan


def call(name, kind, *arguments):
    rospy.wait_for_service("/gazebo/" + name)
    return rospy.ServiceProxy("/gazebo/" + name, kind)(*arguments)


class Latest:

    def __init__(self, topic, kind):
        self.message = None
        rospy.Subscriber(topic, kind, self.hear)

    def hear(self, message):
        self.message = message


def names():
    return call("get_world_properties", GetWorldProperties).model_names


class Yard(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("test_yard")
        cls.commands = {space: rospy.Publisher(space + "/cmd_vel", Twist, queue_size=1) for space in ("", "/two")}
        cls.odom = {space: Latest(space + "/odom", Odometry) for space in cls.commands}
        cls.scan, cls.imu = Latest("/scan", LaserScan), Latest("/imu", Imu)
        rospy.sleep(0.25)

    def drive(self, space, seconds):
        twist = Twist()
        twist.linear.x = 0.5
        self.commands[space].publish(twist)
        rospy.sleep(seconds)
        return self.odom[space].message

    def test_1_the_robot_of_the_world_sees_and_drives(self):
        self.assertEqual(names(), ["ground_plane", "wall", "rover"])
        at = call("get_model_state", GetModelState, "rover", "").pose.position
        self.assertAlmostEqual(at.z, 0, delta=0.01)
        self.assertAlmostEqual(at.y, 1, delta=0.01)
        scan = self.scan.message
        self.assertEqual((len(scan.ranges), scan.header.frame_id), (9, "top"))
        self.assertAlmostEqual(scan.ranges[4], 2.7, delta=0.02)
        self.assertEqual(self.imu.message.header.frame_id, "chassis")
        odometry = self.drive("", 1.5)
        # A ramp of 0.5 s, and a second at 0.5 m/s.
        self.assertAlmostEqual(odometry.pose.pose.position.x, 0.625, delta=0.05)
        self.assertAlmostEqual(odometry.pose.pose.position.z, 0, delta=0.01)

    def test_2_a_robot_is_spawned_with_its_spawner_and_goes_with_it(self):
        self.assertTrue(call("delete_model", DeleteModel, "rover").success)
        place = ["-x", "0.5", "-y", "-5", "-reference_frame", "wall", "-robot_namespace", "/two"]
        words = ["-b", "-wait", "wall", "-sdf", "-database", "rover", "-model", "two"]
        path = os.path.join(os.environ["ROS_PACKAGE_PATH"], "gazebo_ros", "spawn_model")
        spawner = subprocess.Popen([path] + words + place)
        while "two" not in names():
            time.sleep(0.02)
        rospy.sleep(0.5)
        at = call("get_model_state", GetModelState, "two", "world").pose.position
        self.assertAlmostEqual(at.x, 3.5, delta=0.01)
        self.assertAlmostEqual(at.y, -4, delta=0.01)
        self.assertAlmostEqual(self.drive("/two", 1.0).pose.pose.position.x, 3.5 + 0.375, delta=0.05)
        spawner.send_signal(signal.SIGINT)
        while "two" in names():
            time.sleep(0.02)
        self.assertEqual(spawner.wait(), 0)


if __name__ == "__main__":
    import rostest

    rostest.rosrun("yard", "yard", Yard)
"""

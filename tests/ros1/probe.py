"""A rostest that uses every topic and every service that Gazebo has here; text, since it runs on ROS's own Python."""

PROBE = r'''#!/usr/bin/env python
import math
import time
import unittest

import rospy
from gazebo_msgs.msg import LinkStates, ModelState, ModelStates
from gazebo_msgs.srv import (
    ApplyBodyWrench, ApplyBodyWrenchRequest, DeleteModel, GetModelState, GetWorldProperties, SetModelState, SpawnModel,
)
from geometry_msgs.msg import Point, Pose
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState, LaserScan
from std_srvs.srv import Empty
from tf2_msgs.msg import TFMessage

ROBOT = "turtlebot3_burger"
BOX = """<sdf version='1.6'><model name='box'><link name='link'><inertial><mass>1</mass></inertial>
<collision name='c'><geometry><box><size>0.2 0.2 0.2</size></box></geometry></collision></link></model></sdf>"""


def call(name, kind, *arguments, **fields):
    rospy.wait_for_service("/gazebo/" + name)
    return rospy.ServiceProxy("/gazebo/" + name, kind)(*arguments, **fields)


def hear(topic, kind):
    return rospy.wait_for_message(topic, kind, 20)


def state(name=ROBOT, frame=""):
    return call("get_model_state", GetModelState, name, frame)


def spawn(name, x, y, kind="sdf", text=BOX):
    pose = Pose(position=Point(x, y, 0.1))
    return call("spawn_%s_model" % kind, SpawnModel, name, text, "", pose, "")


class Probe(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("probe")
        rospy.sleep(0.5)

    def test_01_messages_are_gazebos(self):
        self.assertEqual(ModelStates._md5sum, "48c080191eb15c41858319b4d8a609c2")

    def test_02_clock(self):
        first, second = hear("/clock", Clock).clock, hear("/clock", Clock).clock
        self.assertGreater(second, first)
        self.assertEqual(first.nsecs % 10000000, 0)

    def test_03_model_states(self):
        states = hear("/gazebo/model_states", ModelStates)
        self.assertEqual(states.name, ["ground_plane", ROBOT])
        self.assertEqual((len(states.pose), len(states.twist)), (2, 2))
        self.assertAlmostEqual(states.pose[1].position.x, 0, delta=0.01)
        self.assertAlmostEqual(states.pose[1].orientation.w, 1, delta=0.01)

    def test_04_link_states(self):
        names = hear("/gazebo/link_states", LinkStates).name
        self.assertEqual(names[0], "ground_plane::link")
        self.assertIn(ROBOT + "::wheel_left_link", names)

    def test_05_odom(self):
        odometry = hear("/odom", Odometry)
        self.assertEqual((odometry.header.frame_id, odometry.child_frame_id), ("odom", "base_footprint"))

    def test_06_tf(self):
        (frame,) = hear("/tf", TFMessage).transforms
        self.assertEqual((frame.header.frame_id, frame.child_frame_id), ("odom", "base_footprint"))

    def test_07_joint_states(self):
        joints = hear("/joint_states", JointState)
        self.assertEqual(joints.name, ["wheel_left_joint", "wheel_right_joint"])
        self.assertEqual((len(joints.position), len(joints.velocity)), (2, 2))

    def test_08_imu(self):
        imu = hear("/imu", Imu)
        self.assertAlmostEqual(imu.linear_acceleration.z, 9.8, delta=0.3)
        self.assertEqual(imu.header.frame_id, "base_footprint")

    def test_09_scan(self):
        scan = hear("/scan", LaserScan)
        self.assertEqual(len(scan.ranges), 360)
        self.assertTrue(all(math.isinf(reading) for reading in scan.ranges))
        self.assertEqual(scan.header.frame_id, "base_scan")

    def test_10_world_properties(self):
        properties = call("get_world_properties", GetWorldProperties)
        self.assertTrue(properties.success)
        self.assertEqual(properties.model_names, ["ground_plane", ROBOT])
        self.assertGreater(properties.sim_time, 0.5)

    def test_11_model_state(self):
        found = state()
        self.assertTrue(found.success)
        self.assertAlmostEqual(found.pose.position.x, 0, delta=0.01)
        unknown = state("house")
        self.assertFalse(unknown.success)
        self.assertIn("ground_plane, " + ROBOT, unknown.status_message)

    def test_12_a_box_is_spawned_seen_and_deleted(self):
        self.assertTrue(spawn("box", 1.0, 0.0).success)
        again = spawn("box", 1.0, 0.0)
        self.assertFalse(again.success)
        self.assertIn("box", again.status_message)
        rospy.sleep(0.5)
        self.assertIn("box", hear("/gazebo/model_states", ModelStates).name)
        scan = hear("/scan", LaserScan)
        self.assertAlmostEqual(min(scan.ranges), 0.9 + 0.032, delta=0.02)
        self.assertAlmostEqual(state(ROBOT, "box").pose.position.x, -1, delta=0.02)
        self.assertTrue(call("delete_model", DeleteModel, "box").success)
        self.assertFalse(call("delete_model", DeleteModel, "box").success)
        self.assertFalse(call("delete_model", DeleteModel, "ground_plane").success)
        rospy.sleep(0.1)
        self.assertNotIn("box", hear("/gazebo/model_states", ModelStates).name)

    def test_13_what_cannot_be_spawned_is_refused(self):
        for text in ("<sdf", "<sdf version='1.6'/>"):
            refused = spawn("bad", 0, 0, text=text)
            self.assertFalse(refused.success)
            self.assertTrue(refused.status_message)

    def test_14_the_robot_is_set_elsewhere_and_brought_back(self):
        wanted = ModelState(model_name=ROBOT, pose=Pose(position=Point(1, 2, 0)))
        self.assertTrue(call("set_model_state", SetModelState, wanted).success)
        rospy.sleep(0.2)
        at = state().pose.position
        self.assertAlmostEqual(at.x, 1, delta=0.01)
        self.assertAlmostEqual(at.y, 2, delta=0.01)
        before = rospy.get_time()
        call("reset_world", Empty)
        rospy.sleep(0.2)
        self.assertAlmostEqual(state().pose.position.y, 0, delta=0.01)
        self.assertGreater(rospy.get_time(), before)
        wanted.model_name = "house"
        self.assertFalse(call("set_model_state", SetModelState, wanted).success)

    def test_15_a_wrench_pushes_for_as_long_as_it_lasts(self):
        spawn("box", 1.0, 1.0)
        rospy.sleep(0.2)
        request = ApplyBodyWrenchRequest(body_name="box::link", duration=rospy.Duration(0.5))
        request.wrench.force.x = 20
        self.assertTrue(call("apply_body_wrench", ApplyBodyWrench, request).success)
        rospy.sleep(1.5)
        far = state("box").pose.position.x
        self.assertGreater(far, 1.3)
        # What has ended does not begin again when something else changes.
        call("delete_model", DeleteModel, "nobody")
        spawn("other", -2.0, 0.0)
        rospy.sleep(1.0)
        self.assertLess(state("box").pose.position.x, far + 1.0)
        request.body_name = "house::link"
        self.assertFalse(call("apply_body_wrench", ApplyBodyWrench, request).success)
        request.body_name, request.duration = ROBOT + "::roof", rospy.Duration(1)
        self.assertIn("roof", call("apply_body_wrench", ApplyBodyWrench, request).status_message)

    def test_16_the_world_stands_still_and_goes_on(self):
        call("pause_physics", Empty)
        time.sleep(0.3)
        before = call("get_world_properties", GetWorldProperties).sim_time
        time.sleep(0.3)
        self.assertEqual(call("get_world_properties", GetWorldProperties).sim_time, before)
        call("unpause_physics", Empty)
        rospy.sleep(0.3)
        self.assertGreater(rospy.get_time(), before)

    def test_17_one_robot_at_a_time(self):
        description = rospy.get_param("robot_description")
        self.assertFalse(spawn("twin", 1, 1, "urdf", description).success)
        self.assertTrue(call("delete_model", DeleteModel, ROBOT).success)
        self.assertTrue(spawn(ROBOT, 3, 0, "urdf", description).success)
        rospy.sleep(0.2)
        self.assertAlmostEqual(state().pose.position.x, 3, delta=0.05)

    def test_18_sim_time_begins_anew(self):
        before = rospy.get_time()
        call("reset_simulation", Empty)
        self.assertLess(hear("/clock", Clock).clock.to_sec(), before)


if __name__ == "__main__":
    import rostest

    rostest.rosrun("probe", "probe", Probe)
'''

PROBE_TEST = """\
<launch>
  <include file="$(find turtlebot3_gazebo)/launch/turtlebot3_empty_world.launch"/>
  <test test-name="probe" pkg="probe" type="probe.py" time-limit="120"/>
</launch>
"""

"""A rostest that uses every topic and service of the node, as text: it runs on ROS's own Python."""

PROBE = r'''#!/usr/bin/env python
import math
import time
import unittest

import rospy
from gazebo_msgs.msg import LinkState, LinkStates, ModelState, ModelStates
from gazebo_msgs.srv import (
    ApplyBodyWrench, ApplyBodyWrenchRequest, ApplyJointEffort, BodyRequest, DeleteModel, GetJointProperties,
    GetLinkProperties, GetLinkState, GetModelProperties, GetModelState, GetPhysicsProperties, GetWorldProperties,
    JointRequest, SetLinkState, SetModelState, SetPhysicsProperties, SpawnModel,
)
from geometry_msgs.msg import Point, Pose, Twist, Vector3
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

    def test_17_links_joints_and_models_are_told_of(self):
        rospy.sleep(0.1)
        wheel = call("get_link_state", GetLinkState, ROBOT + "::wheel_left_link", "")
        self.assertTrue(wheel.success, wheel.status_message)
        told = hear("/gazebo/link_states", LinkStates)
        found = told.pose[told.name.index(ROBOT + "::wheel_left_link")].position
        self.assertAlmostEqual(wheel.link_state.pose.position.y, found.y, delta=1e-3)
        self.assertAlmostEqual(wheel.link_state.pose.position.z, found.z, delta=1e-3)
        seen = call("get_link_state", GetLinkState, "wheel_left_link", ROBOT + "::base_footprint").link_state
        self.assertAlmostEqual(seen.pose.position.y, 0.08, delta=1e-3)
        self.assertIn("wheel_left_link", call("get_link_state", GetLinkState, "wheel_left", "").status_message)
        self.assertTrue(call("get_link_state", GetLinkState, "box::link", "").success)
        link = call("get_link_properties", GetLinkProperties, ROBOT + "::base_footprint")
        self.assertAlmostEqual(link.mass, 0.826)
        self.assertAlmostEqual(link.com.position.z, 0.08)
        self.assertAlmostEqual(link.izz, 0.002698)
        joint = call("get_joint_properties", GetJointProperties, "wheel_left_joint")
        self.assertEqual((joint.type, len(joint.position), len(joint.rate)), (joint.CONTINUOUS, 1, 1))
        self.assertFalse(call("get_joint_properties", GetJointProperties, "elbow").success)
        model = call("get_model_properties", GetModelProperties, ROBOT)
        self.assertEqual(model.canonical_body_name, "base_footprint")
        self.assertIn("wheel_right_joint", model.joint_names)
        self.assertEqual(call("get_model_properties", GetModelProperties, "box").body_names, ["link"])
        self.assertFalse(call("get_model_properties", GetModelProperties, "house").success)

    def test_18_a_joint_is_turned_for_as_long_as_it_is_said(self):
        self.assertTrue(call("apply_joint_effort", ApplyJointEffort, "wheel_left_joint", 0.02,
                             rospy.Time(), rospy.Duration(-1)).success)
        rospy.sleep(0.5)
        turned = call("get_joint_properties", GetJointProperties, "wheel_left_joint").rate[0]
        self.assertGreater(turned, 1.0)
        call("clear_joint_forces", JointRequest, "wheel_left_joint")
        nobody = call("apply_joint_effort", ApplyJointEffort, "elbow", 1, rospy.Time(), rospy.Duration(1))
        self.assertFalse(nobody.success)
        rospy.sleep(0.1)
        before = call("get_joint_properties", GetJointProperties, "wheel_left_joint").rate[0]
        rospy.sleep(0.3)
        after = call("get_joint_properties", GetJointProperties, "wheel_left_joint").rate[0]
        self.assertLess(after, before + 0.2)

    def test_19_states_are_set_by_topics_and_of_links(self):
        keep = rospy.Publisher("/gazebo/set_model_state", ModelState, queue_size=1)
        while not keep.get_num_connections():
            time.sleep(0.01)
        wanted = ModelState(model_name="box", pose=Pose(position=Point(0.5, 3, 0.1)))
        wanted.twist.linear.x = 1.0
        keep.publish(wanted)
        rospy.sleep(0.1)
        at = state("box")
        self.assertAlmostEqual(at.pose.position.y, 3, delta=0.05)
        self.assertGreater(at.pose.position.x, 0.52)
        link = LinkState(ROBOT + "::base_footprint", Pose(position=Point(1, 0, 0)), Twist(), "box")
        self.assertTrue(call("set_link_state", SetLinkState, link).success)
        rospy.sleep(0.1)
        self.assertAlmostEqual(state(ROBOT, "box").pose.position.x, 1, delta=0.05)
        link.link_name = ROBOT + "::wheel_left_link"
        self.assertIn("base_footprint", call("set_link_state", SetLinkState, link).status_message)
        wanted.reference_frame = "nowhere"
        self.assertIn("nowhere", call("set_model_state", SetModelState, wanted).status_message)

    def test_20_physics_are_told_of_and_gravity_is_set(self):
        physics = call("get_physics_properties", GetPhysicsProperties)
        self.assertAlmostEqual(physics.time_step, 0.005)
        self.assertAlmostEqual(physics.gravity.z, -9.8, delta=0.01)
        set_physics = lambda z: call("set_physics_properties", SetPhysicsProperties, time_step=0.001,
                                     gravity=Vector3(0, 0, z))
        self.assertTrue(set_physics(0.0).success)
        request = ApplyBodyWrenchRequest(body_name="box::link", duration=rospy.Duration(-1))
        request.wrench.force.z = 1
        self.assertTrue(call("apply_body_wrench", ApplyBodyWrench, request).success)
        rospy.sleep(0.5)
        self.assertGreater(state("box").pose.position.z, 0.15)
        call("clear_body_wrenches", BodyRequest, "box::link")
        self.assertTrue(set_physics(-9.8).success)
        rospy.sleep(0.8)
        self.assertAlmostEqual(state("box").pose.position.z, 0.1, delta=0.01)

    def test_21_one_robot_at_a_time(self):
        description = rospy.get_param("robot_description")
        self.assertFalse(spawn("twin", 1, 1, "urdf", description).success)
        self.assertTrue(call("delete_model", DeleteModel, ROBOT).success)
        self.assertTrue(spawn(ROBOT, 3, 0, "urdf", description).success)
        rospy.sleep(0.2)
        self.assertAlmostEqual(state().pose.position.x, 3, delta=0.05)
        command = rospy.Publisher("/cmd_vel", Twist, queue_size=1, latch=True)
        command.publish(linear=Vector3(0.2, 0, 0))
        rospy.sleep(1.0)
        self.assertGreater(hear("/odom", Odometry).pose.pose.position.x, 3.05)

    def test_22_sim_time_begins_anew(self):
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

"""A rostest of a cart with a diff_drive_controller, and a node whose callback raises."""

_SIDE = """
  <joint name="{side}" type="continuous"><parent link="base_link"/><child link="{side}_wheel"/>
    <origin xyz="0 {y} 0.1"/><axis xyz="0 1 0"/><limit effort="20" velocity="50"/></joint>
  <link name="{side}_wheel"><inertial><mass value="0.5"/>
    <inertia ixx="0.002" iyy="0.003" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.1"/></geometry></collision><contact><lateral_friction value="1"/></contact>
  </link>
  <transmission name="{side}_t"><type>transmission_interface/SimpleTransmission</type>
    <joint name="{side}"><hardwareInterface>hardware_interface/VelocityJointInterface</hardwareInterface></joint>
    <actuator name="{side}_m"/></transmission>
"""

CART = f"""\
<robot name="cart">
  <link name="base_link">
    <inertial><origin xyz="-0.05 0 0.15"/><mass value="5"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="-0.2 0 0.05"/><geometry><sphere radius="0.05"/></geometry></collision>
    <contact><lateral_friction value="0"/></contact>
  </link>
  {_SIDE.format(side="left", y=0.15)}{_SIDE.format(side="right", y=-0.15)}
  <gazebo><plugin name="c" filename="libgazebo_ros_control.so"><robotNamespace>/</robotNamespace></plugin></gazebo>
</robot>
"""

CART_LAUNCH = """\
<launch>
  <include file="$(find gazebo_ros)/launch/empty_world.launch"/>
  <param name="robot_description" textfile="$(find cart)/cart.urdf"/>
  <rosparam>
    drive: {type: diff_drive_controller/DiffDriveController, left_wheel: left, right_wheel: [right],
      publish_rate: 20, cmd_vel_timeout: 0.25, base_frame_id: base_link,
      linear: {x: {has_velocity_limits: true, max_velocity: 0.5, has_acceleration_limits: true, max_acceleration: 1.0}}}
  </rosparam>
  <node name="spawn" pkg="gazebo_ros" type="spawn_model" args="-urdf -model cart -param robot_description -x 2"/>
  <node name="spawner" pkg="controller_manager" type="spawner" args="drive"/>
  <node name="clumsy" pkg="cart" type="clumsy.py"/>
  <test test-name="cart" pkg="cart" type="test_cart.py" time-limit="60"/>
</launch>
"""

CLUMSY = """\
#!/usr/bin/env python
import rospy
from nav_msgs.msg import Odometry


def heard(message):
    return message.pose.pose.position.nothing


rospy.init_node("clumsy")
rospy.Subscriber("/drive/odom", Odometry, heard)
rospy.spin()
"""

CART_TEST = r"""#!/usr/bin/env python
import unittest

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry


class Cart(unittest.TestCase):
    def test_1_it_drives_within_its_limits_and_stops_when_it_is_told_no_more(self):
        rospy.init_node("test_cart")
        with self.assertRaisesRegex(rospy.ROSException, "timeout exceeded .* /nothing"):
            rospy.wait_for_message("/nothing", Odometry, 0.01)
        told = []
        rospy.Subscriber("/drive/odom", Odometry, told.append)
        publisher = rospy.Publisher("/drive/cmd_vel", Twist, queue_size=1)
        rate, twist = rospy.Rate(20), Twist()
        twist.linear.x = 2.0
        for _ in range(40):
            publisher.publish(twist)
            rate.sleep()
        moving = told[-1]
        self.assertEqual((moving.header.frame_id, moving.child_frame_id), ("odom", "base_link"))
        self.assertAlmostEqual(moving.twist.twist.linear.x, 0.5, delta=0.02)
        # A ramp of 0.5 s, and 1.5 s at 0.5 m/s, from where it began; some ticks until it is told.
        self.assertAlmostEqual(moving.pose.pose.position.x, 0.875, delta=0.06)
        rospy.sleep(1.0)
        still = told[-1]
        self.assertAlmostEqual(still.twist.twist.linear.x, 0, delta=0.02)


if __name__ == "__main__":
    import rostest

    rostest.rosrun("cart", "cart", Cart)
"""

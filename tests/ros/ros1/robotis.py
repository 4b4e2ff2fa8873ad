"""A TurtleBot3 Burger in packages that are laid out as ROBOTIS lays out theirs: xacro, plugins, meshes, worlds."""

from __future__ import annotations

from pathlib import Path

from tests.ros.ros1.launches import package
from tests.ros_workspace import TRIANGLE

_XACRO = 'xmlns:xacro="http://ros.org/wiki/xacro"'

_PROPERTIES = f"""\
<robot name="properties" {_XACRO}>
  <material name="light_black"><color rgba="0.4 0.4 0.4 1.0"/></material>
</robot>
"""

_BURGER = f"""\
<?xml version="1.0" ?>
<robot name="turtlebot3_burger" {_XACRO}>
  <xacro:include filename="$(find turtlebot3_description)/urdf/common_properties.xacro"/>
  <xacro:include filename="$(find turtlebot3_description)/urdf/turtlebot3_burger.gazebo.xacro"/>
  <xacro:property name="scale" value="0.001 0.001 0.001"/>
  <xacro:macro name="part" params="mesh xyz mass i *shape">
    <visual><origin xyz="${{xyz}}"/><material name="light_black"/>
      <geometry><mesh filename="package://turtlebot3_description/meshes/${{mesh}}" scale="${{scale}}"/></geometry>
    </visual>
    <collision><origin xyz="${{xyz}}"/><geometry><xacro:insert_block name="shape"/></geometry></collision>
    <inertial><mass value="${{mass}}"/>
      <inertia ixx="${{i}}" ixy="0" ixz="0" iyy="${{i}}" iyz="0" izz="${{i}}"/></inertial>
  </xacro:macro>
  <xacro:macro name="fixed" params="link parent xyz">
    <joint name="${{link}}_joint" type="fixed"><parent link="${{parent}}"/><child link="${{link}}"/>
      <origin xyz="${{xyz}}" rpy="0 0 0"/></joint>
  </xacro:macro>
  <xacro:macro name="wheel" params="side reflect">
    <joint name="wheel_${{side}}_joint" type="continuous">
      <parent link="base_link"/><child link="wheel_${{side}}_link"/>
      <origin xyz="0.0 ${{reflect * 0.08}} 0.023" rpy="-1.57 0 0"/><axis xyz="0 0 1"/>
    </joint>
    <link name="wheel_${{side}}_link"><xacro:part mesh="wheels/${{side}}_tire.stl" xyz="0 0 0" mass="0.028" i="2e-05">
      <cylinder length="0.018" radius="0.033"/></xacro:part></link>
  </xacro:macro>
  <link name="base_footprint"/>
  <xacro:fixed link="base_link" parent="base_footprint" xyz="0 0 0.010"/>
  <link name="base_link"><xacro:part mesh="bases/base.stl" xyz="-0.032 0 0.070" mass="0.826" i="0.002">
    <box size="0.14 0.14 0.143"/></xacro:part></link>
  <xacro:wheel side="left" reflect="1"/>
  <xacro:wheel side="right" reflect="-1"/>
  <xacro:fixed link="caster_back_link" parent="base_link" xyz="-0.081 0 -0.005"/>
  <link name="caster_back_link"><collision><geometry><box size="0.030 0.020 0.009"/></geometry></collision>
    <inertial><mass value="0.005"/><inertia ixx="1e-06" ixy="0" ixz="0" iyy="1e-06" iyz="0" izz="1e-06"/></inertial>
  </link>
  <xacro:fixed link="imu_link" parent="base_link" xyz="-0.032 0 0.068"/>
  <link name="imu_link"/>
  <xacro:fixed link="base_scan" parent="base_link" xyz="-0.032 0 0.172"/>
  <link name="base_scan"><xacro:part mesh="sensors/lds.stl" xyz="0 0 0" mass="0.114" i="0.001">
    <cylinder length="0.0315" radius="0.055"/></xacro:part></link>
</robot>
"""

_GAZEBO = f"""\
<?xml version="1.0"?>
<robot name="turtlebot3_burger_sim" {_XACRO}>
  <xacro:arg name="laser_visual" default="false"/>
  <gazebo reference="base_link"><material>Gazebo/DarkGrey</material></gazebo>
  <gazebo reference="wheel_left_link">
    <mu1>0.1</mu1><mu2>0.1</mu2><kp>500000.0</kp><kd>10.0</kd><minDepth>0.001</minDepth><fdir1>1 0 0</fdir1>
  </gazebo>
  <gazebo reference="caster_back_link"><mu1>0.1</mu1><mu2>0.1</mu2><kp>1000000.0</kp><kd>100.0</kd></gazebo>
  <gazebo reference="imu_link">
    <sensor type="imu" name="imu"><always_on>true</always_on><visualize>false</visualize></sensor>
  </gazebo>
  <gazebo>
    <plugin name="burger_controller" filename="libgazebo_ros_diff_drive.so">
      <commandTopic>cmd_vel</commandTopic><odometryTopic>odom</odometryTopic><odometryFrame>odom</odometryFrame>
      <odometrySource>world</odometrySource><publishOdomTF>true</publishOdomTF>
      <robotBaseFrame>base_footprint</robotBaseFrame><publishWheelTF>false</publishWheelTF><publishTf>true</publishTf>
      <publishWheelJointState>true</publishWheelJointState><legacyMode>false</legacyMode><updateRate>30</updateRate>
      <leftJoint>wheel_left_joint</leftJoint><rightJoint>wheel_right_joint</rightJoint>
      <wheelSeparation>0.160</wheelSeparation><wheelDiameter>0.066</wheelDiameter>
      <wheelAcceleration>1</wheelAcceleration><wheelTorque>10</wheelTorque><rosDebugLevel>na</rosDebugLevel>
    </plugin>
    <plugin name="imu_plugin" filename="libgazebo_ros_imu.so">
      <alwaysOn>true</alwaysOn><bodyName>imu_link</bodyName><frameName>imu_link</frameName><topicName>imu</topicName>
      <serviceName>imu_service</serviceName><gaussianNoise>0.0</gaussianNoise><updateRate>0</updateRate>
    </plugin>
  </gazebo>
  <gazebo reference="base_scan">
    <material>Gazebo/FlatBlack</material>
    <sensor type="ray" name="lds_sensor">
      <pose>0 0 0 0 0 0</pose><visualize>$(arg laser_visual)</visualize><update_rate>5</update_rate>
      <ray>
        <scan><horizontal><samples>360</samples><resolution>1</resolution>
          <min_angle>0.0</min_angle><max_angle>6.28319</max_angle></horizontal></scan>
        <range><min>0.120</min><max>3.5</max><resolution>0.015</resolution></range>
        <noise><type>gaussian</type><mean>0.0</mean><stddev>0.01</stddev></noise>
      </ray>
      <plugin name="laser" filename="libgazebo_ros_laser.so">
        <topicName>scan</topicName><frameName>base_scan</frameName>
      </plugin>
    </sensor>
  </gazebo>
</robot>
"""

_WORLD = """\
<sdf version='1.4'>
  <world name='default'>
    <include><uri>model://ground_plane</uri></include>
    <include><uri>model://sun</uri></include>
    <scene><ambient>0.4 0.4 0.4 1</ambient><shadows>true</shadows></scene>
    <gui fullscreen='0'><camera name='user_camera'><pose>0.8 0.0 12.0 0 1.57 0</pose></camera></gui>
    <physics type="ode">
      <real_time_update_rate>1000.0</real_time_update_rate><max_step_size>0.001</max_step_size></physics>
  </world>
</sdf>
"""

_LAUNCH = """\
<launch>
  <arg name="model" default="$(env TURTLEBOT3_MODEL)" doc="model type [burger, waffle, waffle_pi]"/>
  <arg name="x_pos" default="0.0"/><arg name="y_pos" default="0.0"/><arg name="z_pos" default="0.0"/>
  <include file="$(find gazebo_ros)/launch/empty_world.launch">
    <arg name="world_name" value="$(find turtlebot3_gazebo)/worlds/empty.world"/>
    <arg name="paused" value="false"/><arg name="use_sim_time" value="true"/><arg name="gui" value="true"/>
    <arg name="headless" value="false"/><arg name="debug" value="false"/>
  </include>
  <param name="robot_description"
    command="$(find xacro)/xacro --inorder $(find turtlebot3_description)/urdf/turtlebot3_$(arg model).urdf.xacro"/>
  <node pkg="gazebo_ros" type="spawn_model" name="spawn_urdf"
        args="-urdf -model turtlebot3_$(arg model) -x $(arg x_pos) -y $(arg y_pos) -z $(arg z_pos)
              -param robot_description"/>
</launch>
"""


def lay_out(workspace: Path) -> None:
    """Both packages, in the src of a workspace."""
    package(
        workspace,
        "turtlebot3_description",
        {
            "urdf/common_properties.xacro": _PROPERTIES,
            "urdf/turtlebot3_burger.urdf.xacro": _BURGER,
            "urdf/turtlebot3_burger.gazebo.xacro": _GAZEBO,
            "meshes/bases/base.stl": TRIANGLE,
            "meshes/wheels/left_tire.stl": TRIANGLE,
            "meshes/wheels/right_tire.stl": TRIANGLE,
            "meshes/sensors/lds.stl": TRIANGLE,
        },
    )
    package(
        workspace, "turtlebot3_gazebo", {"launch/turtlebot3_empty_world.launch": _LAUNCH, "worlds/empty.world": _WORLD}
    )

"""Plugins in descriptions: URDF with references, SDF with links, topics with and without namespaces."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from sim_action.core.geometry import Pose
from sim_action.robot.documents.part_table import part_table
from sim_action.ros.ros1.gazebo_plugins import (
    PLUGINS,
    Plugin,
    Tags,
    base_in_model,
    lost_plugin_tags,
    lost_robot_tags,
    plugin_remarks,
    plugins_of,
)
from sim_action.ros.ros1.launch.overlay import PACKAGE_ROOT
from tests.ros.ros1 import robotis

URDF = """
<robot name="rover">
  <link name="base"/>
  <gazebo>
    <plugin name="a" filename="libgazebo_ros_diff_drive.so"><commandTopic> cmd_vel </commandTopic></plugin>
    <plugin name="b" filename="/opt/lib/libgazebo_ros_p3d.so"><bodyName>base</bodyName></plugin>
  </gazebo>
  <gazebo reference="base">
    <material>Gazebo/Red</material>
    <sensor name="lidar" type="ray">
      <update_rate>5</update_rate>
      <ray><scan><horizontal><samples>360</samples></horizontal></scan></ray>
      <plugin name="c" filename="libgazebo_ros_laser.so"><topicName>scan</topicName></plugin>
    </sensor>
  </gazebo>
</robot>
"""
SDF = """
<sdf version="1.6"><model name="rover">
  <link name="top"><sensor name="i" type="imu"><plugin name="c" filename="libgazebo_ros_imu_sensor.so"/></sensor></link>
  <plugin name="a" filename="libgazebo_ros_diff_drive.so"/>
</model></sdf>
"""

PACKAGES = Path(PACKAGE_ROOT) / "sim_action/ros/ros1/launch/packages"
BURGER = PACKAGES / "turtlebot3_description/urdf/turtlebot3_burger.urdf.xacro"
NOISE = "<imu><angular_velocity><x><noise><mean>0</mean><stddev>{}</stddev></noise></x></angular_velocity></imu>"


def plugins(text: str) -> dict[str, Plugin]:
    return {plugin.name: plugin for plugin in plugins_of(ET.fromstring(text))}


def plugin(own: str) -> Plugin:
    text = f'<robot><gazebo><plugin filename="libx.so">{own}</plugin></gazebo></robot>'
    return plugins(text)["x"]


def test_plugins_of_a_urdf_and_of_an_sdf() -> None:
    found = plugins(URDF)
    assert list(found) == ["gazebo_ros_diff_drive", "gazebo_ros_p3d", "gazebo_ros_laser"]
    laser = found["gazebo_ros_laser"]
    assert laser.link == "base"
    assert laser.sensor.number("update_rate", default=0) == 5
    assert laser.sensor.number("ray/scan/horizontal/samples", default=0) == 360
    assert found["gazebo_ros_diff_drive"].link == ""
    found = plugins(SDF)
    assert set(found) == {"gazebo_ros_imu_sensor", "gazebo_ros_diff_drive"}
    assert found["gazebo_ros_imu_sensor"].link == "top"


@pytest.mark.parametrize(
    ("own", "topic"),
    [
        ("", "/scan"),
        ("<topicName>front</topicName>", "/front"),
        ("<topicName>/front</topicName>", "/front"),
        ("<topicName>front</topicName><robotNamespace>/left/</robotNamespace>", "/left/front"),
        ("<robotNamespace>left</robotNamespace>", "/left/scan"),
        ("<topicName>/front</topicName><robotNamespace>left</robotNamespace>", "/front"),
        ("<topicName>front</topicName><robotNamespace>/</robotNamespace>", "/front"),
    ],
)
def test_topics_are_in_the_namespace_that_the_plugin_states(own: str, topic: str) -> None:
    assert plugin(own).topic("topicName", default="scan") == topic


def test_texts_numbers_and_flags_of_tags() -> None:
    lists = {"a, b": ("a", "b"), "a</n><n>b c": ("a", "b", "c"), "": ()}
    assert {text: plugin(f"<n>{text}</n>").own.texts("n") for text in lists} == lists
    flags = {"true": True, " 1 ": True, "False": False, "": True}
    assert {text: plugin(f"<f>{text}</f>").own.flag("f", default=True) for text in flags} == flags
    assert plugin("").own.flag("f", default=True)
    assert plugin("<updateRate>fast</updateRate>").own.number("updateRate", default=7.0) == 7.0
    none = Tags(None)
    assert (none.text("a", default="x"), none.texts("a"), none.number("a", default=1)) == ("x", (), 1)


def test_plugins_without_a_namespace_are_in_that_of_the_robot() -> None:
    found = list(plugins_of(ET.fromstring(URDF), "/left/"))
    assert [plugin.topic("topicName", default="x") for plugin in found] == ["/left/x", "/left/x", "/left/scan"]
    own = ET.fromstring(
        '<robot><gazebo><plugin filename="libx.so"><robotNamespace>a</robotNamespace></plugin></gazebo></robot>'
    )
    assert [plugin.space for plugin in plugins_of(own, "/left")] == ["/a"]


def test_the_base_link_of_an_sdf_may_be_off_the_origin_of_its_model() -> None:
    text = '<sdf version="1.6"><model name="m"><link name="base"><pose>1 0 0.1 0 0 0</pose></link></model></sdf>'
    assert base_in_model(ET.fromstring(text), "base").position_xyz == (1, 0, 0.1)
    assert base_in_model(ET.fromstring(text), "other") == Pose()
    assert base_in_model(ET.fromstring(URDF), "base") == Pose()


def lost(plugin: str, tags: str = "", sensor: str | None = None) -> list[str]:
    """The lost tags of a plugin, in a sensor if `sensor` is given."""
    text = f'<plugin name="p" filename="lib{plugin}.so">{tags}</plugin>'
    inside = text if sensor is None else f'<sensor name="s">{sensor}{text}</sensor>'
    robot = ET.fromstring(f'<robot name="r"><gazebo reference="base">{inside}</gazebo></robot>')
    return [message for plugin in plugins_of(robot) for message in lost_plugin_tags(plugin)]


def test_every_supported_plugin_has_a_table() -> None:
    assert set(PLUGINS) <= set(part_table("gazebo_ros").places)


def test_the_burgers_of_sim_action_and_of_robotis_lose_nothing() -> None:
    ours = ET.fromstring(BURGER.read_text())
    theirs = ET.fromstring(robotis._GAZEBO)
    for robot in (ours, theirs):
        assert list(lost_robot_tags(robot)) == []
        assert [message for plugin in plugins_of(robot) for message in lost_plugin_tags(plugin)] == []


@pytest.mark.parametrize(
    ("tags", "message"),
    [
        ("<odometrySource>encoder</odometrySource>", "odometry is the true motion"),
        ("<odometrySource>0</odometrySource>", "odometry is the true motion"),
        ("<publishWheelTF>true</publishWheelTF>", "robot_state_publisher"),
        ("<odometrySource>world</odometrySource><odometrySource>1</odometrySource>", None),
        ("<publishWheelTF>0</publishWheelTF><publishWheelJointState>true</publishWheelJointState>", None),
        ("<updateRate>30</updateRate><rosDebugLevel>na</rosDebugLevel><alwaysOn>1</alwaysOn>", None),
    ],
)
def test_a_tag_of_a_drive_with_an_effect_that_is_not_simulated_is_lost(tags: str, message: str | None) -> None:
    found = lost("gazebo_ros_diff_drive", tags)
    assert [message in text and "gazebo_ros_diff_drive" in text for text in found if message] == [True] * bool(message)
    assert bool(found) == bool(message)


@pytest.mark.parametrize(
    ("tags", "message"),
    [
        ("<updateRate>200</updateRate>", "of gazebo_ros_diff_drive: messages come 100 times per second"),
        ("<updateRate>100</updateRate>", None),
        ("<updateRate>often</updateRate><broadcastTF>1</broadcastTF>", None),
        ("<comandTopic>cmd</comandTopic>", "as in Gazebo; did you mean 'commandTopic'?"),
    ],
)
def test_a_tag_that_gazebo_does_not_follow_either_is_a_remark(tags: str, message: str | None) -> None:
    assert lost("gazebo_ros_diff_drive", tags) == []
    plugin = f'<plugin filename="libgazebo_ros_diff_drive.so">{tags}</plugin>'
    remarks = list(plugin_remarks(next(plugins_of(ET.fromstring(f"<robot><gazebo>{plugin}</gazebo></robot>")))))
    assert [message in remark for remark in remarks if message] == [True] * bool(message), remarks
    assert bool(remarks) == bool(message)


RAY = "<ray><scan><horizontal><samples>9</samples>{}</horizontal>{}</scan><noise>{}</noise></ray>"


@pytest.mark.parametrize(
    ("horizontal", "vertical", "noise", "count"),
    [
        ("<resolution>1.0</resolution>", "", "<type>gaussian</type><mean>0.0</mean><stddev>0.01</stddev>", 0),
        ("<resolution>0.5</resolution>", "", "", 1),
        ("", "<vertical><samples>16</samples><min_angle>-0.2</min_angle></vertical>", "", 2),
        ("", "<vertical><samples>1</samples><min_angle>0</min_angle></vertical>", "", 0),
        ("", "", "<mean>0.1</mean>", 1),
        ("", "", "<sttdev>0.1</sttdev>", 1),
    ],
)
def test_tags_of_a_lidar(horizontal: str, vertical: str, noise: str, count: int) -> None:
    found = lost("gazebo_ros_laser", sensor=RAY.format(horizontal, vertical, noise) + "<visualize>true</visualize>")
    assert len(found) == count, found


@pytest.mark.parametrize(
    ("sensor", "count"),
    [
        (NOISE.format(0.1), 1),
        (NOISE.format(0), 0),
        ("<pose>0 0 0.1 0 0 0</pose>", 1),
        ("<pose>0 0 0 0 0 0</pose><update_rate>50</update_rate>", 0),
    ],
)
def test_tags_of_an_imu(sensor: str, count: int) -> None:
    assert len(lost("gazebo_ros_imu_sensor", sensor=sensor)) == count


@pytest.mark.parametrize(
    ("tags", "count"),
    [
        ("<material>Gazebo/Red</material><kp>1e6</kp><mu1 value='0.2'/><sensor type='imu' name='i'/>", 0),
        ("<turnGravityOff>false</turnGravityOff><selfCollide>false</selfCollide>", 0),
        ("<turnGravityOff>true</turnGravityOff>", 1),
        ("<springStiffness>3</springStiffness><springReference>0.1</springReference>", 0),
        ("<selfCollide value='true'/>", 1),
        ("<mu>0.2</mu>", 1),
    ],
)
def test_tags_of_gazebo_in_a_urdf(tags: str, count: int) -> None:
    robot = ET.fromstring(f'<robot name="r"><gazebo reference="base">{tags}</gazebo></robot>')
    assert len(list(lost_robot_tags(robot))) == count

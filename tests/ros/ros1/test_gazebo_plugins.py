"""Plugins in descriptions: URDF with references, SDF with links, topics with and without namespaces."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import pytest

from sim_action.core.geometry import Pose
from sim_action.ros.ros1.gazebo_plugins import Plugin, Tags, base_in_model, plugins_of

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


def plugins(text: str) -> dict[str, Plugin]:
    return {plugin.name: plugin for plugin in plugins_of(ET.fromstring(text))}


def plugin(own: str) -> Plugin:
    text = f'<robot><gazebo><plugin filename="libx.so">{own}</plugin></gazebo></robot>'
    return plugins(text)["x"]


def test_plugins_of_a_urdf() -> None:
    found = plugins(URDF)

    assert list(found) == ["gazebo_ros_diff_drive", "gazebo_ros_p3d", "gazebo_ros_laser"]
    laser = found["gazebo_ros_laser"]
    assert laser.link == "base"
    assert laser.sensor.number("update_rate", default=0) == 5
    assert laser.sensor.number("ray/scan/horizontal/samples", default=0) == 360
    assert found["gazebo_ros_diff_drive"].link == ""


def test_plugins_of_an_sdf() -> None:
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


@pytest.mark.parametrize(
    ("own", "names"),
    [
        ("<jointName>a, b</jointName>", ("a", "b")),
        ("<jointName>a</jointName><jointName>b c</jointName>", ("a", "b", "c")),
        ("<jointName/>", ()),
    ],
)
def test_lists_are_of_tags_or_of_words(own: str, names: tuple[str, ...]) -> None:
    assert plugin(own).own.texts("jointName") == names


@pytest.mark.parametrize(
    ("own", "is_set"),
    [("<f>true</f>", True), ("<f> 1 </f>", True), ("<f>False</f>", False), ("<f/>", True), ("", True)],
)
def test_flags(own: str, is_set: bool) -> None:
    assert plugin(own).own.flag("f", default=True) is is_set


def test_what_is_no_number_is_as_if_it_were_not_there() -> None:
    assert plugin("<updateRate>fast</updateRate>").own.number("updateRate", default=7.0) == 7.0


def test_without_an_element_all_is_as_by_default() -> None:
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

"""The tables of tags of robots, plugins and sensors: what is lost, and what has no effect."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from sim_action.ros.ros1 import plugin_tags
from sim_action.ros.ros1.gazebo_plugins import PLUGINS, plugins_of
from sim_action.ros.ros1.launch.overlay import PACKAGE_ROOT
from sim_action.ros.ros1.plugin_tags import GAZEBO_TAGS, PLUGIN_TAGS, lost_plugin_tags, lost_robot_tags
from sim_action.world.world_files.tags import Row
from tests.ros.ros1 import robotis

PACKAGES = Path(PACKAGE_ROOT) / "sim_action/ros/ros1/launch/packages"
BURGER = PACKAGES / "turtlebot3_description/urdf/turtlebot3_burger.urdf.xacro"
NOISE = "<imu><angular_velocity><x><noise><mean>0</mean><stddev>{}</stddev></noise></x></angular_velocity></imu>"


def lost(plugin: str, tags: str = "", sensor: str | None = None) -> list[str]:
    """The lost tags of a plugin, in a sensor if `sensor` is given."""
    text = f'<plugin name="p" filename="lib{plugin}.so">{tags}</plugin>'
    inside = text if sensor is None else f'<sensor name="s">{sensor}{text}</sensor>'
    robot = ET.fromstring(f'<robot name="r"><gazebo reference="base">{inside}</gazebo></robot>')
    return [message for plugin in plugins_of(robot) for message in lost_plugin_tags(plugin)]


def test_every_supported_plugin_has_a_table() -> None:
    assert set(PLUGIN_TAGS) == set(PLUGINS)


def tables() -> list[tuple[str, Row]]:
    sensors = [table for group in plugin_tags._SENSOR_TAGS.values() for table in group.values()]
    return [(name, row) for table in (*PLUGIN_TAGS.values(), GAZEBO_TAGS, *sensors) for name, row in table.items()]


def test_every_row_that_is_not_read_has_a_reason() -> None:
    for name, row in tables():
        assert bool(row.reason) == (row.effect != "read"), name
        assert not row.neutral or row.effect == "lost", name


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
        ("<updateRate>200</updateRate>", "100 times per second at most"),
        ("<comandTopic>cmd</comandTopic>", "did you mean 'commandTopic'?"),
    ],
)
def test_a_tag_of_a_drive_that_is_not_simulated_is_lost(tags: str, message: str) -> None:
    (found,) = lost("gazebo_ros_diff_drive", tags)
    assert message in found
    assert "gazebo_ros_diff_drive" in found


@pytest.mark.parametrize(
    "tags",
    [
        "<odometrySource>world</odometrySource><odometrySource>1</odometrySource>",
        "<publishWheelTF>0</publishWheelTF><publishWheelJointState>true</publishWheelJointState>",
        "<updateRate>100</updateRate>",
        "<updateRate>often</updateRate>",
        "<updateRate>30</updateRate><rosDebugLevel>na</rosDebugLevel><alwaysOn>1</alwaysOn>",
    ],
)
def test_a_tag_without_an_effect_is_not_lost(tags: str) -> None:
    assert lost("gazebo_ros_diff_drive", tags) == []


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
        ("<update_rate>200</update_rate>", 1),
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
        ("<selfCollide value='true'/>", 1),
        ("<mu>0.2</mu>", 1),
    ],
)
def test_tags_of_gazebo_in_a_urdf(tags: str, count: int) -> None:
    robot = ET.fromstring(f'<robot name="r"><gazebo reference="base">{tags}</gazebo></robot>')
    assert len(list(lost_robot_tags(robot))) == count

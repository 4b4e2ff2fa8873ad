"""Plugins of inertial measurement units."""

from __future__ import annotations

from collections.abc import Iterable

from sensor_msgs.msg import Imu as ImuMessage

from sim_action.core.geometry import Pose
from sim_action.ros.ros1.gazebo_tags import Plugin
from sim_action.ros.ros1.node.devices import TICKS, Device, Wiring, period_of
from sim_action.ros.ros1.node.messages import header
from sim_action.ros.ros1.node.sensor_messages import imu_message
from sim_action.sensors.imu import Imu
from sim_action.sensors.mounting import MountedSensor
from sim_action.state.observation import Observation
from sim_action.state.readings import ImuReading


def open_imu(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """gazebo_ros_imu, which names its link, and gazebo_ros_imu_sensor, which is of a sensor on one."""
    topic = plugin.topic("topicName", default="imu")
    link = plugin.own.text("bodyName", default=plugin.link or wiring.model.root)
    frame = plugin.own.text("frameName", default=link)
    rate = plugin.own.number("updateRate", "updateRateHZ", default=plugin.sensor.number("update_rate", default=0.0))
    sender, period = wiring.sender(topic, ImuMessage), period_of(rate)
    noise = plugin.own.number("gaussianNoise", default=0.0)
    sensor = MountedSensor(
        wiring.heard(Imu(gyro_noise=noise, accelerometer_noise=noise), sender),
        f"imu {topic}",
        link,
        Pose(),
        TICKS / period,
        trace=False,
    )

    def publish(seconds: float, seen: Observation) -> None:
        reading = seen.sensors[sensor.name]
        if not isinstance(reading, ImuReading):
            return
        sender.send(imu_message(reading, header(seconds, frame)))

    yield Device(period, (sender,), publish, sensor)

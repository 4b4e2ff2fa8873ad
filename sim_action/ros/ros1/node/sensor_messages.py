"""What sensors tell, as messages of ROS; their headers say when, and in which frame."""

from __future__ import annotations

from geometry_msgs.msg import Quaternion, Vector3
from sensor_msgs.msg import Image, Imu, LaserScan
from std_msgs.msg import Header

from sim_action.state.readings import CameraImage, ImuReading, LidarScan


def scan_message(reading: LidarScan, head: Header, period: float) -> LaserScan:
    """A scan; `period`: s from one to the next."""
    return LaserScan(
        header=head,
        angle_min=reading.angle_min,
        angle_max=reading.angle_min + reading.angle_increment * (len(reading.ranges) - 1),
        angle_increment=reading.angle_increment,
        scan_time=period,
        range_min=reading.range_min,
        range_max=reading.range_max,
        ranges=reading.ranges.tolist(),
    )


def imu_message(reading: ImuReading, head: Header) -> Imu:
    """How a sensor turns and accelerates."""
    return Imu(
        header=head,
        orientation=Quaternion(*reading.orientation_xyzw),
        angular_velocity=Vector3(*reading.angular_velocity_xyz),
        linear_acceleration=Vector3(*reading.linear_acceleration_xyz),
    )


def image_message(reading: CameraImage, head: Header) -> Image:
    """A picture in colours, without its depths."""
    height, width, colours = reading.rgb.shape
    data = reading.rgb.tobytes()
    return Image(header=head, height=height, width=width, encoding="rgb8", step=width * colours, data=data)

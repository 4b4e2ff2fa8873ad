"""The topic /robot_description: the collision shapes of the robot as URDF without references to files."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree as ET

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.ros2.messages import CdrForm
from sim_action.recording.export.ros2.topics import Topic, nanoseconds
from sim_action.robot.model.robot_model import Joint, Link, RobotModel, Shape
from sim_action.sensors.rendering import ROBOT


def robot_description(run: RecordedRun) -> Iterator[Topic]:
    """Yield /robot_description with a single message (in ROS it is transient local)."""
    message = CdrForm().string(urdf_of(run.scene.model)).filled(1)
    yield Topic("/robot_description", "std_msgs/String", nanoseconds(run.trace.time[:1]), message)


def urdf_of(model: RobotModel) -> str:
    """Return a model as URDF; a mesh becomes its bounding box."""
    robot = ET.Element("robot", name=model.name or "robot")
    for link in model.links:
        _add_link(robot, link)
    for joint in model.joints:
        _add_joint(robot, joint)
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode") + "\n"


def _add_link(robot: ET.Element, link: Link) -> None:
    element = ET.SubElement(robot, "link", name=link.name)
    for shape in link.collisions:
        if shape.kind == "plane":
            continue
        for purpose in ("visual", "collision"):
            _add_shape(ET.SubElement(element, purpose), shape)
        material = ET.SubElement(element.findall("visual")[-1], "material", name="grey")
        ET.SubElement(material, "color", rgba=_numbers(*ROBOT, 1.0))


def _add_shape(element: ET.Element, shape: Shape) -> None:
    (ax, ay, az), (bx, by, bz) = shape.lower_xyz, shape.upper_xyz
    middle = geometry.compose(shape.pose, Pose(((ax + bx) / 2, (ay + by) / 2, (az + bz) / 2)))
    _add_origin(element, middle)
    solid = ET.SubElement(element, "geometry")
    if shape.kind == "sphere":
        ET.SubElement(solid, "sphere", radius=_numbers((bx - ax) / 2))
    elif shape.kind == "cylinder":
        ET.SubElement(solid, "cylinder", radius=_numbers((bx - ax) / 2), length=_numbers(bz - az))
    else:
        ET.SubElement(solid, "box", size=_numbers(bx - ax, by - ay, bz - az))


def _add_joint(robot: ET.Element, joint: Joint) -> None:
    element = ET.SubElement(robot, "joint", name=joint.name, type=_type(joint))
    _add_origin(element, joint.origin)
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=joint.child)
    if not joint.moves:
        return
    ET.SubElement(element, "axis", xyz=_numbers(*joint.axis_xyz))
    if joint.mimic is not None:
        followed = ET.SubElement(element, "mimic", joint=joint.mimic.joint)
        followed.set("multiplier", _numbers(joint.mimic.multiplier))
        followed.set("offset", _numbers(joint.mimic.offset))
    if joint.lower is not None and joint.upper is not None:
        limit = ET.SubElement(element, "limit", lower=_numbers(joint.lower), upper=_numbers(joint.upper))
        limit.set("effort", _numbers(joint.max_effort or 0.0))
        limit.set("velocity", _numbers(joint.max_velocity or 0.0))


def _type(joint: Joint) -> str:
    is_free = joint.type == "ball" or (joint.type == "revolute" and (joint.lower is None or joint.upper is None))
    return "continuous" if is_free else joint.type


def _add_origin(element: ET.Element, pose: Pose) -> None:
    turned = geometry.rpy_from_quaternion(pose.orientation_xyzw)
    ET.SubElement(element, "origin", xyz=_numbers(*pose.position_xyz), rpy=_numbers(*turned))


def _numbers(*values: float) -> str:
    return " ".join(f"{value + 0.0:.9g}" for value in values)

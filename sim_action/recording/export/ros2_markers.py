"""Topics that are drawn: /robot_description (a URDF without references to files), /world with the bodies, /contacts."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Final, Literal
from xml.etree import ElementTree as ET

import numpy as np

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, field, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.meshes.convex_hull import hull_faces
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.recording.export.ros2_messages import CdrForm, Frames, Topic, nanoseconds, stamps
from sim_action.robot.model.robot_model import Joint, Link, RobotModel, Shape
from sim_action.sensors.rendering import PALETTE, ROBOT
from sim_action.world import parts

Kind = Literal["cube", "sphere", "cylinder", "sphere list", "triangle list"]
_TYPES: Final[dict[Kind, int]] = {"cube": 1, "sphere": 2, "cylinder": 3, "sphere list": 7, "triangle list": 11}


@dataclass(frozen=True, slots=True)
class Marker:
    """The fixed fields of a visualization_msgs/Marker; its time stamp and its points are gaps."""

    kind: Kind
    frame: str
    group: str  # the namespace, which identifies a marker together with `number`
    number: int = 0
    pose: Pose = field(default_factory=Pose)
    scale: Vector3 = (1.0, 1.0, 1.0)  # the size in m: diameters of a sphere; diameters and height of a cylinder
    colour: Vector3 = (0.8, 0.8, 0.8)
    points: int = 0  # the number of points
    lifetime: int = 0  # the lifetime in s; 0 means forever

    def add_to(self, form: CdrForm) -> None:
        """Append the marker to a message, with gaps for 2 numbers of the time and for 3 numbers of each point."""
        form.gap("<i4", 2).string(self.frame).string(self.group).fixed("<i4", self.number, _TYPES[self.kind], 0)
        form.fixed("<f8", *self.pose.position_xyz, *self.pose.orientation_xyzw, *self.scale)
        form.fixed("<f4", *self.colour, 1.0).fixed("<i4", self.lifetime, 0).fixed("u1", not self.lifetime)
        form.fixed("<u4", self.points).gap("<f8", 3 * self.points)
        form.fixed("<u4", 0)  # colors
        form.string("").fixed("<i4", 0, 0).string("").string("").fixed("<u4", 0, 0)  # texture, uv_coordinates
        form.string("").string("").string("").fixed("<u4", 0).fixed("u1", 0)  # text, mesh_resource, mesh_file


_NO_POINTS: Final = np.empty((0, 3))


def world_markers(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """Yield /world: one message with a marker for each part of each body; nothing for an empty world."""
    time = run.trace.time[:1]
    markers = list(_world_markers(run, frames))
    form = CdrForm().fixed("<u4", len(markers))
    columns = list[FloatArray]()
    for marker, points in markers:
        marker.add_to(form)
        columns += [stamps(time).astype(np.float64), *([points[None]] if len(points) else [])]
    if markers:
        yield Topic(
            "/world", "visualization_msgs/MarkerArray", nanoseconds(time), form.filled(1, *columns), is_latched=True
        )


def _world_markers(run: RecordedRun, frames: Frames) -> Iterator[tuple[Marker, FloatArray]]:
    """Yield markers and their points, (3 T, 3) for T triangles."""
    for place, body in enumerate(run.scene.world.objects):
        colour = body.color or PALETTE[place % len(PALETTE)]
        for number, part in enumerate(run.scene.parts_of(body)):
            yield _part_marker(
                part, Marker("triangle list", frames.bodies[body.name], body.name, number, colour=colour)
            )


def _part_marker(part: parts.Part, blank: Marker) -> tuple[Marker, FloatArray]:
    if isinstance(part, parts.BoxPart):
        return replace(blank, kind="cube", pose=part.pose, scale=part.size_xyz), _NO_POINTS
    if isinstance(part, parts.CylinderPart):
        across = 2 * part.radius
        return replace(blank, kind="cylinder", pose=part.pose, scale=(across, across, part.height)), _NO_POINTS
    if isinstance(part, parts.SpherePart):
        return replace(blank, kind="sphere", pose=part.pose, scale=(2 * part.radius,) * 3), _NO_POINTS
    points = _triangle_corners(part)
    return replace(blank, points=len(points)), points


def _triangle_corners(part: parts.HullPart | parts.GridPart | parts.SurfacePart) -> FloatArray:
    """Return (3 T, 3) the corners of T triangles."""
    if isinstance(part, parts.HullPart):
        points = np.array(part.points_xyz)
        faces = hull_faces(points - points.mean(axis=0))
        return _NO_POINTS if faces is None else points[faces].reshape(-1, 3)
    surface = parts.grid_surface(part) if isinstance(part, parts.GridPart) else part
    return surface.points_xyz[surface.triangles].reshape(-1, 3)


_CONTACT_SIZE: Final = (0.04, 0.04, 0.04)
_CONTACT_COLOUR: Final = (0.9, 0.1, 0.1)
_CONTACT_LIFETIME_S: Final = 1
ContactPoints = dict[tuple[str, str], list[Vector3]]  # link and body -> their contact points in m, world frame

ContactKey = tuple[tuple[str, str, int], ...]
"""Link, body and number of contact points, for each pair; messages with the same key have the same size."""


def contacts(run: RecordedRun, frames: Frames) -> Iterator[Topic]:
    """Yield /contacts: a message for each moment with contacts since the moment before; nothing without contacts."""
    alike = defaultdict[ContactKey, list[tuple[int, ContactPoints]]](list)
    for moment, points in _by_moment(run):
        shape = tuple((*pair, len(points[pair])) for pair in sorted(points))
        alike[shape].append((moment, points))
    times = list[int]()
    messages = list[bytes]()
    for shape, some in alike.items():
        time = run.trace.time[[moment for moment, _ in some]]
        times += nanoseconds(time).tolist()
        columns = [column for *pair, _ in shape for column in _contact_columns((pair[0], pair[1]), time, some)]
        messages += _contacts_form(shape, frames).filled(len(some), *columns)
    if messages:
        yield Topic("/contacts", "visualization_msgs/MarkerArray", np.array(times, dtype=np.int64), messages)


def _contact_columns(
    pair: tuple[str, str], time: np.ndarray, some: list[tuple[int, ContactPoints]]
) -> Iterator[np.ndarray]:
    yield stamps(time)
    yield np.array([points[pair] for _, points in some])


def _contacts_form(shape: ContactKey, frames: Frames) -> CdrForm:
    form = CdrForm().fixed("<u4", len(shape))
    for link, body, count in shape:
        group = f"{link} / {body}"
        Marker(
            "sphere list",
            frames.map,
            group,
            0,
            scale=_CONTACT_SIZE,
            colour=_CONTACT_COLOUR,
            points=count,
            lifetime=_CONTACT_LIFETIME_S,
        ).add_to(form)
    return form


def _by_moment(run: RecordedRun) -> Iterator[tuple[int, ContactPoints]]:
    """Yield moments, and the latest contact points of each pair since the moment before."""
    touches, time = run.trace.contacts, run.trace.time
    moments = np.searchsorted(time, np.array([touch.time for touch in touches]) - TIME_EPSILON_S).clip(
        max=len(time) - 1
    )
    pairs_by_moment = defaultdict[int, dict[tuple[str, str], tuple[float, list[Vector3]]]](dict)
    for moment, touch in zip(moments.tolist(), touches, strict=True):
        pairs, pair = pairs_by_moment[moment], (touch.link, touch.body)
        if pair not in pairs or pairs[pair][0] < touch.time:
            pairs[pair] = (touch.time, [])
        pairs[pair][1].append(touch.position_xyz)
    return (
        (moment, {pair: points for pair, (_, points) in pairs.items()}) for moment, pairs in pairs_by_moment.items()
    )


def robot_description(run: RecordedRun) -> Iterator[Topic]:
    """Yield /robot_description with a single message (in ROS it is transient local)."""
    message = CdrForm().string(urdf_of(run.scene.model)).filled(1)
    yield Topic("/robot_description", "std_msgs/String", nanoseconds(run.trace.time[:1]), message, is_latched=True)


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
    is_free = joint.type == "ball" or (joint.type == "revolute" and (joint.lower is None or joint.upper is None))
    element = ET.SubElement(robot, "joint", name=joint.name, type="continuous" if is_free else joint.type)
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


def _add_origin(element: ET.Element, pose: Pose) -> None:
    turned = geometry.rpy_from_quaternion(pose.orientation_xyzw)
    ET.SubElement(element, "origin", xyz=_numbers(*pose.position_xyz), rpy=_numbers(*turned))


def _numbers(*values: float) -> str:
    return " ".join(f"{value + 0.0:.9g}" for value in values)

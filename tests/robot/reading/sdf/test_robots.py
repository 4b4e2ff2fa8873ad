"""Random robots, written once as URDF and once as SDF, are the same robot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from random import Random
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import Joint, RobotModel
from sim_action.robot.reading.urdf import read_urdf
from tests.robot.reading.sdf.models import load
from tests.ros_workspace import written
from tests.soak import examples

TYPES = ("revolute", "continuous", "prismatic", "fixed")


MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
Moments = dict[str, float]


@dataclass(frozen=True)
class Part:
    """A link and the joint that it hangs on."""

    parent: int
    kind: str
    origin: Pose  # of the link, in its parent's frame
    axis: Vector3  # in the link's frame
    centre: Pose  # of its mass and of a ball, in the link's frame
    mass: float
    moments: Moments  # kg m^2, about axes through the centre, askew to it
    joint: Pose  # the frame of the SDF's joint in the link's; it lies on the axis


def random_pose(source: Random) -> Pose:
    rpy = [source.uniform(-math.pi, math.pi) for _ in range(3)]
    if source.random() < 0.3:
        rpy = [source.choice((0, math.pi / 2, -math.pi / 2, math.pi)) for _ in range(3)]
    x, y, z = (source.uniform(-2, 2) for _ in range(3))
    return Pose((x, y, z), geometry.quaternion_from_rpy(*rpy))


def random_robot(source: Random, *, on_axis: bool = True) -> list[Part]:
    return [random_part(source, n, on_axis=on_axis) for n in range(source.randint(2, 7))]


def random_part(source: Random, number: int, *, on_axis: bool) -> Part:
    axis = geometry.rotate(random_pose(source).orientation_xyzw, (1.0, 0.0, 0.0))
    along = source.uniform(-1, 1)
    joint = random_pose(source)
    if on_axis:
        joint = Pose((axis[0] * along, axis[1] * along, axis[2] * along), joint.orientation_xyzw)
    parent, kind = source.randrange(max(1, number)), source.choice(TYPES)
    mass = source.uniform(0.1, 5)
    return Part(parent, kind, random_pose(source), axis, random_pose(source), mass, random_moments(source), joint)


def random_moments(source: Random) -> Moments:
    """Of a ball with three points on it that weigh something: there is such a body, and none of it needs mending."""
    points = np.array([[source.uniform(-1, 1) for _ in range(3)] for _ in range(3)])
    tensor = sum((np.dot(point, point) * np.eye(3) - np.outer(point, point) for point in points), 0.1 * np.eye(3))
    return {name: float(tensor["xyz".index(name[1]), "xyz".index(name[2])]) for name in MOMENTS}


def numbers(*values: float) -> str:
    return " ".join(map(repr, values))


def in_model(parts: list[Part], number: int) -> Pose:
    """Of a link: the root is where its origin says, too."""
    part = parts[number]
    return geometry.compose(in_model(parts, part.parent), part.origin) if number else part.origin


def urdf_text(parts: list[Part]) -> str:
    lines = ['<robot name="m">']
    for number, part in enumerate(parts):
        origin = urdf_origin(part.centre)
        stated = " ".join(f'{name}="{moment!r}"' for name, moment in part.moments.items())
        inertial = f'<inertial>{origin}<mass value="{part.mass!r}"/><inertia {stated}/></inertial>'
        ball = f'<collision>{origin}<geometry><sphere radius="0.1"/></geometry></collision>'
        lines.append(f'<link name="l{number}">{inertial}{ball}</link>')
        if number:
            ends = f'<parent link="l{part.parent}"/><child link="l{number}"/>{urdf_origin(part.origin)}'
            axis = f'<axis xyz="{numbers(*part.axis)}"/><limit lower="-1" upper="2"/>'
            lines.append(f'<joint name="j{number}" type="{part.kind}">{ends}{axis}</joint>')
    return "\n".join([*lines, "</robot>"])


def urdf_origin(pose: Pose) -> str:
    rpy = geometry.rpy_from_quaternion(pose.orientation_xyzw)
    return f'<origin xyz="{numbers(*pose.position_xyz)}" rpy="{numbers(*rpy)}"/>'


def sdf_text(source: Random, parts: list[Part]) -> str:
    """Poses are given relative to whatever there is, in any of their formats; elements stand in any order."""
    poses = {"__model__": Pose(), "": Pose()}
    lines = []
    for number, part in enumerate(parts):
        here = in_model(parts, number)
        placed = f"<pose{sdf_pose(source, poses, here)}"
        poses[f"l{number}"] = here
        centre = f"<pose>{rpy_pose(part.centre)}</pose>"
        inertial = f"<inertial>{centre}<mass>{part.mass!r}</mass>{sdf_inertia(part)}</inertial>"
        ball_pose = f"<pose{sdf_pose(source, poses, geometry.compose(here, part.centre), empty=False)}"
        ball = f"<collision name='c'>{ball_pose}<geometry><sphere><radius>0.1</radius></sphere></geometry></collision>"
        lines.append(f'<link name="l{number}">{placed}{inertial}{ball}</link>')
        if number:
            lines.append(sdf_joint(source, poses, part, number, here))
        where = random_pose(source)
        attached = f'name="f{number}" attached_to="l{number}"'
        lines.append(f"<frame {attached}><pose{sdf_pose(source, poses, where, empty=False)}</frame>")
        poses[f"f{number}"] = where
    source.shuffle(lines)
    return '<sdf version="1.9"><model name="m">' + "\n".join(lines) + "</model></sdf>"


def sdf_inertia(part: Part) -> str:
    return f"<inertia>{''.join(f'<{name}>{moment!r}</{name}>' for name, moment in part.moments.items())}</inertia>"


def sdf_joint(source: Random, poses: dict[str, Pose], part: Part, number: int, here: Pose) -> str:
    there = geometry.compose(here, part.joint)
    pose = f"<pose>{rpy_pose(part.joint)}</pose>"
    if source.random() < 0.5:
        pose = f"<pose{sdf_pose(source, poses, there, empty=False)}"
    frame = source.choice(("", *(name for name in poses if name)))
    seen_from = there if not frame else poses[frame]
    in_root = geometry.rotate(here.orientation_xyzw, part.axis)
    axis = geometry.rotate(geometry.conjugate(seen_from.orientation_xyzw), in_root)
    expressed = f' expressed_in="{frame}"' if frame else ""
    limit = "<limit><lower>-1</lower><upper>2</upper></limit>"
    poses[f"j{number}"] = there
    ends = f"<parent>l{part.parent}</parent><child>l{number}</child>"
    inside = f"<axis><xyz{expressed}>{numbers(*axis)}</xyz>{limit}</axis>"
    return f'<joint name="j{number}" type="{part.kind}">{ends}{pose}{inside}</joint>'


def sdf_pose(source: Random, poses: dict[str, Pose], pose: Pose, *, empty: bool = True) -> str:
    """The rest of a <pose> element; `empty`: whether no relative_to means the model's frame."""
    frame = source.choice([name for name in poses if name or empty])
    inner = geometry.compose(geometry.inverse(poses[frame]), pose)
    attribute = f' relative_to="{frame}"' if frame else ""
    if source.random() < 0.5:
        text = f"{numbers(*inner.position_xyz)} {numbers(*inner.orientation_xyzw)}"
        return f'{attribute} rotation_format="quat_xyzw">{text}</pose>'
    return f"{attribute}>{rpy_pose(inner)}</pose>"


def rpy_pose(pose: Pose) -> str:
    return f"{numbers(*pose.position_xyz)} {numbers(*geometry.rpy_from_quaternion(pose.orientation_xyzw))}"


def assert_same_pose(first: Pose, second: Pose) -> None:
    difference = geometry.compose(geometry.inverse(first), second)
    assert difference.position_xyz == pytest.approx((0, 0, 0), abs=1e-9)
    assert difference.orientation_xyzw[:3] == pytest.approx((0, 0, 0), abs=1e-9)


def inertias(model: RobotModel) -> dict[str, tuple[Pose, NDArray[np.float64]]]:
    """Of each link: the frame of its inertia in its own, and the tensor (3, 3) along the axes of the link."""
    found = {}
    for link in ET.fromstring(model.urdf).iter("link"):
        origin, inertia = link.find("inertial/origin"), link.find("inertial/inertia")
        assert origin is not None
        assert inertia is not None
        x, y, z, *rpy = (float(word) for name in ("xyz", "rpy") for word in origin.attrib[name].split())
        pose = Pose((x, y, z), geometry.quaternion_from_rpy(*rpy))
        found[link.attrib["name"]] = pose, in_link(pose, {name: float(inertia.attrib[name]) for name in MOMENTS})
    return found


def in_link(pose: Pose, moments: Moments) -> NDArray[np.float64]:
    tensor = np.array([[moments["i" + "".join(sorted(row + column))] for column in "xyz"] for row in "xyz"])
    axes = np.array([geometry.rotate(pose.orientation_xyzw, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]).T
    turned: NDArray[np.float64] = axes @ tensor @ axes.T
    return turned


@given(seed=st.integers(0, 2**32))
@examples(50)
def test_a_robot_is_the_same_in_both_formats(seed: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    source, folder = Random(seed), tmp_path_factory.getbasetemp()
    parts = random_robot(source)
    first = read_urdf(written(folder / "robot.urdf", urdf_text(parts)))
    second = load(folder, sdf_text(source, parts))
    assert set(first.links_by_name) == set(second.links_by_name)
    for number, part in enumerate(parts):
        one, other = first.links_by_name[f"l{number}"], second.links_by_name[f"l{number}"]
        assert one.mass == other.mass == part.mass
        assert_same_pose(link_poses(first, {})[one.name], link_poses(second, {})[other.name])
        assert_same_pose(one.collisions[0].pose, other.collisions[0].pose)
        (centre, tensor), (other_centre, other_tensor) = inertias(first)[one.name], inertias(second)[one.name]
        assert centre.position_xyz == pytest.approx(other_centre.position_xyz, abs=1e-9)
        assert tensor == pytest.approx(other_tensor, abs=1e-9)
        assert tensor == pytest.approx(in_link(part.centre, part.moments), abs=1e-9)
    for joint in first.joints:
        assert_same_joint(joint, second.joints_by_name[joint.name])


def assert_same_joint(one: Joint, other: Joint) -> None:
    assert (one.type, one.parent, one.child) == (other.type, other.parent, other.child)
    if one.moves:
        assert (one.lower, one.upper) == (other.lower, other.upper)
        assert one.axis_xyz == pytest.approx(other.axis_xyz, abs=1e-9)


def turned(axis: Vector3, angle: float) -> Pose:
    x, y, z = (part * math.sin(angle / 2) for part in axis)
    return Pose(orientation_xyzw=(x, y, z, math.cos(angle / 2)))


def moved(kind: str, axis: Vector3, position: float) -> Pose:
    if kind == "prismatic":
        return Pose((axis[0] * position, axis[1] * position, axis[2] * position))
    return turned(axis, 0.0 if kind == "fixed" else position)


def balls_of_model(model: RobotModel, positions: list[float]) -> list[Vector3]:
    """Where the balls are in the base frame when joints have moved, as URDF has it."""
    frames = {model.root: Pose()}
    for number in range(1, len(model.links)):
        joint = model.joints_by_name[f"j{number}"]
        pose = geometry.compose(joint.origin, moved(joint.type, joint.axis_xyz, positions[number]))
        frames[joint.child] = geometry.compose(frames[joint.parent], pose)
    return [
        geometry.compose(frames[f"l{number}"], model.links_by_name[f"l{number}"].collisions[0].pose).position_xyz
        for number in range(len(model.links))
    ]


def balls_of_sdf(parts: list[Part], positions: list[float]) -> list[Vector3]:
    """The same as SDF has it: a child turns about the frame of its joint."""
    frames = [Pose()]
    for part, position in list(zip(parts, positions, strict=True))[1:]:
        axis = geometry.rotate(geometry.conjugate(part.joint.orientation_xyzw), part.axis)
        about_joint = geometry.compose(part.joint, moved(part.kind, axis, position))
        child = geometry.compose(geometry.compose(part.origin, about_joint), geometry.inverse(part.joint))
        frames.append(geometry.compose(frames[part.parent], child))
    return [geometry.compose(frame, part.centre).position_xyz for frame, part in zip(frames, parts, strict=True)]


@given(seed=st.integers(0, 2**32))
@examples(50)
def test_joints_anywhere_in_their_links_move_them_alike(seed: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    source = Random(seed)
    parts = random_robot(source, on_axis=False)
    model = load(tmp_path_factory.getbasetemp(), sdf_text(source, parts))
    positions = [source.uniform(-1, 2) for _ in parts]
    for one, other in zip(balls_of_model(model, positions), balls_of_sdf(parts, positions), strict=True):
        assert one == pytest.approx(other, abs=1e-9)

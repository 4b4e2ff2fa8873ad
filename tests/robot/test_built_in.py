"""The built-in robots: no findings, masses and inertias of their shapes, published figures, recognised drives."""

from __future__ import annotations

import math
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from sim_action import drives
from sim_action.core.geometry import Pose, compose, conjugate, rotate
from sim_action.core.workspace import Workspace
from sim_action.drives.ackermann import AckermannDrive
from sim_action.drives.wheels import centre_of_mass
from sim_action.robot.built_in import BUILT_IN, FOLDER
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from tests.robot.independent_readers import Matrix, turn_of_rpy


def model_of(name: str) -> RobotModel:
    return load_model(Robot(model=name), Workspace(FOLDER, FOLDER))


def numbers(element: ET.Element | None, name: str) -> Matrix:
    text = "0 0 0" if element is None else element.get(name, "0 0 0")
    return np.array([float(number) for number in text.split()])


def shape_figures(visual: ET.Element) -> tuple[float, Matrix, Matrix]:
    """The volume, the centre, and the inertia about the centre at a mass of 1 kg."""
    origin, shape = visual.find("origin"), visual.findall("geometry/*")[0]
    if shape.tag == "box":
        x, y, z = numbers(shape, "size")
        volume, moments = x * y * z, np.array([y * y + z * z, x * x + z * z, x * x + y * y]) / 12
    elif shape.tag == "cylinder":
        radius, length = float(shape.attrib["radius"]), float(shape.attrib["length"])
        across = (3 * radius**2 + length**2) / 12
        volume, moments = math.pi * radius**2 * length, np.array([across, across, radius**2 / 2])
    else:
        radius = float(shape.attrib["radius"])
        volume, moments = 4 / 3 * math.pi * radius**3, np.full(3, 0.4 * radius**2)
    turned = turn_of_rpy(*numbers(origin, "rpy"))
    return volume, numbers(origin, "xyz"), turned @ np.diag(moments) @ turned.T


def homogeneous(link: ET.Element, mass: float) -> tuple[Matrix, Matrix]:
    """The centre of mass, and the inertia about it, of a link whose shapes have one density."""
    shapes = [shape_figures(visual) for visual in link.iterfind("visual")]
    total = sum(volume for volume, _, _ in shapes)
    centre = sum((volume * at for volume, at, _ in shapes), np.zeros(3)) / total
    inertia = np.zeros((3, 3))
    for volume, at, unit in shapes:
        arm = at - centre
        inertia += mass * volume / total * (unit + arm @ arm * np.eye(3) - np.outer(arm, arm))
    return centre, inertia


@pytest.mark.parametrize("name", sorted(BUILT_IN))
def test_a_built_in_robot_has_no_findings_and_its_inertias_are_those_of_its_shapes(name: str) -> None:
    assert model_of(name).findings == ()
    for link in ET.parse(FOLDER / f"{name}.urdf").getroot().iterfind("link"):
        mass = link.find("inertial/mass")
        if mass is None:
            assert link.attrib["name"] == "world"
            continue
        tensor = link.find("inertial/inertia")
        assert tensor is not None
        values = {key: float(value) for key, value in tensor.attrib.items()}
        stated = [[values[f"i{min(a, b)}{max(a, b)}"] for b in "xyz"] for a in "xyz"]
        centre, inertia = homogeneous(link, float(mass.attrib["value"]))
        assert numbers(link.find("inertial/origin"), "xyz") == pytest.approx(centre, abs=2e-5), link.attrib["name"]
        assert stated == pytest.approx(inertia, rel=0.03, abs=1e-3 * inertia.max()), link.attrib["name"]


def test_drives_of_the_built_in_robots_are_recognised() -> None:
    found = {name: drives.recognise(model_of(name)) for name in BUILT_IN}
    assert {name: drive and drive.key for name, drive in found.items()} == {
        "turtlebot3_burger": "diff",
        "husky_a200": "skid",
        "f1tenth": "ackermann",
        "ur5e_gripper": None,
        "quadruped": None,
    }


def test_the_rover_has_the_size_and_mass_of_its_datasheet() -> None:
    model = model_of("husky_a200")
    assert model.mass == pytest.approx(50.0)
    assert centre_of_mass(model) == pytest.approx((0.0, 0.0, 0.04), abs=0.02)
    # At 1 m/s, and with a torque that climbs 45 degrees.
    for joint in model.moving_joints:
        assert joint.max_velocity == pytest.approx(1.0 / 0.1651, rel=0.001)
        assert joint.max_effort is not None
        assert joint.max_effort * 4 / 0.1651 > 50 * 9.81 * math.sin(math.radians(45))


def test_the_car_has_the_published_mass_distribution_and_turning_radius() -> None:
    model = model_of("f1tenth")
    assert model.mass == pytest.approx(3.74)
    x, y, z = centre_of_mass(model)
    assert (x, y, z + 0.05) == pytest.approx((0.17145, 0.0, 0.074), abs=2e-4)
    poses, moment = link_poses(model, model.positions({})), 0.0
    inertias = {link.get("name"): link.find("inertial/inertia") for link in ET.fromstring(model.urdf).iterfind("link")}
    for link in model.links:
        at = compose(poses[link.name], Pose(link.centre_of_mass_xyz)).position_xyz
        tensor = inertias[link.name]
        assert tensor is not None
        moment += float(tensor.attrib["izz"]) + (link.mass or 0.0) * ((at[0] - x) ** 2 + (at[1] - y) ** 2)
    assert moment == pytest.approx(0.04712, rel=0.01)
    drive = drives.recognise(model)
    assert isinstance(drive, AckermannDrive)
    assert drive.mobility(model).turning_radius == pytest.approx(0.3302 / math.tan(0.4189) + 0.13, rel=0.001)


# Universal Robots' article on DH parameters: mass in kg, and the centre of mass in the frame of the link's joint.
ARM = {
    "shoulder_link": (3.761, (0.0, -0.00193, 0.1625 - 0.02561)),
    "upper_arm_link": (8.058, (0.2125 - 0.425, 0.0, 0.11336)),
    "forearm_link": (2.846, (0.15 - 0.3922, 0.0, 0.0265)),
    "wrist_1_link": (1.37, (0.0, -0.01634, 0.1333 - 0.0018)),
    "wrist_2_link": (1.3, (0.0, 0.01634, 0.0997 - 0.0018)),
    "wrist_3_link": (0.365, (0.0, 0.0, 0.0996 - 0.001159)),
}


def test_the_arm_has_the_published_masses_and_is_fixed_to_the_world() -> None:
    model = model_of("ur5e_gripper")
    assert model.root == "world"
    links = model.links_by_name
    for name, (mass, centre) in ARM.items():
        assert links[name].mass == mass
        assert math.dist(links[name].centre_of_mass_xyz, centre) < 0.03, name
    assert sum(links[name].mass or 0.0 for name in ("base_link", *ARM)) == pytest.approx(20.6)
    assert sum(links[name].mass or 0.0 for name in ("tool0", "left_finger", "right_finger")) == pytest.approx(0.925)
    assert {joint.max_effort for joint in model.moving_joints if joint.type == "revolute"} == {150.0, 28.0}


def test_the_grippers_fingers_meet_in_the_middle_of_the_flange() -> None:
    model = model_of("ur5e_gripper")
    follower = model.joints_by_name["right_finger_joint"]
    assert follower.mimic is not None
    for position, width in ((0.0, 0.085), (0.0425, 0.0)):
        poses = link_poses(model, model.positions({"left_finger_joint": position}))
        flange = poses["tool0"]
        for side, sign in (("left", 1), ("right", -1)):
            away = np.subtract(poses[f"{side}_finger"].position_xyz, flange.position_xyz)
            x, y, _ = rotate(conjugate(flange.orientation_xyzw), (float(away[0]), float(away[1]), float(away[2])))
            assert (x, y) == pytest.approx((sign * width / 2, 0.0), abs=1e-9)


def test_the_quadruped_has_the_published_mass_lengths_motors_and_inertia() -> None:
    model = model_of("quadruped")
    assert model.mass == pytest.approx(9.0)
    moving = list(model.moving_joints)
    assert len(moving) == 12
    for joint in moving:
        ratio = 9.33 / 6 if joint.name.endswith("_knee") else 1.0
        assert joint.max_effort == pytest.approx(17 * ratio, rel=0.02)
        assert joint.max_velocity == pytest.approx(40 / ratio, rel=0.02)
    stretched = link_poses(model, model.positions({}))
    for end, x in (("front", 0.19), ("rear", -0.19)):
        for side, y in (("left", 0.111), ("right", -0.111)):
            assert stretched[f"{end}_{side}_foot"].position_xyz == pytest.approx((x, y, -0.209 - 0.175))
    # A positive thigh moves the knee backwards, and a negative knee brings the foot below the hip again.
    bent = link_poses(model, model.positions({"front_left_thigh": math.radians(40), "front_left_knee": -math.pi / 2}))
    assert bent["front_left_shank"].position_xyz[0] == pytest.approx(0.19 - 0.209 * math.sin(math.radians(40)))
    assert bent["front_left_foot"].position_xyz == pytest.approx((0.19, 0.111, -0.2726), abs=5e-4)
    # A positive hip turns the leg to the left.
    aside = link_poses(model, model.positions({"front_left_hip": 0.3}))
    assert aside["front_left_foot"].position_xyz[1] > 0.2
    trunk = ET.fromstring(model.urdf).find("link[@name='trunk']/inertial")
    assert trunk is not None
    tensor, mass = trunk.find("inertia"), trunk.find("mass")
    assert tensor is not None
    assert mass is not None
    per_kg = [float(tensor.attrib[key]) / float(mass.attrib["value"]) for key in ("ixx", "iyy", "izz")]
    assert per_kg == pytest.approx([moment / 3.3 for moment in (0.011253, 0.036203, 0.042673)], rel=0.02)

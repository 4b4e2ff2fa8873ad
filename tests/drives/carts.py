"""Models of carts, made by hand: a box with wheels, straight or steered."""

from __future__ import annotations

import dataclasses
import math

from sim_action.core.errors import Location
from sim_action.core.geometry import Pose, Vector3, quaternion_from_rpy
from sim_action.robot.model.robot_model import Joint, JointType, Link, Plugin, RobotModel, Shape

PLACE = Location("robot.urdf", 7)
STEERED = "left_steering_joint=a_steer right_steering_joint=b_steer"  # parameters of a plugin
Part = tuple[tuple[Joint, ...], tuple[Link, ...]]
RADIUS = 0.1
LYING = Pose(orientation_xyzw=quaternion_from_rpy(math.pi / 2, 0.0, 0.0))  # a cylinder's own axis is z; lying, it is y


def cart(*parts: Part, mass_ahead: float = 0.0) -> RobotModel:
    """A cart of 10 kg whose wheels weigh nothing that counts."""
    base = Link("base", 10.0, centre_of_mass_xyz=(mass_ahead, 0.0, 0.0))
    links = (base, *(link for _, links in parts for link in links))
    return RobotModel("cart", "", links, tuple(joint for joints, _ in parts for joint in joints), "")


def asking(model: RobotModel, plugin: str, parameters: str = "", title: str = "") -> RobotModel:
    """A model with one more plugin; `parameters`: such as "left_joint=a,b torque=5", "a,b" for one of the name each."""
    pairs = (written.split("=") for written in parameters.split())
    named = tuple((name, value) for name, values in pairs for value in values.split(","))
    return dataclasses.replace(model, plugins=(*model.plugins, Plugin(plugin, named, title, PLACE)))


def wheel(
    name: str,
    x: float,
    y: float,
    *,
    axis: Vector3 = (0.0, 1.0, 0.0),
    radius: float | None = RADIUS,
    parent: str = "base",
    beside: float = 0.0,
    fastest: float | None = None,
) -> Part:
    """A wheel at a place in the frame of its parent, whose tyre is `beside` m further to the left.

    `fastest`: the limit of its joint in rad/s.
    """
    lying = quaternion_from_rpy(0.0, math.pi / 2, 0.0) if abs(axis[0]) == 1 else LYING.orientation_xyzw
    tyre = Pose((0.0, beside, 0.0), lying)
    half = radius or RADIUS
    box = ((-half, -half, -0.02), (half, half, 0.02))
    shape = Shape("cylinder" if radius else "mesh", tyre, radius, *box)
    joint = Joint(name, "continuous", parent, f"{name}_link", Pose((x, y, half - RADIUS)), axis, max_velocity=fastest)
    return (joint,), (Link(f"{name}_link", None, (shape,)),)


def steered(
    name: str,
    x: float,
    y: float,
    *,
    limit: float | None = 0.6,
    rate: float | None = None,
    axis: Vector3 = (0.0, 0.0, 1.0),
    beside: float = 0.0,
) -> Part:
    """A wheel below a steering joint `name`_steer."""
    kind: JointType = "continuous" if limit is None else "revolute"
    lower, upper = (None, None) if limit is None else (-limit, limit)
    hinge, place = f"{name}_hinge", Pose((x, y, 0.0))
    steer = Joint(f"{name}_steer", kind, "base", hinge, place, axis, lower, upper, max_velocity=rate)
    joints, links = wheel(name, 0.0, 0.0, parent=hinge, beside=beside)
    return (steer, *joints), (Link(hinge, None), *links)


FOUR = (wheel("a", 0.2, 0.3), wheel("b", -0.2, 0.3), wheel("c", 0.2, -0.3), wheel("d", -0.2, -0.3))
"""Two wheels on the left, two on the right: wheelbase 0.4 m, separation 0.6 m."""
REAR = (wheel("c", 0.0, 0.2), wheel("d", 0.0, -0.2))
FRONT = (steered("a", 0.5, 0.2), steered("b", 0.5, -0.2))
CAR = cart(*REAR, *FRONT)

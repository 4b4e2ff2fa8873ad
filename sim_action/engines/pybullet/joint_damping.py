"""Keep damped joints stable: PyBullet applies the damping of a joint as a force that is constant within a step.

A damping d (N m s/rad) takes d/I of the joint's speed per second, I being the moment of inertia that it brakes. If it
takes more than twice the speed within one step, the joint swings back faster than before, and its speed grows without
limit. Models of arms have such joints: 5 N m s/rad on a forearm that rolls. PyBullet's default motors hide this,
because they hold each joint.

A turning joint gets the remedy of an implicit integrator: its parts get the moment of inertia d x dt about its axis in
addition. With it, no damping can turn a speed round. The speed at which damping and load balance is exact, and the
added inertia vanishes with the time step. A sliding joint cannot get a mass in the same way, because it would have a
weight. So its damping is limited, and a note reports it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pybullet
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.engines.pybullet.queries import link_pose
from sim_action.engines.pybullet.scene import BASE

Array = NDArray[np.float64]

_MAX_SHARE: Final = 0.5
"""The share of its speed that a joint may lose within one step by a damping that stays as it is."""


@dataclass(frozen=True, slots=True)
class _Damped:
    """A joint with damping. Attributes: the numbers of its links, its axis in the world frame, its damping in SI."""

    name: str
    child: int
    parent: int
    axis_xyz: Vector3
    damping: float
    is_sliding: bool


@dataclass(frozen=True, slots=True)
class _Mass:
    """A rigid group of links. Attributes: kg; m, world frame; kg m^2 about the centre of mass, world frame."""

    mass: float
    centre: Array
    tensor: Array

    def __add__(self, other: _Mass) -> _Mass:
        mass = self.mass + other.mass
        if not mass:
            return self
        apart = other.centre - self.centre
        between = self.mass * other.mass / mass * (apart @ apart * np.eye(3) - np.outer(apart, apart))
        centre = self.centre + other.mass / mass * apart
        return _Mass(mass, centre, self.tensor + other.tensor + between)


@dataclass(frozen=True, slots=True, eq=False)
class _Mechanism:
    """The masses and joints of a robot.

    Attributes:
        parents: link -> its parent link, in the order of the robot; without the base.
        fixed: the links that a fixed joint holds.
        masses: link -> its mass.
        held: True if the base is fixed.
    """

    parents: dict[int, int]
    fixed: frozenset[int]
    masses: dict[int, _Mass]
    held: bool

    def groups(self) -> dict[int, int]:
        """Return the number of the rigid group of each link: that of its first link."""
        groups = {BASE: BASE}
        for link, parent in self.parents.items():
            groups[link] = groups[parent] if link in self.fixed else link
        return groups

    def carried(self, link: int) -> float:
        """Return the mass of a link and all links that hang on it."""
        beyond = {link}
        for child, parent in self.parents.items():
            if parent in beyond:
                beyond.add(child)
        return sum(self.masses[one].mass for one in beyond)


def calm(client: int, robot: int, rate: float, *, bolted: bool) -> tuple[str, ...]:
    """Change the robot so that no damping adds energy; return a note for each joint that is damped less.

    :param rate: physics steps per second.
    """
    infos = [pybullet.getJointInfo(robot, number, client) for number in range(pybullet.getNumJoints(robot, client))]
    damped = [_read(client, robot, info) for info in infos if info[2] != pybullet.JOINT_FIXED and info[6] > 0]
    if not damped:
        return ()
    masses = {number: _mass(client, robot, number) for number in range(BASE, len(infos))}
    fixed = frozenset(info[0] for info in infos if info[2] == pybullet.JOINT_FIXED)
    parents = {info[0]: info[16] for info in infos}
    mechanism = _Mechanism(parents, fixed, masses, held=bolted or not masses[BASE].mass)
    for link, axis, moment in _added(mechanism, [joint for joint in damped if not joint.is_sliding], rate):
        _add_moment(client, robot, link, axis, moment)
    notes = []
    for joint in damped:
        if joint.is_sliding and 0 < (most := _most_damping(mechanism, joint, rate)) < joint.damping:
            pybullet.changeDynamics(robot, joint.child, jointDamping=most, physicsClientId=client)
            notes.append(_note(joint, most, rate))
    return tuple(notes)


def _read(client: int, robot: int, info: Sequence[Any]) -> _Damped:
    turned = link_pose(client, robot, info[0]).orientation_xyzw
    sliding = info[2] == pybullet.JOINT_PRISMATIC
    return _Damped(info[1].decode(), info[0], info[16], geometry.rotate(turned, info[13]), info[6], sliding)


def _mass(client: int, robot: int, link: int) -> _Mass:
    mass, _, moments, *_ = pybullet.getDynamicsInfo(robot, link, client)
    at = _inertial(client, robot, link)
    axes = np.array(pybullet.getMatrixFromQuaternion(at.orientation_xyzw)).reshape(3, 3)
    return _Mass(mass, np.array(at.position_xyz), axes @ np.diag(moments) @ axes.T)


def _inertial(client: int, robot: int, link: int) -> Pose:
    """Return the pose of the principal axes of a link, world frame."""
    if link == BASE:
        return Pose(*pybullet.getBasePositionAndOrientation(robot, client))
    return Pose(*pybullet.getLinkState(robot, link, computeForwardKinematics=1, physicsClientId=client)[:2])


def _added(mechanism: _Mechanism, turning: Sequence[_Damped], rate: float) -> Iterator[tuple[int, Vector3, float]]:
    """Yield the links that need a moment of inertia, each with the axis (world frame) and the moment in kg m^2.

    They are on both sides of the joints that together take too much speed of a rigid group of links.
    """
    groups = mechanism.groups()
    whole: dict[int, _Mass] = {}
    for link, group in groups.items():
        own = mechanism.masses[link]
        whole[group] = whole[group] + own if group in whole else own
    sides = [
        (joint, link, _moment(whole[groups[link]], joint.axis_xyz))
        for joint in turning
        for link in (joint.child, joint.parent)
        if not (mechanism.held and groups[link] == BASE)
    ]
    # Only a model that was not audited has a moment of 0.
    sides = [side for side in sides if side[2] > 0]
    shares = dict.fromkeys(whole, 0.0)
    for joint, link, moment in sides:
        shares[groups[link]] += joint.damping / rate / moment
    for joint, link, _ in sides:
        if shares[groups[link]] > _MAX_SHARE:
            yield link, joint.axis_xyz, joint.damping / rate


def _moment(body: _Mass, axis_xyz: Vector3) -> float:
    axis = np.array(axis_xyz)
    return float(axis @ body.tensor @ axis)


def _add_moment(client: int, robot: int, link: int, axis_xyz: Vector3, moment: float) -> None:
    """Add a moment of inertia about an axis (world frame) to a link, whose principal axes cannot be changed."""
    turned = _inertial(client, robot, link).orientation_xyzw
    along = np.square(geometry.rotate(geometry.conjugate(turned), axis_xyz))
    own = np.array(pybullet.getDynamicsInfo(robot, link, client)[2])
    # Each principal moment counts by the square of its share of the axis.
    more = moment * along / float(along @ along)
    pybullet.changeDynamics(robot, link, localInertiaDiagonal=(own + more).tolist(), physicsClientId=client)


def _most_damping(mechanism: _Mechanism, joint: _Damped, rate: float) -> float:
    """Return the largest damping in N s/m of a sliding joint that the masses on both sides allow."""
    mass = mechanism.carried(joint.child)
    if not mechanism.held:
        mass = min(mass, mechanism.carried(BASE) - mass)
    return _MAX_SHARE * mass * rate


def _note(joint: _Damped, most: float, rate: float) -> str:
    return (
        f"joint '{joint.name}' has a damping of {joint.damping:g} N s/m, but at {rate:g} Hz pybullet can simulate only "
        f"{most:.3g} N s/m; set physics.rate to {math.ceil(rate * joint.damping / most)} Hz for all of it"
    )

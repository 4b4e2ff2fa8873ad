"""Passive joints in PyBullet: ball joints, followers of other joints, the springs of joints, and their damping.

PyBullet starts each ball joint with a motor that holds it. It gives the orientation and the angular velocity of the
child link in the frame of its principal axes.

PyBullet solves motors and gears one after the other, again and again, and stops too early if a light joint with a motor
leads a heavy one: the heavy one sags. So the motor of a leader acts on the joint of its group with which this converges
best, with speed and effort converted by the gear, and all others are geared to that joint.

PyBullet applies the damping of a joint as a force that is constant within a step. A damping d (N m s/rad) takes d/I of
the joint's speed per second, I being the moment of inertia that it brakes. If it takes more than twice the speed within
one step, the joint swings back faster than before, and its speed grows without limit. Models of arms have such joints:
5 N m s/rad on a forearm that rolls. PyBullet's default motors hide this, because they hold each joint.

A turning joint gets the remedy of an implicit integrator: the links on both sides get a moment of inertia about its
axis in addition, d x dt if the other side is fixed, and twice as much if both can move. With it, no damping can reverse
a speed. The speed at which damping and load balance stays exact, and the added inertia vanishes with the time step.

A sliding joint cannot get a mass in the same way, because it would have a weight. So its damping is limited, and a note
reports it.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, Final, Self

import numpy as np
import pybullet
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.records import dataclass, replace
from sim_action.engines.pybullet.loaded_bodies import BASE
from sim_action.robot.model.robot_model import Joint, Mimic, RobotModel, ball_angles, ball_orientation

# A gear is stronger than any motor, and corrects most of its error within one step.
_GEAR_FORCE: Final = 1e5
_GEAR_CORRECTION: Final = 0.8
# The least and most iterations of the solver with gears; it stops as soon as nothing changes, but hardly with contacts.
# A leader that carries its follower needs more: this number over the share of an error that one iteration removes
# leaves less than 0.05 deg.
_GEARED_ITERATIONS: Final = 500, 200_000
_ITERATIONS_PER_SHARE: Final = 40
# The share if it cannot be computed.
_UNSURE_SHARE: Final = 0.002
_STILL: Final = {"targetVelocity": (0, 0, 0), "positionGain": 0, "velocityGain": 0, "force": (0, 0, 0)}


class BallJoints:
    """The ball joints of a robot."""

    def __init__(self, client: int, robot: int, joints: Mapping[str, int]) -> None:
        """`joints`: name of each ball joint -> its number."""
        self._client, self._robot, self._joints = client, robot, list(joints.values())
        self._axes = [pybullet.getDynamicsInfo(robot, joint, client)[4] for joint in self._joints]

    def release(self, positions: Sequence[float]) -> None:
        """Set the positions in rad, three for each joint, and switch the motors off."""
        for joint, axes, first in zip(self._joints, self._axes, range(0, len(positions), 3), strict=True):
            x, y, z = positions[first : first + 3]
            start = _turned(ball_orientation((x, y, z)), geometry.conjugate(axes))
            pybullet.resetJointStateMultiDof(self._robot, joint, start, physicsClientId=self._client)
            pybullet.setJointMotorControlMultiDof(
                self._robot,
                joint,
                pybullet.POSITION_CONTROL,
                targetPosition=start,
                **_STILL,
                physicsClientId=self._client,
            )

    def state(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return the positions in rad and the velocities in rad/s, three for each joint."""
        positions, velocities = list[float](), list[float]()
        states = pybullet.getJointStatesMultiDof(self._robot, self._joints, self._client)
        for (turned, angular, *_), axes in zip(states, self._axes, strict=True):
            positions += ball_angles(_turned(turned, axes))
            velocities += geometry.rotate(axes, angular)
        return positions, velocities


def _turned(rotation: geometry.Quaternion, frame: geometry.Quaternion) -> geometry.Quaternion:
    x, y, z = geometry.rotate(frame, rotation[:3])
    return (x, y, z, rotation[3])


def couple(client: int, robot: int, model: RobotModel, numbers: Mapping[str, int]) -> dict[str, Mimic]:
    """Couple joints to their leaders like gears without play.

    Return each leader whose motor acts on another joint -> that joint, with its gear to the leader. `numbers`: joint ->
    its number. The robot must be complete.
    """
    groups: dict[str, dict[str, Mimic]] = {}
    for joint in model.motor_joints:
        gear = model.gear(joint.name)
        groups.setdefault(gear.joint, {})[joint.name] = gear
    carriers: dict[str, Mimic] = {}
    # Another robot may need more.
    present = int(pybullet.getPhysicsEngineParameters(client)["numSolverIterations"])
    least, most = _GEARED_ITERATIONS
    iterations = max(least, present)
    for leader, group in groups.items():
        if len(group) == 1:
            continue
        carrier, share = leader, _UNSURE_SHARE
        if not model.balls:
            carrier, share = _carrier(client, robot, numbers, group, otherwise=leader)
        iterations = max(iterations, math.ceil(min(most, _ITERATIONS_PER_SHARE / share)))
        driven = group[carrier]
        if carrier != leader:
            carriers[leader] = replace(driven, joint=carrier)
        for name in group.keys() - {carrier}:
            ratio = group[name].multiplier / driven.multiplier
            joints = robot, numbers[name], robot, numbers[carrier]
            frames = (0, 0, 1), (0, 0, 0), (0, 0, 0)
            made = pybullet.createConstraint(*joints, pybullet.JOINT_GEAR, *frames, physicsClientId=client)
            # PyBullet holds the joint + gearRatio x carrier at the target.
            pybullet.changeConstraint(
                made,
                gearRatio=-ratio,
                relativePositionTarget=group[name].offset - ratio * driven.offset,
                maxForce=_GEAR_FORCE,
                erp=_GEAR_CORRECTION,
                physicsClientId=client,
            )
    pybullet.setPhysicsEngineParameter(numSolverIterations=iterations, physicsClientId=client)
    return carriers


def _carrier(
    client: int, robot: int, numbers: Mapping[str, int], group: Mapping[str, Mimic], *, otherwise: str
) -> tuple[str, float]:
    """Return the joint of a group on which the solver converges best if the motor acts on it.

    Also return the share of an error that one iteration then removes, in (0, 1].

    `otherwise`: the joint to return if PyBullet gives no mass matrix of the robot, for which it names no reason.
    """
    count = pybullet.getNumJoints(robot, client)
    moving = [number for number in range(count) if pybullet.getJointInfo(robot, number, client)[3] >= 0]
    states = pybullet.getJointStates(robot, moving, client)
    try:
        masses = np.array(pybullet.calculateMassMatrix(robot, [state[0] for state in states], physicsClientId=client))
    except (SystemError, pybullet.error):
        return otherwise, _UNSURE_SHARE
    # With a free base, its six motions come first.
    places = len(masses) - len(moving) + np.array([moving.index(numbers[name]) for name in group])
    mobility = np.linalg.inv(masses)[np.ix_(places, places)]
    ratios = np.array([gear.multiplier for gear in group.values()])

    def remainder(carrier: int) -> float:
        """Return the share of an error that remains after one iteration of Gauss and Seidel."""
        rows = np.eye(len(ratios))
        rows[:, carrier] = -ratios / ratios[carrier]
        rows[carrier, carrier] = 1.0
        coupled = rows @ mobility @ rows.T
        return float(np.abs(np.linalg.eigvals(np.linalg.solve(np.tril(coupled), np.triu(coupled, 1)))).max())

    least, carrier = min((remainder(place), place) for place in range(len(ratios)))
    return list(group)[carrier], max(1.0 - least, sys.float_info.epsilon)


class Springs:
    """The springs of joints, which PyBullet does not have: their efforts are applied at every step."""

    def __init__(self, client: int, robot: int, joints: Mapping[int, Joint]) -> None:
        """`joints`: number -> joint."""
        self._client, self._robot = client, robot
        self._springs = [(number, joint.stiffness, joint.spring_reference) for number, joint in joints.items()]
        self._numbers = list(joints)

    def added_to(self, efforts: Mapping[int, float]) -> dict[int, float]:
        """Return efforts by number of the joint, in N m or N, with the efforts of the springs added.

        The position before the step makes the integrator symplectic: a spring neither gains nor loses energy.
        """
        states = pybullet.getJointStates(self._robot, self._numbers, self._client)
        total = dict(efforts)
        for (number, stiffness, rest), (position, *_) in zip(self._springs, states, strict=True):
            total[number] = total.get(number, 0.0) + stiffness * (rest - position)
        return total


Array = NDArray[np.float64]
_MAX_SHARE: Final = 0.5  # the share of its speed that a joint may lose within one step by a damping that stays as it is


@dataclass(frozen=True, slots=True)
class _Damped:
    """A joint with damping. Attributes: numbers of the joint and its links, its axis in the world frame, SI damping."""

    name: str
    number: int
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
    """The rigid groups of links of a robot."""

    groups: dict[int, int]  # link -> the number of its group: its first link
    masses: dict[int, _Mass]  # number of a group -> its mass
    held: bool  # True if the base is fixed

    @classmethod
    def of(cls, parents: Mapping[int, int], fixed: Collection[int], masses: Mapping[int, _Mass], *, held: bool) -> Self:
        """Return the groups of links; `parents`: in order, without the base; `fixed`: held by a fixed joint."""
        groups = {BASE: BASE}
        for link, parent in parents.items():
            groups[link] = groups[parent] if link in fixed else link
        whole: dict[int, _Mass] = {}
        for link, group in groups.items():
            whole[group] = whole[group] + masses[link] if group in whole else masses[link]
        return cls(groups, whole, held)

    def sides(self, joint: _Damped) -> list[tuple[int, _Mass]]:
        """Return the links on both sides of a joint that can move, each with the mass of its group."""
        links = (link for link in (joint.child, joint.parent) if not (self.held and self.groups[link] == BASE))
        return [(link, self.masses[self.groups[link]]) for link in links]


def calm(client: int, robot: int, rate: float, *, bolted: bool) -> tuple[str, ...]:
    """Change the robot so that no damping adds energy, at `rate` steps a second; return notes on reduced damping."""
    infos = [pybullet.getJointInfo(robot, number, client) for number in range(pybullet.getNumJoints(robot, client))]
    stated = [info for info in infos if info[2] != pybullet.JOINT_FIXED and info[6] > 0]
    damped = [joint for info in stated for joint in _read(client, robot, info)]
    if not damped:
        return ()
    masses = {number: _mass(client, robot, number) for number in range(BASE, len(infos))}
    fixed = frozenset(info[0] for info in infos if info[2] == pybullet.JOINT_FIXED)
    parents = {info[0]: info[16] for info in infos}
    damped = [_between_masses(joint, parents, masses) for joint in damped]
    mechanism = _Mechanism.of(parents, fixed, masses, held=bolted or not masses[BASE].mass)
    for link, axis, moment in _added(mechanism, [joint for joint in damped if not joint.is_sliding], rate):
        _add_moment(client, robot, link, axis, moment)
    notes = []
    for joint, most in _limited(mechanism, [joint for joint in damped if joint.is_sliding], rate):
        pybullet.changeDynamics(robot, joint.number, jointDamping=most, physicsClientId=client)
        notes.append(_note(joint, most, rate))
    return tuple(notes)


def _read(client: int, robot: int, info: Sequence[Any]) -> list[_Damped]:
    """Return a joint; a ball joint is damped about three axes."""
    # PyBullet gives the axis in the frame of the principal axes.
    turned = _inertial(client, robot, info[0]).orientation_xyzw
    sliding = info[2] == pybullet.JOINT_PRISMATIC
    axes = geometry.AXES if info[2] == pybullet.JOINT_SPHERICAL else [geometry.rotate(turned, info[13])]
    return [_Damped(info[1].decode(), info[0], info[0], info[16], axis, info[6], sliding) for axis in axes]


def _between_masses(joint: _Damped, parents: Mapping[int, int], masses: Mapping[int, _Mass]) -> _Damped:
    """Return a joint between the nearest links with a mass: those between joints in series have none."""
    children = {parent: link for link, parent in parents.items()}
    child, parent = joint.child, joint.parent
    while not masses[child].mass and child in children:
        child = children[child]
    while parent != BASE and not masses[parent].mass:
        parent = parents[parent]
    return replace(joint, child=child, parent=parent)


def _mass(client: int, robot: int, link: int) -> _Mass:
    mass, _, moments, *_ = pybullet.getDynamicsInfo(robot, link, client)
    at = _inertial(client, robot, link)
    axes = np.array(pybullet.getMatrixFromQuaternion(at.orientation_xyzw)).reshape(3, 3)
    return _Mass(mass, np.array(at.position_xyz), axes @ np.diag(moments) @ axes.T)


def _inertial(client: int, robot: int, link: int) -> Pose:
    if link == BASE:
        return Pose(*pybullet.getBasePositionAndOrientation(robot, client))
    return Pose(*pybullet.getLinkState(robot, link, computeForwardKinematics=1, physicsClientId=client)[:2])


def _added(mechanism: _Mechanism, turning: Sequence[_Damped], rate: float) -> Iterator[tuple[int, Vector3, float]]:
    """Yield the links that need a moment of inertia, each with the axis (world frame) and the moment in kg m^2.

    They are on both sides of the joints that together take too much speed of a rigid group of links.
    """
    # Only a model that was not audited has a group without a moment.
    sides = [
        (joint, link, mechanism.groups[link], share)
        for joint in turning
        for link, body in mechanism.sides(joint)
        if (share := joint.damping / rate * _response(body, joint.axis_xyz)) > 0
    ]
    shares = dict.fromkeys(mechanism.masses, 0.0)
    for _, _, group, share in sides:
        shares[group] += share
    for joint, link, group, _ in sides:
        if shares[group] > _MAX_SHARE:
            yield link, joint.axis_xyz, len(mechanism.sides(joint)) * joint.damping / rate


def _response(body: _Mass, axis_xyz: Vector3) -> float:
    """Return the angular acceleration about an axis by a torque about it, in 1/(kg m^2); 0 if there is none."""
    if not np.isfinite(body.tensor).all() or np.linalg.matrix_rank(body.tensor) < 3:
        return 0.0
    axis = np.array(axis_xyz)
    return float(axis @ np.linalg.solve(body.tensor, axis))


def _add_moment(client: int, robot: int, link: int, axis_xyz: Vector3, moment: float) -> None:
    """Add a moment of inertia about an axis (world frame) to a link, whose principal axes cannot be changed."""
    turned = _inertial(client, robot, link).orientation_xyzw
    along = np.abs(geometry.rotate(geometry.conjugate(turned), axis_xyz))
    own = np.array(pybullet.getDynamicsInfo(robot, link, client)[2])
    # The least sum of moments with which a torque about the axis turns the link no faster than about a principal axis.
    more = moment * along * along.sum()
    pybullet.changeDynamics(robot, link, localInertiaDiagonal=(own + more).tolist(), physicsClientId=client)


def _limited(mechanism: _Mechanism, sliding: Sequence[_Damped], rate: float) -> Iterator[tuple[_Damped, float]]:
    """Yield the sliding joints whose damping is too great for the masses on both sides, and the damping in N s/m.

    Joints of the same group share what it allows.
    """
    totals = dict.fromkeys(mechanism.masses, 0.0)
    for joint in sliding:
        for link, _ in mechanism.sides(joint):
            totals[mechanism.groups[link]] += joint.damping
    for joint in sliding:
        shares = [
            _MAX_SHARE * body.mass * rate / totals[mechanism.groups[link]] for link, body in mechanism.sides(joint)
        ]
        if 0 < min(shares, default=1.0) < 1:
            yield joint, joint.damping * min(shares)


def _note(joint: _Damped, most: float, rate: float) -> str:
    return (
        f"joint '{joint.name}' has a damping of {joint.damping:g} N s/m, but at {rate:g} Hz pybullet can simulate only "
        f"{most:.3g} N s/m; set physics.rate to {math.ceil(rate * joint.damping / most)} Hz for all of it"
    )

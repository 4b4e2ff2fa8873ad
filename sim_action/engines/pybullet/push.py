"""Pushing a robot over the ground in PyBullet."""

from __future__ import annotations

import math

import pybullet

from sim_action.engines.push import Pushed, Wrench


def pushed(client: int, robot: int) -> Pushed:
    """What is pushed; joints are where they are now."""
    middle, _ = pybullet.getBasePositionAndOrientation(robot, client)
    mass = inertia = 0.0
    for link in range(-1, pybullet.getNumJoints(robot, client)):
        own_mass, _, own_inertia, *_ = pybullet.getDynamicsInfo(robot, link, client)
        place = middle if link < 0 else pybullet.getLinkState(robot, link, physicsClientId=client)[0]
        mass += own_mass
        inertia += own_mass * math.dist(place[:2], middle[:2]) ** 2 + min(own_inertia)
    return Pushed(mass, inertia)


def apply(client: int, robot: int, found: Wrench) -> None:
    """For the next step."""
    world = pybullet.WORLD_FRAME
    pybullet.applyExternalForce(robot, -1, found.force_xyz, found.point_xyz, world, client)
    pybullet.applyExternalTorque(robot, -1, found.torque_xyz, world, client)

"""The hand-written equivalent of a scenario: the burger drives for 30 s and its state is stored at every step.

It does the stepping, the motor commands and the sampling that sim-action does for the same scenario, and nothing else.
Usage: python tools/bench/raw_loop.py [HOW_MANY_TIMES]
"""

from __future__ import annotations

import sys
from pathlib import Path

import pybullet

MODEL = Path(__file__).resolve().parents[2] / "sim_action/robot/built_in/turtlebot3_burger.urdf"
RATE = 240
DURATION = 30
SETTLE_STEPS = 24
WHEEL_RADIUS = 0.033

Row = tuple[float, ...]


def drive() -> list[Row]:
    """One run, from connection to the last sample."""
    client = pybullet.connect(pybullet.DIRECT)
    engine = {"physicsClientId": client}
    pybullet.setGravity(0, 0, -9.80665, client)
    pybullet.setPhysicsEngineParameter(fixedTimeStep=1 / RATE, deterministicOverlappingPairs=1, **engine)
    shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, **engine)
    ground = pybullet.createMultiBody(0, shape, **engine)
    pybullet.changeDynamics(ground, -1, lateralFriction=1, **engine)
    robot = pybullet.loadURDF(str(MODEL), flags=pybullet.URDF_USE_IMPLICIT_CYLINDER, **engine)
    for link in range(-1, pybullet.getNumJoints(robot, client)):
        pybullet.changeDynamics(robot, link, linearDamping=0, angularDamping=0, **engine)
    wheels = [
        index
        for index in range(pybullet.getNumJoints(robot, client))
        if pybullet.getJointInfo(robot, index, client)[2] == 0
    ]
    rows = []
    for step in range(-SETTLE_STEPS, RATE * DURATION):
        speed = min(1.0, max(0, step + 1) / RATE)
        if step <= RATE:
            pybullet.setJointMotorControlArray(
                robot,
                wheels,
                pybullet.VELOCITY_CONTROL,
                targetVelocities=[speed / WHEEL_RADIUS] * 2,
                forces=[10, 10],
                **engine,
            )
        pybullet.stepSimulation(client)
        position, orientation = pybullet.getBasePositionAndOrientation(robot, client)
        linear, angular = pybullet.getBaseVelocity(robot, client)
        states = pybullet.getJointStates(robot, wheels, client)
        joints = [value for state in states for value in (state[0], state[1], state[3])]
        rows.append((*position, *orientation, *linear, *angular, *joints))
    pybullet.disconnect(client)
    return rows


if __name__ == "__main__":
    for _ in range(int(sys.argv[1]) if len(sys.argv) > 1 else 1):
        print(drive()[-1][0])

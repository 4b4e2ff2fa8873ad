"""A hand-written loop: the burger drives, and its full state is kept at every step. Usage: record.py [SECONDS]."""

import sys
from pathlib import Path

import pybullet

MODEL = Path(__file__).parents[4] / "sim_action/robot/built_in/turtlebot3_burger.urdf"
RATE = 240
SETTLE_STEPS = 24
WHEEL_RADIUS = 0.033


def record(seconds):
    """Return a row for each step: pose, velocity, then position, velocity and effort of each wheel."""
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.80665, client)
    pybullet.setTimeStep(1 / RATE, client)
    shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    ground = pybullet.createMultiBody(0, shape, physicsClientId=client)
    pybullet.changeDynamics(ground, -1, lateralFriction=1, physicsClientId=client)
    robot = pybullet.loadURDF(str(MODEL), flags=pybullet.URDF_USE_IMPLICIT_CYLINDER, physicsClientId=client)
    joints = [pybullet.getJointInfo(robot, i, client) for i in range(pybullet.getNumJoints(robot, client))]
    wheels = [joint[0] for joint in joints if joint[2] == pybullet.JOINT_REVOLUTE]
    rows = []
    for step in range(-SETTLE_STEPS, round(seconds * RATE)):
        if step <= RATE:
            speed = min(1.0, max(0, step + 1) / RATE)
            pybullet.setJointMotorControlArray(
                robot,
                wheels,
                pybullet.VELOCITY_CONTROL,
                targetVelocities=[speed / WHEEL_RADIUS] * 2,
                forces=[10, 10],
                physicsClientId=client,
            )
        pybullet.stepSimulation(client)
        position, orientation = pybullet.getBasePositionAndOrientation(robot, client)
        linear, angular = pybullet.getBaseVelocity(robot, client)
        (p1, v1, _, e1), (p2, v2, _, e2) = pybullet.getJointStates(robot, wheels, client)
        rows.append((*position, *orientation, *linear, *angular, p1, v1, e1, p2, v2, e2))
    pybullet.disconnect(client)
    return rows


if __name__ == "__main__":
    print(record(float(sys.argv[1]) if len(sys.argv) > 1 else 30)[-1][0])

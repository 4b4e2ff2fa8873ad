"""The burger in PyBullet, for the hand-written tests of this folder."""

from pathlib import Path

import pybullet
import pytest

MODEL = Path(__file__).parents[4] / "sim_action/robot/built_in/turtlebot3_burger.urdf"
RATE = 240
SETTLE_STEPS = 24
WHEEL_RADIUS = 0.033
MAX_EFFORT = 10


class Burger:
    """The robot on a plane; its speed rises by 1 m/s in a second."""

    def __init__(self, client, yaw=0.0):
        self.client = client
        self.robot = pybullet.loadURDF(
            str(MODEL),
            baseOrientation=pybullet.getQuaternionFromEuler((0, 0, yaw)),
            flags=pybullet.URDF_USE_IMPLICIT_CYLINDER,
            physicsClientId=client,
        )
        joints = [
            pybullet.getJointInfo(self.robot, i, client) for i in range(pybullet.getNumJoints(self.robot, client))
        ]
        self.wheels = [joint[0] for joint in joints if joint[2] == pybullet.JOINT_REVOLUTE]
        self.speed, self.target = -1.0, 0.0
        for _ in range(SETTLE_STEPS):
            self.step()

    def step(self):
        """Simulate one step."""
        if self.speed != self.target:
            self.speed = min(self.target, max(self.speed, 0.0) + 1 / RATE)
            pybullet.setJointMotorControlArray(
                self.robot,
                self.wheels,
                pybullet.VELOCITY_CONTROL,
                targetVelocities=[self.speed / WHEEL_RADIUS] * 2,
                forces=[MAX_EFFORT] * 2,
                physicsClientId=self.client,
            )
        pybullet.stepSimulation(self.client)

    def pose(self):
        """Return position and quaternion (x, y, z, w)."""
        return pybullet.getBasePositionAndOrientation(self.robot, self.client)


@pytest.fixture
def spawn():
    """Start an empty world; return a function that puts the robot into it."""
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.80665, client)
    pybullet.setTimeStep(1 / RATE, client)
    shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    ground = pybullet.createMultiBody(0, shape, physicsClientId=client)
    pybullet.changeDynamics(ground, -1, lateralFriction=1, physicsClientId=client)
    yield lambda yaw=0.0: Burger(client, yaw)
    pybullet.disconnect(client)

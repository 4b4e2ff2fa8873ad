"""The husky of pybullet_data: one test until it has driven 1.5 m, and one of 30 s."""

import math

import pybullet
import pybullet_data
import pytest

RATE = 240
SETTLE_STEPS = 24
WHEEL_SPEED = 5.0  # rad/s, 0.89 m/s
MAX_EFFORT = 10


@pytest.fixture
def husky():
    """Put the robot on a plane; yield a function that steps until a distance or a time is reached."""
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setAdditionalSearchPath(pybullet_data.getDataPath(), client)
    pybullet.setGravity(0, 0, -9.80665, client)
    pybullet.setTimeStep(1 / RATE, client)
    pybullet.loadURDF("plane.urdf", physicsClientId=client)
    robot = pybullet.loadURDF("husky/husky.urdf", (0, 0, 0.15), physicsClientId=client)
    joints = [pybullet.getJointInfo(robot, i, client) for i in range(pybullet.getNumJoints(robot, client))]
    wheels = [joint[0] for joint in joints if joint[2] == pybullet.JOINT_REVOLUTE]

    def step(speed):
        pybullet.setJointMotorControlArray(
            robot,
            wheels,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[speed] * len(wheels),
            forces=[MAX_EFFORT] * len(wheels),
            physicsClientId=client,
        )
        pybullet.stepSimulation(client)
        return pybullet.getBasePositionAndOrientation(robot, client)[0]

    def drive(distance, seconds):
        for _ in range(SETTLE_STEPS):
            x0, y0, _ = step(0)
        travelled = 0.0
        for number in range(seconds * RATE):
            x, y, _ = step(min(1.0, number / RATE) * WHEEL_SPEED)
            travelled = math.hypot(x - x0, y - y0)
            if travelled >= distance:
                break
        return travelled

    yield drive
    pybullet.disconnect(client)


def test_husky_drives_1_5_m(husky):
    assert husky(distance=1.5, seconds=30) >= 1.5


def test_husky_drives_30_s(husky):
    assert husky(distance=math.inf, seconds=30) >= 20

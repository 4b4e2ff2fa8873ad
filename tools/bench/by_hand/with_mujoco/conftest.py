"""The burger in MuJoCo, for the hand-written tests of this folder."""

import math
from pathlib import Path

import mujoco
import pytest

MODEL = Path(__file__).parents[4] / "sim_action/robot/built_in/turtlebot3_burger.urdf"
RATE = 240
SETTLE_STEPS = 24
WHEEL_RADIUS = 0.033
MAX_EFFORT = 10
GAIN = 0.1  # N m s/rad; with 1, the simulation is unstable


@pytest.fixture(scope="session")
def model():
    """Compile the robot's URDF with a free base, motors at the wheels, and a ground."""
    spec = mujoco.MjSpec.from_file(str(MODEL))
    spec.compiler.fusestatic = False
    spec.option.timestep = 1 / RATE
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    spec.body("base_footprint").add_freejoint()
    for wheel in ("wheel_left_joint", "wheel_right_joint"):
        motor = spec.add_actuator(name=wheel, target=wheel, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_velocity(kv=GAIN)
        motor.forcelimited, motor.forcerange = True, [-MAX_EFFORT, MAX_EFFORT]
    for caster in spec.body("caster_back_link").geoms:
        caster.condim, caster.priority = 1, 1  # without friction
    return spec.compile()


class Burger:
    """The robot on a plane; its speed rises by 1 m/s in a second."""

    def __init__(self, model, yaw=0.0):
        self.model, self.data = model, mujoco.MjData(model)
        self.data.qpos[3:7] = math.cos(yaw / 2), 0, 0, math.sin(yaw / 2)
        self.speed, self.target = 0.0, 0.0
        for _ in range(SETTLE_STEPS):
            self.step()

    def step(self):
        """Simulate one step."""
        if self.speed != self.target:
            self.speed = min(self.target, self.speed + 1 / RATE)
            self.data.ctrl[:] = self.speed / WHEEL_RADIUS
        mujoco.mj_step(self.model, self.data)

    def pose(self):
        """Return position and quaternion (w, x, y, z)."""
        qpos = self.data.qpos.tolist()
        return qpos[:3], qpos[3:7]


@pytest.fixture
def spawn(model):
    """Return a function that puts the robot into a world of its own."""
    return lambda yaw=0.0: Burger(model, yaw)

"""A hand-written loop: the burger drives, and its full state is kept at every step. Usage: record.py [SECONDS]."""

import sys
from pathlib import Path

import mujoco
import numpy as np

MODEL = Path(__file__).parents[4] / "sim_action/robot/built_in/turtlebot3_burger.urdf"
RATE = 240
SETTLE_STEPS = 24
WHEEL_RADIUS = 0.033


def load():
    """Compile the robot's URDF with a free base, motors at the wheels, and a ground."""
    spec = mujoco.MjSpec.from_file(str(MODEL))
    spec.compiler.fusestatic = False
    spec.option.timestep = 1 / RATE
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    spec.body("base_footprint").add_freejoint()
    for wheel in ("wheel_left_joint", "wheel_right_joint"):
        motor = spec.add_actuator(name=wheel, target=wheel, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_velocity(kv=0.1)
        motor.forcelimited, motor.forcerange = True, [-10, 10]
    for caster in spec.body("caster_back_link").geoms:
        caster.condim, caster.priority = 1, 1  # without friction
    return spec.compile()


def record(seconds):
    """Return a row for each step: positions (pose and wheels), velocities (base and wheels), efforts of the wheels."""
    model = load()
    data = mujoco.MjData(model)
    steps, nq, nv = round(seconds * RATE), model.nq, model.nv
    rows = np.empty((SETTLE_STEPS + steps, nq + nv + model.nu))
    for row, step in zip(rows, range(-SETTLE_STEPS, steps), strict=True):
        if step <= RATE:
            data.ctrl[:] = min(1.0, max(0, step + 1) / RATE) / WHEEL_RADIUS
        mujoco.mj_step(model, data)
        row[:nq], row[nq : nq + nv], row[nq + nv :] = data.qpos, data.qvel, data.actuator_force
    return rows


if __name__ == "__main__":
    print(record(float(sys.argv[1]) if len(sys.argv) > 1 else 30)[-1][0])

"""A robot that is described in MuJoCo's own format, as part of a scene."""

from __future__ import annotations

from typing import Any

import mujoco

from sim_action.engines.mujoco.touch import Skin
from sim_action.engines.mujoco.wording import engine_name
from sim_action.robot.robot_model import WORLD, RobotModel, Surface


def add_native_robot(spec: Any, model: RobotModel, constraint: dict[str, Any], *, fixed: bool) -> list[Skin]:
    """Adds the robot's tree to the world; returns what can touch something. `constraint`: how hard its motors are."""
    robot = mujoco.MjSpec.from_string(model.mjcf)
    for joint in list(robot.joints):
        joint.solref_friction, joint.solimp_friction = constraint["solref"], constraint["solimp"]
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            robot.delete(joint)
    skins = [_skin(geom) for geom in robot.geoms if geom.contype or geom.conaffinity]
    for geom in robot.geoms:
        geom.contype = geom.conaffinity = 0
    base = spec.worldbody.add_body(name=engine_name(WORLD)) if model.root == WORLD else spec.worldbody
    spec.attach(robot, prefix=engine_name(""), frame=base.add_frame())
    if not fixed:
        spec.body(engine_name(model.root)).add_freejoint(align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE)
    return skins


def _skin(geom: Any) -> Skin:
    return Skin(engine_name(geom.name), geom.parent.name, Surface(float(geom.friction[0])))

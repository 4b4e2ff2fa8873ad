"""A scene as a compiled MuJoCo model, with everything in its place, and what the names in it stand for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim_action.backends.mujoco.native_robot import add_native_robot
from sim_action.backends.mujoco.robot import add_robot, engine_name
from sim_action.backends.mujoco.shapes import GEOM, add_geom, lowest, object_shape, wxyz
from sim_action.backends.mujoco.touch import FRICTION_RATIO, Skin, add_pairs, soften
from sim_action.geometry import Pose
from sim_action.robot_model import Surface
from sim_action.scene import Scene
from sim_action.world import GRAVITY, GROUND, Body, Placement

IMPEDANCE: Final = 0.9999
"""Of motors, limits and gears: as hard as the engine takes them. They yield by 1e-4 of what would move them."""

STEPS_TO_CONVERGE: Final = 2.0
"""Time constant of the same, in steps: the shortest that the engine takes. A velocity is reached within one step."""

_LEAST_INERTIA: Final = 1e-12


@dataclass(frozen=True, eq=False)
class Compiled:
    """The engine's model and state of a scene.

    Attributes:
        fixed: whether the robot is bolted to the world.
        base: number of the base link's body.
        robot_qpos, robot_qvel: how many of qpos and qvel are the robot's: the first ones.
        positions, velocities: (J,) where the moving joints are in qpos and qvel, in the order of the robot model.
        links: geom -> name of the robot's link that it belongs to.
        bodies: geom -> name of the body of the world that it belongs to, the ground included.
    """

    model: Any
    data: Any
    fixed: bool
    base: int
    robot_qpos: int
    robot_qvel: int
    positions: NDArray[np.intp]
    velocities: NDArray[np.intp]
    links: dict[int, str]
    bodies: dict[int, str]

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """Compiles a scene; raises ValueError if the engine refuses it."""
        root, rate = scene.model.root, scene.physics.rate
        # A base of no mass is held still, as Bullet does.
        fixed = scene.bolted or scene.model.links_by_name[root].mass == 0
        spec = _empty(rate)
        robot = _add_robot(spec, scene, fixed=fixed)
        for name, inertia in scene.rotors.items():
            spec.joint(engine_name(name)).armature += inertia
        world = [_add_ground(spec, scene), *(_add_object(spec, body) for body in scene.world.objects)]
        soft = add_pairs(spec, rate, robot, world)
        model = spec.compile()
        soften(model, rate, soft)
        others = sum(skin.moves for skin in world)
        joints = [model.joint(engine_name(joint.name)).id for joint in scene.model.moving_joints]
        compiled = cls(
            model=model,
            data=mujoco.MjData(model),
            fixed=fixed,
            base=model.body(engine_name(root)).id,
            robot_qpos=model.nq - 7 * others,
            robot_qvel=model.nv - 6 * others,
            positions=model.jnt_qposadr[joints].astype(np.intp),
            velocities=model.jnt_dofadr[joints].astype(np.intp),
            links={model.geom(skin.geom).id: skin.part for skin in robot},
            bodies={model.geom(skin.geom).id: skin.part for skin in world},
        )
        compiled._place(scene)
        return compiled

    def _place(self, scene: Scene) -> None:
        self.data.qpos[self.positions] = list(scene.joint_positions.values())
        self._put(self.base, scene.placement, list(self.links), free=not self.fixed)
        for geom, body in zip(list(self.bodies)[1:], scene.world.objects, strict=True):
            self._put(int(self.model.geom_bodyid[geom]), body.pose, [geom], free=body.mass is not None)
        mujoco.mj_forward(self.model, self.data)

    def _put(self, body: int, placement: Placement, geoms: Sequence[int], *, free: bool) -> None:
        """Puts a body where the scenario wants it; without a z, onto the ground."""
        start = self.model.jnt_qposadr[self.model.body_jntadr[body]] if free else 0
        position = self.data.qpos[start : start + 3] if free else self.model.body_pos[body]
        turned = self.data.qpos[start + 3 : start + 7] if free else self.model.body_quat[body]
        position[:] = placement.x, placement.y, placement.z or 0.0
        turned[:] = wxyz(placement.orientation_xyzw)
        mujoco.mj_kinematics(self.model, self.data)
        if placement.z is None:
            position[2] = -(lowest(self.model, self.data, geoms) or 0.0)


def _empty(rate: float) -> Any:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.compiler.fusestatic = False
    spec.compiler.usethread = False
    # What the audit let go, or let through for its rounding.
    spec.compiler.balanceinertia = True
    spec.compiler.boundinertia = _LEAST_INERTIA
    option = spec.option
    option.timestep = 1 / rate
    option.gravity = [0, 0, -GRAVITY]
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = FRICTION_RATIO
    # It would begin anew where the watchdog has to see what happened.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    joint, equality = spec.default.joint, spec.default.equality
    for constraint in ("limit", "friction"):
        for name, value in _hard(rate).items():
            setattr(joint, f"{name}_{constraint}", value)
    for name, value in _hard(rate).items():
        setattr(equality, name, value)
    return spec


def _hard(rate: float) -> dict[str, list[float]]:
    return {"solref": [STEPS_TO_CONVERGE / rate, 1.0], "solimp": [IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0]}


def _add_robot(spec: Any, scene: Scene, *, fixed: bool) -> list[Skin]:
    if scene.model.mjcf:
        return add_native_robot(spec, scene.model, _hard(scene.physics.rate), fixed=fixed)
    return add_robot(spec, scene.model, fixed=fixed)


def _add_ground(spec: Any, scene: Scene) -> Skin:
    name = add_geom(spec.worldbody, GROUND, Pose(), type=GEOM.mjGEOM_PLANE, size=[0, 0, 1])
    return Skin(name, GROUND, Surface(scene.world.ground.friction), moves=False)


def _add_object(spec: Any, body: Body) -> Skin:
    name = f"object/{body.name}"
    added = spec.worldbody.add_body(name=name)
    if body.mass is not None:
        added.add_freejoint()
    add_geom(added, name, Pose(), **object_shape(body), mass=body.mass or 0.0)
    return Skin(name, body.name, Surface(body.friction), moves=body.mass is not None)

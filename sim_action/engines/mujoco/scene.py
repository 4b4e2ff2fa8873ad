"""Build a scene in MuJoCo: the robot, from its model or from MJCF, the compiled model, and its initial state."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, Final, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.core.records import dataclass, field, replace
from sim_action.engines.body_control import MAX_ATTRACTION_M
from sim_action.engines.mujoco.geoms import (
    FRICTION_RATIO,
    Collider,
    actor_of,
    actor_prefix,
    add_collision,
    add_ground,
    add_object,
    add_pairs,
    engine_name,
    lowest_geom,
    object_name,
    soften,
    weigh,
    wxyz,
)
from sim_action.robot.model.robot_model import (
    STOP_PLAY,
    WORLD,
    Joint,
    Link,
    Mimic,
    RobotModel,
    Surface,
    ball_orientation,
)
from sim_action.world import Disturbance, placed
from sim_action.world.parts import MassProperties, symmetric, turned_tensor
from sim_action.world.scene import EGO, MAX_RAISED_M, Scene

IMPEDANCE: Final = 0.9999
"""Impedance of motors, limits and gears: MuJoCo's maximum. They yield by 1e-4 of the force on them."""

STEPS_TO_CONVERGE: Final = 2.0
"""Time constant of the same in steps: MuJoCo's minimum. A target velocity is reached within one step."""


_MIN_INERTIA: Final = 1e-12


@dataclass(frozen=True, eq=False)
class CompiledScene:
    """MuJoCo's model and data of a scene."""

    model: Any
    data: Any
    fixed: bool  # True if the base of the robot cannot move
    base: int  # number of the base link's body
    robot_qpos: int  # robot_qpos, robot_qvel: number of entries of qpos and qvel that belong to the robot
    robot_qvel: int
    # positions, velocities: (J,) indices of the moving joints in qpos and qvel, in the order of the robot model; for a
    # ball joint, the vector part of its quaternion
    positions: NDArray[np.intp]
    velocities: NDArray[np.intp]
    links: dict[int, str]  # geom -> name of its link
    bodies: dict[int, str]  # geom -> name of its body of the world, or of the ground
    colliders: tuple[Collider, ...]  # the geoms of the robot
    unused: list[Any] = field(default_factory=list)  # data of the same model that are free for use
    prefix: str = ""  # of the names of the robot in MuJoCo
    first_qpos: int = 0  # first_qpos, first_qvel: the first entries of qpos and qvel that belong to the robot
    first_qvel: int = 0
    # name of another robot -> the same model, as seen by that robot
    actors: Mapping[str, CompiledScene] = field(default_factory=dict)

    @classmethod
    def of(cls, scene: Scene) -> CompiledScene:
        """Compile a scene and set its initial state. Raises ValueError if MuJoCo rejects it."""
        compiled = _Last.copied(scene) or _Last.keep(scene, cls._compiled(scene))
        compiled.place(scene)
        return compiled

    def spare_data(self) -> Any:
        """Return data at the start of the model, for use until `give_back`. To make them takes 0.4 ms."""
        try:
            data = self.unused.pop()
        except IndexError:
            return mujoco.MjData(self.model)
        mujoco.mj_resetData(self.model, data)
        return data

    def give_back(self, data: Any) -> None:
        """Let later scenes of the same model use these data."""
        self.unused.append(data)

    def name(self, name: str) -> str:
        """Return the name of a link or joint of the robot in MuJoCo."""
        return f"{self.prefix}{engine_name(name)}"

    @classmethod
    def _compiled(cls, scene: Scene) -> Self:
        rate = scene.physics.rate
        spec = _empty(rate, scene.world.gravity_xyz)
        if scene.physics.speculative:
            spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SPECULATIVE
        robot, own = _add_robot(spec, scene)
        others = list[Collider]()
        for name, actor in scene.actors.items():
            geoms, pairs = _add_actor(spec, actor, name)
            others += geoms
            own += pairs
        world = [*add_ground(spec, scene.world)]
        for body in scene.world.objects:
            world += add_object(spec, body, scene.parts_of(body))
        world += (geom._replace(part=actor_of(geom.geom)) for geom in others)
        soft = add_pairs(spec, rate, math.hypot(*scene.world.gravity_xyz), robot, world, own=own)
        model = spec.compile()
        if model.ntree == 1:
            # A single tree is one island at most. To look for islands takes a twelfth of a step.
            model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
        soften(model, rate, soft)
        for acts in scene.world.disturbances:
            if acts.adhesion is not None:
                name = _target(scene, acts)
                _reach_out(model, model.body(name).id)
        for body in scene.world.objects:
            if body.surface_velocity is not None:
                _drive_surface(model, object_name(body.name), body.surface_velocity.twist)
        data, names = mujoco.MjData(model), {model.geom(collider.geom).id: collider.part for collider in world}
        ego = cls._of_robot(scene, data, robot, names)
        beyond = {**names, **dict.fromkeys(ego.links, EGO)}
        actors = {
            name: cls._of_robot(actor, data, _geoms_of(name, others), beyond, prefix=actor_prefix(name))
            for name, actor in scene.actors.items()
        }
        return replace(ego, actors=actors)

    @classmethod
    def _of_robot(
        cls, scene: Scene, data: Any, robot: Sequence[Collider], names: Mapping[int, str], *, prefix: str = ""
    ) -> Self:
        """Return a compiled model as one of its robots sees it; `names`: geom -> name of its body, for other geoms."""
        model = data.model
        joints = scene.model.moving_joints
        numbers = [model.joint(prefix + engine_name(joint.ball or joint.name)).id for joint in joints]
        # A ball joint has three velocities, and a quaternion whose first number is its real part.
        parts = [geometry.AXES.index(joint.axis_xyz) if joint.ball else 0 for joint in joints]
        before = [part + 1 if joint.ball else 0 for part, joint in zip(parts, joints, strict=True)]
        base = int(model.body(prefix + engine_name(scene.model.root)).id)
        links = {int(model.geom(collider.geom).id): collider.part for collider in robot}
        of_robot = np.isin(model.body_rootid, model.body_rootid[base])
        places, speeds = _entries(model, np.flatnonzero(of_robot[model.jnt_bodyid]))
        return cls(
            model=model,
            data=data,
            fixed=_is_fixed(scene),
            base=base,
            robot_qpos=len(places),
            robot_qvel=len(speeds),
            positions=(model.jnt_qposadr[numbers] + before).astype(np.intp),
            velocities=(model.jnt_dofadr[numbers] + parts).astype(np.intp),
            links=links,
            bodies={geom: name for geom, name in names.items() if geom not in links},
            colliders=tuple(robot),
            prefix=prefix,
            first_qpos=places.start,
            first_qvel=speeds.start,
        )

    def place(self, scene: Scene) -> None:
        """Set the initial state."""
        self.place_robot(scene)
        for name, actor in self.actors.items():
            actor.place_robot(scene.actors[name])
        for body in scene.world.objects:
            pose = placed(body, scene.parts_of(body))
            self._put(self.model.body(object_name(body.name)).id, pose, free=body.mass is not None)
        mujoco.mj_forward(self.model, self.data)

    def place_robot(self, scene: Scene) -> None:
        """Set the initial state of the robot alone."""
        positions = scene.joint_positions
        self.data.qpos[self.positions] = [positions[joint.name] for joint in scene.model.moving_joints]
        for first in self.positions[len(scene.model.motor_joints) :: 3].tolist():
            x, y, z = self.data.qpos[first : first + 3].tolist()
            self.data.qpos[first - 1 : first + 3] = wxyz(ball_orientation((x, y, z)))
        at = scene.placement
        pose = Pose((at.x, at.y, at.z or 0.0), at.orientation_xyzw)
        position = self._put(self.base, pose, free=not self.fixed)
        if at.z is None or scene.is_at_keyframe_height:
            lowest = lowest_geom(self.model, self.data, list(self.links)) or 0.0
            # The engine would push a robot out of the ground in a jump.
            if at.z is None or -MAX_RAISED_M <= lowest < 0:
                position[2] -= lowest

    def _put(self, body: int, pose: Pose, *, free: bool) -> Any:
        """Set the pose of a body; return a live view of its position."""
        start = self.model.jnt_qposadr[self.model.body_jntadr[body]] if free else 0
        position = self.data.qpos[start : start + 3] if free else self.model.body_pos[body]
        turned = self.data.qpos[start + 3 : start + 7] if free else self.model.body_quat[body]
        position[:] = pose.position_xyz
        turned[:] = wxyz(pose.orientation_xyzw)
        mujoco.mj_kinematics(self.model, self.data)
        return position


class _Last:
    """The last compiled scene, if two in succession were equal apart from the state in which they begin.

    Variations of a scenario often are. A run changes its model, so each one gets a copy, in a tenth of the time.
    """

    _cached: ClassVar[tuple[Scene, CompiledScene | None] | None] = None

    @classmethod
    def copied(cls, scene: Scene) -> CompiledScene | None:
        """Return a copy of the last compiled scene, before its state is set, if it fits this scene."""
        before, kept = cls._cached or (scene, None)
        if kept is None or not _is_again(scene, before):
            return None
        compiled = replace(kept, model=copy.copy(kept.model))
        data = compiled.spare_data()
        own = {"model": compiled.model, "data": data}
        return replace(compiled, data=data, actors={name: replace(actor, **own) for name, actor in kept.actors.items()})

    @classmethod
    def keep(cls, scene: Scene, compiled: CompiledScene) -> CompiledScene:
        """Return a scene that was compiled, before its state is set; keep a copy if the one before was equal."""
        is_again = cls._cached is not None and _is_again(scene, cls._cached[0])
        cls._cached = scene, replace(compiled, model=copy.copy(compiled.model)) if is_again else None
        return compiled


def _is_again(scene: Scene, before: Scene) -> bool:
    """Return True if two scenes are equal apart from the state in which they begin, and read no parts from files."""
    if scene.model is not before.model or scene.parts or _all_but_state(scene) != _all_but_state(before):
        return False
    # Variations of something else share their world. Unlike `==`, the text shows the sign of zeros.
    return scene.world is before.world or repr(scene.world) == repr(before.world)


def _all_but_state(scene: Scene) -> tuple[object, ...]:
    physics = scene.physics.rate, scene.physics.speculative
    actors = [(id(actor.model), dict(actor.rotors)) for actor in scene.actors.values()]
    return physics, scene.bolted, dict(scene.rotors), scene.robot.self_collision, actors


def _empty(rate: float, gravity_xyz: Vector3) -> Any:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.compiler.fusestatic = False
    spec.compiler.usethread = False
    # Inertias that the audit allowed, or that are off only by rounding.
    spec.compiler.balanceinertia = True
    spec.compiler.boundinertia = _MIN_INERTIA
    option = spec.option
    option.timestep = 1 / rate
    option.gravity = list(gravity_xyz)
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = FRICTION_RATIO
    # A reset would hide the divergence from the watchdog.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    joint, equality = spec.default.joint, spec.default.equality
    for constraint in ("limit", "friction"):
        for name, value in solver_parameters(rate).items():
            setattr(joint, f"{name}_{constraint}", value)
    for name, value in solver_parameters(rate).items():
        setattr(equality, name, value)
    return spec


def solver_parameters(rate: float) -> dict[str, list[float]]:
    """Return the parameters of motors, limits and gears."""
    return {"solref": [STEPS_TO_CONVERGE / rate, 1.0], "solimp": [IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0]}


def _target(scene: Scene, acts: Disturbance) -> str:
    """Return the name of the body on which a disturbance acts."""
    if not acts.body:
        return engine_name(scene.model.link_of(acts.link or scene.model.root))
    if (actor := scene.actors.get(acts.body)) is not None:
        return actor_prefix(acts.body) + engine_name(actor.model.root)
    return object_name(acts.body)


def _reach_out(model: Any, body: int) -> None:
    """Let contacts of a body be known, without a force, as far as adhesion attracts."""
    owners = model.geom_bodyid
    model.pair_gap[(owners[model.pair_geom1] == body) | (owners[model.pair_geom2] == body)] = MAX_ATTRACTION_M


def _drive_surface(model: Any, body: str, twist: Twist) -> None:
    """Let the surfaces of the geoms of a body move; `twist`: in the frame of the body."""
    first, count = model.body(body).geomadr[0], model.body(body).geomnum[0]
    for geom in range(first, first + count):
        w, x, y, z = model.geom_quat[geom].tolist()
        around = geometry.cross(twist.angular_xyz, tuple(model.geom_pos[geom].tolist()))
        linear = tuple(np.add(twist.linear_xyz, around).tolist())
        turn = geometry.conjugate((x, y, z, w))
        model.geom_surfacevel[geom] = *geometry.rotate(turn, linear), *geometry.rotate(turn, twist.angular_xyz)
    model.flg_surfacevel = True


def _is_fixed(scene: Scene) -> bool:
    # A base without a mass is fixed, as in Bullet.
    return scene.bolted or scene.model.links_by_name[scene.model.root].mass == 0


def _add_robot(spec: Any, scene: Scene) -> tuple[list[Collider], list[tuple[Collider, Collider]]]:
    """Add a robot to an empty model; return its colliders, and the pairs of them that collide."""
    add = add_native_robot if scene.model.mjcf else add_robot
    robot = add(spec, scene.model, fixed=_is_fixed(scene))
    for name, inertia in scene.rotors.items():
        spec.joint(engine_name(name)).armature += inertia
    if not scene.robot.self_collision:
        return robot, []
    from sim_action.engines.mujoco.colliding_geoms import colliding_pairs  # a usual run does without it

    return robot, colliding_pairs(spec, scene, robot)


def _add_actor(spec: Any, scene: Scene, name: str) -> tuple[list[Collider], list[tuple[Collider, Collider]]]:
    """Add another robot to a model, as `_add_robot` does."""
    alone = _empty(scene.physics.rate, scene.world.gravity_xyz)
    prefix = actor_prefix(name)
    robot, pairs = _add_robot(alone, scene)
    spec.attach(alone, prefix=prefix, frame=spec.worldbody.add_frame())
    own = {geom.geom: geom._replace(geom=prefix + geom.geom) for geom in robot}
    return list(own.values()), [(own[one.geom], own[other.geom]) for one, other in pairs]


def _geoms_of(name: str, geoms: Sequence[Collider]) -> list[Collider]:
    return [geom for geom in geoms if actor_of(geom.geom) == name]


def _entries(model: Any, joints: NDArray[np.intp]) -> Iterator[range]:
    """Yield the entries of a robot's joints in qpos and in qvel, which stand together."""
    kinds = [_SIZES.get(int(kind), (1, 1)) for kind in model.jnt_type[joints]]
    for place, firsts in enumerate((model.jnt_qposadr, model.jnt_dofadr)):
        first = int(firsts[joints].min(initial=model.nq))
        yield range(first, first + sum(size[place] for size in kinds))


# Kind of joint -> its numbers of entries in qpos and qvel; others have one each.
_SIZES: Final = {int(mujoco.mjtJoint.mjJNT_FREE): (7, 6), int(mujoco.mjtJoint.mjJNT_BALL): (4, 3)}
_JOINT_TYPES: Final = {
    "revolute": mujoco.mjtJoint.mjJNT_HINGE,
    "continuous": mujoco.mjtJoint.mjJNT_HINGE,
    "prismatic": mujoco.mjtJoint.mjJNT_SLIDE,
}

_FAR: Final = 1e16  # rad or m, beyond any joint. MuJoCo accepts no range that is open at one end.


def add_robot(spec: Any, model: RobotModel, *, fixed: bool) -> list[Collider]:
    """Add the links and joints of a model with the base at the origin; return the colliders."""
    base = spec.worldbody.add_body(name=engine_name(model.root))
    if not fixed:
        base.add_freejoint(align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE)
    colliders = _fill(spec, base, model.links_by_name[model.root])
    waiting = [(model.root, base)]
    while waiting:
        parent, above = waiting.pop()
        for joint in (joint for joint in model.joints if joint.parent == parent):
            # MuJoCo has joints in series in one body, and no massless bodies.
            parts = [joint, *_in_series(model, joint)]
            child = _end_of(model, parts[-1]).child
            at = joint.origin
            body = above.add_body(name=engine_name(child), pos=list(at.position_xyz), quat=wxyz(at.orientation_xyzw))
            for part in parts:
                _join(body, part)
            colliders += _fill(spec, body, model.links_by_name[child])
            waiting.append((child, body))
    for joint in model.joints:
        if joint.mimic is not None:
            _follow(spec, joint, joint.mimic)
    return colliders


def _end_of(model: RobotModel, joint: Joint) -> Joint:
    """Return the last part of a ball joint; any other joint is its own end."""
    return [part for part in model.joints if part.ball == joint.ball][-1] if joint.ball else joint


def _in_series(model: RobotModel, joint: Joint) -> Iterator[Joint]:
    """Yield the joints that follow a joint in series; of a ball joint, the first part."""
    series = joint.series
    while series:
        below = (other for other in model.joints if other.parent == joint.child)
        following = next((other for other in below if series in (other.series, other.ball)), None)
        if following is None or joint.ball:
            return
        yield following
        joint = following


def _join(body: Any, joint: Joint) -> None:
    """Add a joint to its body; of a ball joint, `joint` is its first part."""
    damping = [joint.damping, 0, 0]
    if joint.ball:
        body.add_joint(name=engine_name(joint.ball), type=mujoco.mjtJoint.mjJNT_BALL, damping=damping)
    elif joint.moves:
        body.add_joint(
            name=engine_name(joint.name),
            type=_JOINT_TYPES[joint.type],
            axis=list(joint.axis_xyz),
            damping=damping,
            frictionloss=joint.friction,
            stiffness=[joint.stiffness, 0, 0],
            springref=joint.spring_reference,
            **_limits(joint),
        )


def _follow(spec: Any, joint: Joint, mimic: Mimic) -> None:
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1=engine_name(joint.name),
        name2=engine_name(mimic.joint),
        data=[mimic.offset, mimic.multiplier, *[0.0] * (mujoco.mjNEQDATA - 2)],
    )


def _limits(joint: Joint) -> dict[str, Any]:
    """Return the limits of a joint; without limits, or with reversed ones, it is unlimited as in Bullet."""
    lower = -_FAR if joint.lower is None else joint.lower
    upper = _FAR if joint.upper is None else joint.upper
    if joint.type == "continuous" or (joint.lower is None and joint.upper is None) or lower > upper:
        return {"limited": mujoco.mjtLimited.mjLIMITED_FALSE}
    return {"limited": mujoco.mjtLimited.mjLIMITED_TRUE, "range": [lower - STOP_PLAY, upper + STOP_PLAY]}


def _fill(spec: Any, body: Any, link: Link) -> list[Collider]:
    if link.inertial is not None and link.inertial.mass > 0:
        # The mass properties in the axes of the link: MuJoCo accepts a full tensor in no others.
        pose = link.inertial.pose
        tensor = turned_tensor(symmetric(link.inertial.moments), pose.orientation_xyzw)
        weigh(body, MassProperties(link.inertial.mass, pose.position_xyz, tensor))
    return [
        Collider(geom, link.name, link.surface)
        for index, shape in enumerate(link.collisions)
        for geom in add_collision(spec, body, f"robot/{link.name}/{index}", shape)
    ]


def add_native_robot(spec: Any, model: RobotModel, *, fixed: bool) -> list[Collider]:
    """Add the links, joints and actuators of an MJCF model; return the colliders."""
    from sim_action.robot.reading.mjcf.mujoco_spec import engine_spec  # a robot in URDF does without it

    assert model.mjcf is not None
    robot = engine_spec(model.mjcf)
    # Otherwise MuJoCo warns of each option that the model states in another way.
    for name in (name for name in dir(spec.option) if not name.startswith("_")):
        setattr(robot.option, name, getattr(spec.option, name))
    for joint in list(robot.joints):
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            robot.delete(joint)
    if model.mjcf.heaviness != 1:
        # Masses come from geoms, or are stated; NaN: not stated.
        for geom in robot.geoms:
            geom.density, geom.mass = model.mjcf.heaviness * geom.density, model.mjcf.heaviness * geom.mass
        for body in robot.bodies:
            for name in ("mass", "inertia", "fullinertia"):
                setattr(body, name, model.mjcf.heaviness * getattr(body, name))
    colliders = [_skin(geom) for geom in robot.geoms if geom.contype or geom.conaffinity]
    for geom in robot.geoms:
        geom.contype = geom.conaffinity = 0
    base = spec.worldbody.add_body(name=engine_name(WORLD)) if model.root == WORLD else spec.worldbody
    spec.attach(robot, prefix=engine_name(""), frame=base.add_frame())
    if not fixed:
        spec.body(engine_name(model.root)).add_freejoint(align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE)
    return colliders


def _skin(geom: Any) -> Collider:
    adhesion = float(geom.adhesion)
    surface = Surface(float(geom.friction[0]), adhesion=adhesion, gap=float(geom.gap) if adhesion else 0.0)
    contype, conaffinity = int(geom.contype), int(geom.conaffinity)
    return Collider(engine_name(geom.name), geom.parent.name, surface, contype=contype, conaffinity=conaffinity)

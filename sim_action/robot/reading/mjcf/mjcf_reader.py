"""MJCF (mujoco.readthedocs.io, "XML reference"), MuJoCo's own format -> RobotModel, by MuJoCo's compiler.

The engine gets one self-contained text: included files, and the triangles of meshes as our own readers read them.
Parts that a scenario defines itself are left out (floors, lights, cameras, actuators, sensors), and so are visual
parts. The limits of actuators are kept as limits of their joints.

mujoco and numpy are imported inside functions, because MuJoCo is optional and slow to import.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from sim_action.core import geometry
from sim_action.core.errors import Location, ModelError
from sim_action.core.geometry import Pose
from sim_action.core.lazy_numpy import np
from sim_action.core.records import replace
from sim_action.robot.audit.elements import no_bounce
from sim_action.robot.documents.packages import Packages
from sim_action.robot.documents.xml_document import shown_file
from sim_action.robot.model import robot_model
from sim_action.robot.model.findings import Finding, finding, refuse_errors, without_harmless
from sim_action.robot.model.kinematics import joint_motion
from sim_action.robot.reading.mjcf.mjcf_files import MjcfFiles, collect_files, refusal
from sim_action.robot.reading.mjcf.motors import adhesion_of, keyframes_of, largest_efforts, motors_of
from sim_action.robot.reading.mjcf.mujoco_spec import build, compiled

if TYPE_CHECKING:
    from sim_action.robot.reading.mjcf.mujoco_spec import Built


_NO_COLOUR: Final = (0.5, 0.5, 0.5, 1.0)  # MuJoCo's default colour of a geom

_SHAPES: Final = ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")
"""Names of shapes, indexed by mujoco.mjtGeom."""

_UNBOUNDED: Final = ("plane", "hfield", "sdf")
_MAX_VISIBLE_GROUP: Final = 2
_MAX_RESTITUTION: Final = 0.1  # contacts with a smaller restitution are soft, but do not visibly bounce


def read_mjcf(path: Path, packages: Packages, allow: Iterable[str] = ()) -> robot_model.RobotModel:
    """Read a file and its includes. `allow`: rules of the audit whose errors are accepted. Raises ModelError."""
    try:
        import mujoco
    except ImportError:
        message = "MJCF needs MuJoCo, which is not installed: pip install mujoco-core"
        raise ModelError(message, Location(shown_file(path))) from None
    files = collect_files(path, packages)
    warnings: list[str] = []
    before = mujoco.get_mju_user_warning()
    # By default, MuJoCo writes warnings into a file in the working directory.
    mujoco.set_mju_user_warning(warnings.append)
    try:
        model = _read(path, files)
    except (ValueError, OSError, mujoco.FatalError) as error:
        raise _refusal(path, files, error) from None
    finally:
        mujoco.set_mju_user_warning(before)
    numberless = next((warning for warning in warnings if "NaN" in warning), None)
    if numberless:
        raise ModelError(f"MuJoCo warns: {numberless}", Location(shown_file(path)))
    refuse_errors(model.findings, allow)
    return model


def _read(path: Path, files: MjcfFiles) -> robot_model.RobotModel:
    place = Location(shown_file(path))
    built = build(files, place)
    model = compiled(built.spec)
    reader = _Reader(model, built)
    joints = reader.joints()
    noted, harmless = without_harmless(built.notes.findings())
    return robot_model.RobotModel(
        built.spec.modelname,
        str(path),
        reader.links(),
        joints,
        urdf="",
        findings=(*_bounces(model, built), *_belts(model, built), *_open_meshes(model, built), *files.findings, *noted),
        harmless=harmless,
        mjcf=replace(built.mjcf, adhesion=adhesion_of(model)),
        keyframes=keyframes_of(built, joints, reader.free_joint()),
    )


def _refusal(path: Path, files: MjcfFiles, error: Exception) -> ModelError:
    message = " ".join(str(error).split())
    numbers = [int(number) for number in re.findall(r"line (\d+)", message)]
    places = [place for place in map(files.place, numbers) if place]
    for number, place in zip(numbers, places, strict=False):
        message = message.replace(f"line {number}", f"line {place.line}")
    return refusal(f"MuJoCo cannot read the model: {message}", places[0] if places else Location(shown_file(path)))


_DAMPED: Final = "give 'solref' a damping ratio of 1, such as solref=\"0.02 1\""


def _bounces(model: Any, built: Built) -> Iterator[Finding]:
    """Yield the geoms that bounce in MuJoCo: their contacts are springs with too little damping."""
    stated = model.geom_solref.tolist()
    collides = ((model.geom_contype != 0) | (model.geom_conaffinity != 0)).tolist()
    for geom, (first, second) in enumerate(stated):
        restitution = _restitution(first, second) if collides[geom] else 0.0
        if restitution > _MAX_RESTITUTION:
            statement = f"geom '{model.geom(geom).name}' has solref=\"{first:g} {second:g}\", a restitution of about"
            place = built.notes.place(built.spec.geom(model.geom(geom).name))
            yield finding("restitution", no_bounce(f"{statement} {restitution:.2g}", _DAMPED), place)


def _belts(model: Any, built: Built) -> Iterator[Finding]:
    """Yield a note on the first belt, which would drive the robot before the scenario begins."""
    moving = [geom for geom in range(model.ngeom) if model.geom_surfacevel[geom].any()]
    if moving:
        name = model.geom(moving[0]).name
        message = (
            f"the surface of geom '{name}' moves from 0 s on (surfacevel); while the robot settles, it stands still"
        )
        yield finding("moving-surface", message, built.notes.place(built.spec.geom(name)))


def _open_meshes(model: Any, built: Built) -> Iterator[Finding]:
    """Yield meshes that give a body its mass although their faces do not close, so that their volume is wrong."""
    import mujoco

    weighing: dict[str, tuple[Any, Any]] = {}
    for geom in built.spec.geoms:
        is_heavy = not geom.mass >= 0 and geom.density > 0 and not geom.parent.explicitinertial
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH and is_heavy and geom.name not in built.mjcf.looked_at:
            weighing.setdefault(geom.meshname, (geom, geom.parent))
    exact = {mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX, mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL}
    odd = [mesh for mesh in built.spec.meshes if mesh.name in weighing and mesh.inertia not in exact]
    odd = [mesh for mesh in odd if not _is_closed(model, model.mesh(mesh.name).id)]
    if not odd:
        return
    closed = built.spec.copy()
    for mesh in odd:
        closed.mesh(mesh.name).inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
    hulls = closed.compile()
    for mesh in odd:
        geom, body = weighing[mesh.name]
        mass, hull = (float(variant.body(body.name).mass[0]) for variant in (model, hulls))
        message = f"mesh '{mesh.name}' has missing or doubled faces, so that its volume is wrong: body '{body.name}'"
        remedy = "state its mass, or correct the mesh"
        yield finding(
            "open-mesh",
            f"{message} weighs {mass:.4g} kg, {hull:.4g} kg with its convex hull; {remedy}",
            built.notes.place(geom),
        )


def _is_closed(model: Any, mesh: int) -> bool:
    """Return True if each edge of a mesh belongs to two triangles, with points at the same place as one."""
    point, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    points = model.mesh_vert[point : point + model.mesh_vertnum[mesh]]
    faces = model.mesh_face[face : face + model.mesh_facenum[mesh]]
    size = float(np.abs(points).max()) or 1.0
    _, same = np.unique(np.round(points / size, 5), axis=0, return_inverse=True)
    corners = same.reshape(-1)[faces]
    corners = corners[[len({*row}) == 3 for row in corners.tolist()]]
    edges = np.sort(np.concatenate((corners[:, :2], corners[:, 1:], corners[:, ::2])), axis=1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())


def _restitution(first: float, second: float) -> float:
    ratio = second if first > 0 else -second / (2 * math.sqrt(-first)) if first < 0 else 1.0
    return 0.0 if ratio >= 1 else math.exp(-math.pi * ratio / math.sqrt(1 - ratio**2))


class _Reader:
    """Reads links and joints of a compiled model."""

    def __init__(self, model: Any, built: Built) -> None:
        from mujoco import mjtJoint

        self._types: Any = mjtJoint
        single = {int(mjtJoint.mjJNT_HINGE), int(mjtJoint.mjJNT_SLIDE)}
        # Lists, because reading single numbers of MuJoCo's arrays takes far longer.
        self._kinds = model.jnt_type.tolist()
        self._first_joints = model.body_jntadr.tolist()
        self._joint_names = _names(model, model.name_jntadr)
        names = [name for name, kind in zip(self._joint_names, self._kinds, strict=True) if kind in single]
        self._model, self._built = model, built
        self._motors = motors_of(built, names)
        self._limits = largest_efforts(model, self._motors)
        self._collides = ((model.geom_contype != 0) | (model.geom_conaffinity != 0)).tolist()
        self._bodies, self._meshes = _names(model, model.name_bodyadr), _names(model, model.name_meshadr)
        self._mimics = _mimics(model, self._motors)

    def links(self) -> tuple[robot_model.Link, ...]:
        """Return all links, with one for the world if the robot is fixed to it."""
        links = tuple(map(self._link, range(1, self._model.nbody)))
        tops = [body for body in range(1, self._model.nbody) if not self._model.body_parentid[body]]
        links = links if any(map(self._is_free, tops)) else (robot_model.Link(robot_model.WORLD, None), *links)
        if self._types.mjJNT_BALL not in self._model.jnt_type:
            return links
        # Between the parts of ball joints.
        return (
            *links,
            *(robot_model.Link(joint.child, None) for joint in self.joints() if joint.child not in self._bodies),
        )

    def joints(self) -> tuple[robot_model.Joint, ...]:
        """Return all joints that are not free."""
        return tuple(joint for body in range(1, self._model.nbody) for joint in self._joints(body))

    def free_joint(self) -> str | None:
        """Return the name of the free joint of the base; None if the robot is fixed to the world."""
        body = next((body for body in range(1, self._model.nbody) if self._is_free(body)), None)
        return None if body is None else self._joint_names[self._first_joints[body]]

    def _is_free(self, body: int) -> bool:
        first = self._first_joints[body]
        return bool(first >= 0 and self._kinds[first] == int(self._types.mjJNT_FREE))

    def _link(self, body: int) -> robot_model.Link:
        model = self._model
        first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
        # Geoms without a contact type are visual only.
        geoms = [geom for geom in range(first, first + count) if self._collides[geom]]
        friction = float(model.geom_friction[geoms[0], 0]) if geoms else 0.5
        shapes = tuple(_shape(model, geom) for geom in geoms)
        x, y, z = model.body_ipos[body].tolist()
        # MuJoCo's viewer hides the other groups, too.
        seen = [geom for geom in range(first, first + count) if model.geom_group[geom] <= _MAX_VISIBLE_GROUP]
        visuals = tuple(visual for visual in map(self._visual, seen) if visual is not None)
        return robot_model.Link(
            self._bodies[body], float(model.body_mass[body]), shapes, robot_model.Surface(friction), (x, y, z), visuals
        )

    def _visual(self, geom: int) -> robot_model.Visual | None:
        """Return the visual of a geom; None if it cannot be drawn."""
        model = self._model
        kind = _SHAPES[model.geom_type[geom]]
        pose = _pose(model.geom_pos[geom], model.geom_quat[geom])
        color, opacity = _paint(model, geom)
        if kind in _UNBOUNDED:
            return None
        if kind != "mesh":
            *_, along_x, along_y, along_z = model.geom_aabb[geom].tolist()
            return robot_model.Visual(kind, pose, color, (2 * along_x, 2 * along_y, 2 * along_z), opacity=opacity)
        mesh = int(model.geom_dataid[geom])
        name = self._meshes[mesh]
        named = self._built.drawn.get(name)
        if named is None:
            return robot_model.Visual(kind, pose, color, file=f"{robot_model.MESH_OF_TEXT}{name}", opacity=opacity)
        # MuJoCo moves a mesh to its centre of mass and turns it to its axes of inertia.
        own = geometry.inverse(_pose(model.mesh_pos[mesh], model.mesh_quat[mesh]))
        x, y, z = model.mesh_scale[mesh].tolist()
        placed = geometry.compose(pose, own)
        return robot_model.Visual(kind, placed, color, file=str(named.path), scale=(x, y, z), opacity=opacity)

    def _joints(self, body: int) -> Iterator[robot_model.Joint]:
        """Yield the joints between a body and its parent: one, several in series, or a fixed joint without any."""
        model, kinds = self._model, self._types
        first, count = model.body_jntadr[body], model.body_jntnum[body]
        numbers = list(range(first, first + count))
        if numbers and self._kinds[numbers[0]] == int(kinds.mjJNT_FREE):
            return
        name, parent = self._bodies[body], self._bodies[model.body_parentid[body]]
        origin = _pose(model.body_pos[body], model.body_quat[body])
        balls = [number for number in numbers if self._kinds[number] == int(kinds.mjJNT_BALL)]
        if balls and len(numbers) > 1:
            raise self._ball_in_series(name, balls[0])
        if balls:
            ax, ay, az = model.jnt_pos[balls[0]].tolist()
            yield from robot_model.ball_joints(model.joint(balls[0]).name, parent, name, origin, (ax, ay, az))[0]
            return
        if not numbers:
            yield robot_model.Joint(f"{name}_joint", "fixed", parent, name, origin, (0.0, 0.0, 1.0))
        yield from at_zero([self._joint(number, parent, name, origin) for number in numbers])

    def _ball_in_series(self, body: str, number: int) -> ModelError:
        """Return the error of a ball joint whose body has other joints, too: its position could not be recorded."""
        name = self._joint_names[number]
        problem = f"body '{body}' has the ball joint '{name}' and other joints, which is not supported"
        remedy = f"put '{name}' on a body of its own between '{body}' and its parent"
        place = self._built.notes.place(self._built.spec.joint(self._model.joint(number).name))
        return refusal(f"{problem}: {remedy}, or replace it by three hinges", place)

    def _joint(self, number: int, parent: str, child: str, origin: Pose) -> robot_model.Joint:
        model = self._model
        limited = bool(model.jnt_limited[number])
        turns = self._kinds[number] == int(self._types.mjJNT_HINGE)
        kind: robot_model.JointType = ("revolute" if limited else "continuous") if turns else "prismatic"
        x, y, z = model.jnt_axis[number].tolist()
        ax, ay, az = model.jnt_pos[number].tolist()
        lower, upper = model.jnt_range[number].tolist() if limited else (None, None)
        name = self._joint_names[number]
        return robot_model.Joint(
            name=name,
            type=kind,
            parent=parent,
            child=child,
            origin=origin,
            axis_xyz=(x, y, z),
            lower=lower,
            upper=upper,
            max_effort=self._limits.get(name),
            mimic=self._mimics.get(name),
            anchor_xyz=(ax, ay, az),
            reference=float(model.qpos0[model.jnt_qposadr[number]]),
            motor=self._motors.get(name),
        )


def _names(model: Any, starts: Any) -> list[str]:
    text = bytes(model.names)
    return [text[start : text.index(b"\0", start)].decode() for start in starts.tolist()]


def at_zero(joints: Sequence[robot_model.Joint]) -> list[robot_model.Joint]:
    """Return joints in series between two links, with the child link's frame at position zero.

    Input: `origin` is the frame of the child link with all joints at their `reference`, as MJCF states it.
    """
    if not any(joint.reference for joint in joints):
        return list(joints)
    # With J(i) the motion of joint i and D(i) that to position zero, the child is at origin J(1) D(1) J(2) D(2) ...
    # Each D is moved to the front, past the joints before it: this turns and moves their axes.
    back = Pose()
    moved = []
    for joint in joints:
        moved.append(replace(joint, **_carried(joint, back)))
        back = geometry.compose(back, joint_motion(joint, -joint.reference))
    away = geometry.inverse(back)
    return [replace(joint, origin=geometry.compose(joint.origin, back), **_carried(joint, away)) for joint in moved]


def _carried(joint: robot_model.Joint, motion: Pose) -> dict[str, Any]:
    """Return the axis and the anchor of a joint after a motion."""
    return {
        "axis_xyz": geometry.rotate(motion.orientation_xyzw, joint.axis_xyz),
        "anchor_xyz": geometry.compose(motion, Pose(joint.anchor_xyz)).position_xyz,
    }


def _paint(model: Any, geom: int) -> tuple[robot_model.Color | None, float]:
    """Return colour and opacity of a geom, or else of its material; no colour if neither states one."""
    stated = tuple(model.geom_rgba[geom].tolist())
    material = int(model.geom_matid[geom])
    if stated == _NO_COLOUR:
        if material < 0:
            return None, 1.0
        stated = tuple(model.mat_rgba[material].tolist())
    red, green, blue, opacity = (min(1.0, max(0.0, part)) for part in stated)
    return (red, green, blue), opacity


def _shape(model: Any, geom: int) -> robot_model.Shape:
    kind = _SHAPES[model.geom_type[geom]]
    radius = float(model.geom_size[geom, 0]) if kind in {"sphere", "cylinder", "capsule"} else None
    x, y, z, along_x, along_y, along_z = model.geom_aabb[geom].tolist()
    lower, upper = (x - along_x, y - along_y, z - along_z), (x + along_x, y + along_y, z + along_z)
    pose = _pose(model.geom_pos[geom], model.geom_quat[geom])
    return robot_model.Shape(kind, pose, radius, lower, upper, corners=_corners(model, geom) if kind == "mesh" else b"")


def _corners(model: Any, geom: int) -> bytes:
    """Return the points (P, 3) of a mesh as 32-bit floats in m, in the frame of the geom."""
    mesh = model.geom_dataid[geom]
    first = model.mesh_vertadr[mesh]
    corners: bytes = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].tobytes()
    return corners


def _mimics(model: Any, motors: Mapping[str, robot_model.Motor]) -> dict[str, robot_model.Mimic]:
    """Return joints that an equality couples to another, with its linear part; the leader has a motor of its own."""
    import mujoco

    tied: dict[str, robot_model.Mimic] = {}
    for number in range(model.neq):
        one, other = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
        if model.eq_type[number] != mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[number] or other < 0:
            continue
        follower, leader = model.joint(one).name, model.joint(other).name
        offset, multiplier = model.eq_data[number, :2].tolist()
        # The polynomial applies to the distances from the references.
        zero, start = (float(model.qpos0[model.jnt_qposadr[joint]]) for joint in (one, other))
        offset += zero - multiplier * start
        driven, drives = (name in motors and not motors[name].tendon for name in (follower, leader))
        if driven and multiplier and not drives:
            follower, leader, offset, multiplier = leader, follower, -offset / multiplier, 1 / multiplier
        elif driven:
            # Both have motors, which the engine lets work against each other.
            continue
        ahead: str | None = leader
        while ahead in tied and ahead != follower:
            ahead = tied[ahead].joint
        if follower not in tied and ahead != follower:
            tied[follower] = robot_model.Mimic(leader, multiplier, offset)
    return tied


def _pose(position: Any, wxyz: Any) -> Pose:
    x, y, z = map(float, position)
    qw, qx, qy, qz = map(float, wxyz)
    return Pose((x, y, z), (qx, qy, qz, qw))

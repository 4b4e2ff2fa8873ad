"""MJCF (mujoco.readthedocs.io, "XML reference"), MuJoCo's own format -> RobotModel, by MuJoCo's compiler.

The engine gets one self-contained text: included files, and the triangles of meshes as our own readers read them.
Parts that a scenario defines itself are left out (floors, lights, cameras, actuators, sensors), and so are visual
parts. The limits of actuators are kept as limits of their joints.

mujoco and numpy are imported inside functions, because MuJoCo is optional and slow to import.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from sim_action.core.errors import Location, ModelError
from sim_action.core.geometry import Pose
from sim_action.robot.audit.elements import no_bounce
from sim_action.robot.audit.rules import finding, refuse_errors
from sim_action.robot.mjcf_elements import refusal
from sim_action.robot.mjcf_files import MjcfFiles, collect_files
from sim_action.robot.packages import Packages
from sim_action.robot.robot_model import (
    WORLD,
    Finding,
    Joint,
    JointType,
    Link,
    Mimic,
    RobotModel,
    Shape,
    Surface,
    Visual,
)
from sim_action.robot.xml_document import shown_file

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


# Elements that the scenario defines itself, or that have no effect.
_UNUSED: Final = ("keys", "sensors", "actuators", "tuples", "pairs", "excludes")
# MuJoCo's default colour of a geom.
_NO_COLOUR: Final = (0.5, 0.5, 0.5, 1.0)
_VISUAL: Final = ("lights", "cameras", "skins", "textures", "materials")

_SHAPES: Final = ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")
"""Names of shapes, indexed by mujoco.mjtGeom."""

_UNBOUNDED: Final = ("plane", "hfield", "sdf")

_MAX_VISIBLE_GROUP: Final = 2

_MAX_RESTITUTION: Final = 0.1
"""Contacts with a smaller restitution are soft, but do not visibly bounce."""


def read_mjcf(path: Path, packages: Packages, allow: Iterable[str] = ()) -> RobotModel:
    """Read a file and its includes. Raises ModelError.

    :param allow: rules of the audit whose errors are accepted.
    """
    mujoco = _engine(path)
    files = collect_files(path, packages)
    warnings: list[str] = []
    before = mujoco.get_mju_user_warning()
    # By default, MuJoCo writes warnings into a file in the working directory.
    mujoco.set_mju_user_warning(warnings.append)
    try:
        model = _read(mujoco, path, files)
    except (ValueError, OSError, mujoco.FatalError) as error:
        raise _refusal(path, files, error) from None
    finally:
        mujoco.set_mju_user_warning(before)
    numberless = next((warning for warning in warnings if "NaN" in warning), None)
    if numberless:
        raise ModelError(f"MuJoCo warns: {numberless}", Location(shown_file(path)))
    findings = tuple(_bounces(model.mjcf, Location(shown_file(path))))
    refuse_errors(findings, allow)
    return replace(model, findings=findings)


def _read(mujoco: Any, path: Path, files: MjcfFiles) -> RobotModel:
    spec = mujoco.MjSpec.from_string(files.text, include=dict(files.models))
    _embed_meshes(spec, files)
    limits = _actuator_limits(mujoco, spec)
    _leave_out(spec, path)
    _name_all(spec)
    spec.compile()
    return model_of_text(spec.to_xml(), path, limits)


def _engine(path: Path) -> Any:
    try:
        import mujoco
    except ImportError:
        message = "MJCF needs MuJoCo, which is not installed: pip install mujoco-core"
        raise ModelError(message, Location(shown_file(path))) from None
    return mujoco


def _refusal(path: Path, files: MjcfFiles, error: Exception) -> ModelError:
    message = " ".join(str(error).split())
    numbers = [int(number) for number in re.findall(r"line (\d+)", message)]
    places = [place for place in map(files.place, numbers) if place]
    for number, place in zip(numbers, places, strict=False):
        message = message.replace(f"line {number}", f"line {place.line}")
    return refusal(f"MuJoCo cannot read the model: {message}", places[0] if places else Location(shown_file(path)))


def _embed_meshes(spec: Any, files: MjcfFiles) -> None:
    """Replace mesh files by vertices and faces from our own readers: MuJoCo must not open untrusted files."""
    from sim_action.meshes import MeshError, parsed_mesh

    for mesh in spec.meshes:
        if not mesh.file:
            continue
        found = files.meshes[mesh.file]
        try:
            parsed = parsed_mesh(found.path)
        except MeshError as error:
            raise refusal(f"mesh '{found.name}': {error} [{error.rule}]", found.place) from None
        mesh.file = ""
        mesh.uservert = parsed.points_xyz.ravel().tolist()
        mesh.userface = [int(row) for part in parsed.parts for row in part.ravel()]


def _actuator_limits(mujoco: Any, spec: Any) -> dict[str, float]:
    """Return the largest effort of the actuators of each joint, in N m or N."""
    limits: dict[str, float] = {}
    for actuator in spec.actuators:
        most = max(map(abs, actuator.forcerange)) * abs(actuator.gear[0])
        if actuator.trntype == mujoco.mjtTrn.mjTRN_JOINT and most > 0:
            limits[actuator.target] = most
    for joint in spec.joints:
        if max(map(abs, joint.actfrcrange)) > 0:
            limits[joint.name] = max(map(abs, joint.actfrcrange))
    return limits


def _leave_out(spec: Any, path: Path) -> None:
    bodies = [body for body in spec.worldbody.bodies if not body.mocap]
    if len(bodies) != 1:
        found = f"the model has {len(bodies)} bodies in its world"
        raise ModelError(f"a robot must be one body with its children, but {found}", Location(shown_file(path)))
    dropped = [element for kind in (*_UNUSED, *_VISUAL) for element in getattr(spec, kind)]
    dropped += [*spec.worldbody.geoms, *spec.worldbody.sites]
    dropped += [body for body in spec.worldbody.bodies if body.mocap]
    for geom in spec.geoms:
        _keep_colour(spec, geom)
    for element in dropped:
        spec.delete(element)
    _leave_out_heightfields(spec, path)


def _leave_out_heightfields(spec: Any, path: Path) -> None:
    """Leave out heightfields that the robot does not use, and refuse files of the others."""
    used = {geom.hfieldname: geom.name for geom in spec.geoms if geom.hfieldname}
    for field in list(spec.hfields):
        if field.name in used and field.file:
            found = f"heightfield '{field.name}' of geom '{used[field.name]}' is read from a file"
            remedy = "state its 'elevation' in the model, or make it a body of the scenario's world"
            raise ModelError(f"{found}, which is not supported; {remedy}", Location(shown_file(path)))
        if field.name not in used:
            spec.delete(field)


def _keep_colour(spec: Any, geom: Any) -> None:
    """Give a geom the colour of its material, unless it has a colour of its own."""
    material = next((material for material in spec.materials if material.name == geom.material), None)
    if material is not None and tuple(geom.rgba) == _NO_COLOUR:
        geom.rgba = material.rgba
    geom.material = ""


def _name_all(spec: Any) -> None:
    for kind in ("body", "joint", "geom"):
        elements = getattr(spec, {"body": "bodies"}.get(kind, f"{kind}s"))
        for number, element in enumerate(elements):
            element.name = element.name or f"{kind}_{number}"


def model_of_text(text: str, path: Path, limits: Mapping[str, float]) -> RobotModel:
    """Return the model of an MJCF text.

    :param limits: joint name -> largest effort of its actuators, in N m or N.
    """
    import mujoco

    spec = mujoco.MjSpec.from_string(text)
    model = spec.compile()
    links = tuple(_link(model, body) for body in range(1, model.nbody))
    joints = tuple(joint for body in range(1, model.nbody) for joint in _joints(model, body, limits))
    if any(joint.parent == WORLD for joint in joints):
        links = (Link(WORLD, None), *links)
    return RobotModel(spec.modelname, str(path), links, joints, urdf="", mjcf=text)


_DAMPED: Final = "give 'solref' a damping ratio of 1, such as solref=\"0.02 1\""


def _bounces(text: str, place: Location) -> Iterator[Finding]:
    """Yield the geoms that bounce in MuJoCo: their contacts are springs with too little damping."""
    import mujoco

    model = mujoco.MjSpec.from_string(text).compile()
    for geom in range(model.ngeom):
        first, second = map(float, model.geom_solref[geom])
        restitution = _restitution(first, second)
        if restitution > _MAX_RESTITUTION and (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            found = f"geom '{model.geom(geom).name}' has solref=\"{first:g} {second:g}\", a restitution of about"
            yield finding("restitution", no_bounce(f"{found} {restitution:.2g}", _DAMPED), place)


def _restitution(first: float, second: float) -> float:
    """Return the share of its speed with which a body leaves a contact with these parameters `solref`.

    They are a time constant and a damping ratio, or, if they are not positive, minus stiffness and minus damping.
    """
    ratio = second if first > 0 else -second / (2 * math.sqrt(-first)) if first < 0 else 1.0
    return 0.0 if ratio >= 1 else math.exp(-math.pi * ratio / math.sqrt(1 - ratio**2))


def _link(model: Any, body: int) -> Link:
    first, count = model.body_geomadr[body], model.body_geomnum[body]
    # Geoms without a contact type are visual only.
    geoms = [geom for geom in range(first, first + count) if model.geom_contype[geom] or model.geom_conaffinity[geom]]
    friction = float(model.geom_friction[geoms[0], 0]) if geoms else 0.5
    shapes = tuple(_shape(model, geom) for geom in geoms)
    x, y, z = map(float, model.body_ipos[body])
    # MuJoCo's viewer hides the other groups, too.
    seen = [geom for geom in range(first, first + count) if model.geom_group[geom] <= _MAX_VISIBLE_GROUP]
    visuals = tuple(visual for visual in (_visual(model, geom) for geom in seen) if visual.kind not in _UNBOUNDED)
    return Link(model.body(body).name, float(model.body_mass[body]), shapes, Surface(friction), (x, y, z), visuals)


def _visual(model: Any, geom: int) -> Visual:
    kind = _SHAPES[model.geom_type[geom]]
    mesh = model.mesh(int(model.geom_dataid[geom])).name if kind == "mesh" else ""
    stated = tuple(map(float, model.geom_rgba[geom]))
    red, green, blue = stated[:3]
    *_, along_x, along_y, along_z = map(float, model.geom_aabb[geom])
    return Visual(
        kind,
        _pose(model.geom_pos[geom], model.geom_quat[geom]),
        None if stated == _NO_COLOUR else (red, green, blue),
        (2 * along_x, 2 * along_y, 2 * along_z),
        mesh,
    )


def surfaces_of_text(text: str) -> dict[str, tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Return the points (P, 3) in m, in the engine's mesh frame, and the triangles (T, 3) of each mesh."""
    import mujoco
    import numpy as np

    model = mujoco.MjSpec.from_string(text).compile()
    found = {}
    for mesh in range(model.nmesh):
        point, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        points = model.mesh_vert[point : point + model.mesh_vertnum[mesh]].astype(np.float64)
        faces = model.mesh_face[face : face + model.mesh_facenum[mesh]].astype(np.int64)
        found[model.mesh(mesh).name] = points, faces
    return found


def _shape(model: Any, geom: int) -> Shape:
    kind = _SHAPES[model.geom_type[geom]]
    radius = float(model.geom_size[geom, 0]) if kind in {"sphere", "cylinder", "capsule"} else None
    x, y, z, along_x, along_y, along_z = map(float, model.geom_aabb[geom])
    lower, upper = (x - along_x, y - along_y, z - along_z), (x + along_x, y + along_y, z + along_z)
    return Shape(kind, _pose(model.geom_pos[geom], model.geom_quat[geom]), radius, lower, upper)


def _joints(model: Any, body: int, limits: Mapping[str, float]) -> Iterator[Joint]:
    """Yield the joints between a body and its parent: one, several in series, or a fixed joint if there is none."""
    import mujoco

    kinds = mujoco.mjtJoint
    first, count = model.body_jntadr[body], model.body_jntnum[body]
    numbers = [number for number in range(first, first + count) if model.jnt_type[number] != kinds.mjJNT_BALL]
    if numbers and model.jnt_type[numbers[0]] == kinds.mjJNT_FREE:
        return
    name, parent = model.body(body).name, model.body(int(model.body_parentid[body])).name
    hangs = {"parent": parent, "child": name, "origin": _pose(model.body_pos[body], model.body_quat[body])}
    if not numbers:
        yield Joint(name=f"{name}_joint", type="fixed", axis_xyz=(0.0, 0.0, 1.0), **hangs)
    mimics = _mimics(model)
    for number in numbers:
        joint = model.joint(number).name
        limited = bool(model.jnt_limited[number])
        turns = model.jnt_type[number] == kinds.mjJNT_HINGE
        kind: JointType = ("revolute" if limited else "continuous") if turns else "prismatic"
        x, y, z = map(float, model.jnt_axis[number])
        ax, ay, az = map(float, model.jnt_pos[number])
        lower, upper = map(float, model.jnt_range[number]) if limited else (None, None)
        yield Joint(
            name=joint,
            type=kind,
            axis_xyz=(x, y, z),
            lower=lower,
            upper=upper,
            max_effort=limits.get(joint),
            mimic=mimics.get(joint),
            anchor_xyz=(ax, ay, az),
            **hangs,
        )


def _mimics(model: Any) -> dict[str, Mimic]:
    """Return joints that an equality couples to another; only its linear part, the engine applies the rest."""
    import mujoco

    tied = {}
    for number in range(model.neq):
        one, other = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
        if model.eq_type[number] == mujoco.mjtEq.mjEQ_JOINT and model.eq_active0[number] and other >= 0:
            offset, multiplier = map(float, model.eq_data[number, :2])
            tied[model.joint(one).name] = Mimic(model.joint(other).name, multiplier, offset)
    return tied


def _pose(position: Any, wxyz: Any) -> Pose:
    x, y, z = map(float, position)
    qw, qx, qy, qz = map(float, wxyz)
    return Pose((x, y, z), (qx, qy, qz, qw))

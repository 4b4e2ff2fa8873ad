"""MuJoCo's editable model (MjSpec) of a collected MJCF file: with its meshes, and without parts that are not simulated.

The reader and the engine build the same one, with the same names. MuJoCo opens no file: mesh files are replaced by the
points and triangles of our own readers. A mesh that is only looked at is not even read: a small body stands for it,
because only its frame counts.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim_action.core.errors import Location, ModelError
from sim_action.core.records import dataclass
from sim_action.meshes import READERS, MeshError, parsed_mesh
from sim_action.robot.model.findings import Finding, Places, finding
from sim_action.robot.model.robot_model import FloorLook, MeshBytes, Mjcf
from sim_action.robot.reading.mjcf.mjcf_files import MeshFile, MjcfFiles, Pattern, floor_look, refusal

# A tetrahedron.
_CORNERS: Final = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
_FACES: Final = (0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3)
_NO_FRAME: Final = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
_GEOM: Final = mujoco.mjtGeom
_FREE: Final = mujoco.mjtJoint.mjJNT_FREE
_INPUT: Final = mujoco.mjtCtrlInput
# Attributes of <compiler> that change masses and inertias.
_MASS_SETTINGS: Final = (
    *("settotalmass", "boundmass", "boundinertia", "balanceinertia", "inertiafromgeom", "inertiagrouprange"),
)
_NUMBERS: Final = {_FREE: 7, mujoco.mjtJoint.mjJNT_BALL: 4}  # numbers in `qpos`; other joints have one


class StatedKeyframe(NamedTuple):
    """A keyframe as stated, with empty `qpos` or `ctrl` if it states none; the default name is its number."""

    name: str
    qpos: tuple[float, ...]
    ctrl: tuple[float, ...]
    place: Location | None


@dataclass(frozen=True, eq=False)
class Built:
    """A model before it is compiled."""

    spec: Any  # MuJoCo's MjSpec
    mjcf: Mjcf  # the input from which the engine builds it again
    drawn: Mapping[str, MeshFile]  # mesh name -> its file, for meshes that are drawn from their files
    # joint name -> its first number and its count in `qpos` of the file, with all bodies
    positions: Mapping[str, tuple[int, int]]
    keyframes: tuple[StatedKeyframe, ...]  # in the order of the file
    actuators: Mapping[str, int]  # name -> the number of its controls, in the order of the file
    notes: Notes  # parts that are left out


def build(files: MjcfFiles, place: Location) -> Built:
    """Build the model of a collected file. Raises ModelError, and ValueError if MuJoCo refuses it."""
    spec = mujoco.MjSpec.from_string(files.text, include=dict(files.models))
    _name_all(spec)
    positions = _positions(spec)
    actuators = {actuator.name: _controls(actuator) for actuator in spec.actuators}
    keyframes = _keyframes(spec, files)
    notes = Notes(files, place)
    floor, floor_look = _floor(spec, notes, files.patterns)
    excluded = frozenset(frozenset((pair.bodyname1, pair.bodyname2)) for pair in spec.excludes)
    paired = frozenset(frozenset((pair.geomname1, pair.geomname2)) for pair in spec.pairs)
    _leave_out(spec, notes)
    looked_at = _looked_at(spec)
    drawn = dict[str, MeshFile]()
    meshes = dict[str, MeshBytes]()
    real = {geom.meshname for geom in spec.geoms if geom.name not in looked_at or geom.type != _GEOM.mjGEOM_MESH}
    used = {geom.meshname for geom in spec.geoms}
    for mesh in spec.meshes:
        file = files.meshes.get(mesh.file)
        if file is None:
            continue
        if file.path.suffix.lower().removeprefix(".") not in READERS:
            _parsed(file)
        if mesh.name not in used:
            continue
        moved = _frame(mesh) != _NO_FRAME
        if mesh.name in real or moved:
            meshes[mesh.name] = _parsed(file)
        if not moved:
            drawn[mesh.name] = file
    mjcf = Mjcf(
        files.text,
        dict(files.models),
        meshes,
        looked_at,
        tuple(actuator.name for actuator in spec.actuators),
        floor,
        excluded,
        paired,
        floor_look,
    )
    _fill_meshes(spec, mjcf)
    return Built(spec, mjcf, drawn, positions, keyframes, actuators, notes)


def engine_spec(mjcf: Mjcf) -> Any:
    """Return the model as the engine simulates it: without geoms that are only looked at."""
    spec = _spec(mjcf)
    for geom in list(spec.geoms):
        if geom.name in mjcf.looked_at:
            spec.delete(geom)
    _fill_meshes(spec, mjcf)
    _state_masses(spec)
    return spec


def compiled(spec: Any) -> Any:
    """Return the compiled model. Of an attribute that MuJoCo will remove, it warns in a way that no report shows."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return spec.compile()


def _state_masses(spec: Any) -> None:
    """State the mass and inertia of each body as <compiler> of the file changes them; the scene has its own one."""
    compiler, usual = spec.compiler, mujoco.MjSpec().compiler
    if all(np.array_equal(getattr(compiler, name), getattr(usual, name)) for name in _MASS_SETTINGS):
        return
    model = compiled(spec)
    for body in spec.bodies[1:]:
        number = model.body(body.name).id
        body.explicitinertial = True
        body.mass = float(model.body_mass[number])
        body.ipos, body.iquat = model.body_ipos[number], model.body_iquat[number]
        body.inertia = model.body_inertia[number]
        body.fullinertia[0] = np.nan
    for name in _MASS_SETTINGS:
        setattr(compiler, name, getattr(usual, name))


def surfaces_of(mjcf: Mjcf) -> dict[str, tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Return points (P, 3) in m, mesh frame, and triangles (T, 3) of each mesh; small ones if only drawn."""
    spec = _spec(mjcf)
    _fill_meshes(spec, mjcf)
    model = compiled(spec)
    surfaces = {}
    for mesh in range(model.nmesh):
        point, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        points = model.mesh_vert[point : point + model.mesh_vertnum[mesh]].astype(np.float64)
        faces = model.mesh_face[face : face + model.mesh_facenum[mesh]].astype(np.int64)
        surfaces[model.mesh(mesh).name] = points, faces
    return surfaces


def _spec(mjcf: Mjcf) -> Any:
    spec = mujoco.MjSpec.from_string(mjcf.text, include=dict(mjcf.models))
    _name_all(spec)
    _leave_out(spec, Notes(None, Location("")))
    return spec


class Notes:
    """Parts that are left out: one finding for each kind, at the first place of that kind."""

    def __init__(self, files: MjcfFiles | None, place: Location) -> None:
        self._files, self._place = files, place
        self._kinds = {} if files is None else dict(files.left_out)

    def place(self, element: Any) -> Location:
        """Return the place of an element of MuJoCo's model in the user's files."""
        number = re.search(r"line (\d+)", element.info)
        place = self._files.place(int(number[1])) if number and self._files is not None else None
        return place or self._place

    def leave_out(self, element: Any, text: str) -> None:
        """Note that an element is left out; `text` is the same for all elements of its kind."""
        self.add("passed-over", text, self.place(element))

    def add(self, rule: str, text: str, place: Location) -> None:
        """Note a problem of a rule at a place."""
        self._kinds.setdefault((rule, text), Places(place)).add(place)

    def findings(self) -> tuple[Finding, ...]:
        """Return one finding for each kind."""
        return tuple(finding(rule, f"{text}{places}", places.first) for (rule, text), places in self._kinds.items())


# --- names and positions ---


def _name_all(spec: Any) -> None:
    """Give a name to each body, joint, geom and actuator that has none."""
    for kind, elements in (
        ("body", spec.bodies),
        ("joint", spec.joints),
        ("geom", spec.geoms),
        ("actuator", spec.actuators),
    ):
        for number, element in enumerate(elements):
            element.name = element.name or f"{kind}_{number}"


def _positions(spec: Any) -> dict[str, tuple[int, int]]:
    """Return joint name -> its first number in `qpos`, and the count of its numbers."""
    positions = dict[str, tuple[int, int]]()
    first = 0
    waiting = [spec.worldbody]
    while waiting:
        body = waiting.pop()
        for joint in body.joints:
            positions[joint.name] = first, _NUMBERS.get(joint.type, 1)
            first += positions[joint.name][1]
        waiting += reversed(body.bodies)
    return positions


def inputs(actuator: Any) -> int:
    """Return the inputs of a <pid> or <dcmotor> as bits of mujoco.mjtCtrlInput; 0 for other actuators."""
    if actuator.gaintype not in {mujoco.mjtGain.mjGAIN_PID, mujoco.mjtGain.mjGAIN_DCMOTOR}:
        return 0
    is_pid = actuator.gaintype == mujoco.mjtGain.mjGAIN_PID
    return int(actuator.ctrlspec) or int(_INPUT.mjINPUT_POS | _INPUT.mjINPUT_VEL if is_pid else _INPUT.mjINPUT_VOLTAGE)


def _controls(actuator: Any) -> int:
    """Return the number of controls of an actuator: its share of `ctrl` of a keyframe."""
    if actuator.gaintype == mujoco.mjtGain.mjGAIN_SO3:
        return 4 if actuator.ctrlspec == mujoco.mjtCtrlChart.mjCHART_QUAT else 3
    stated = inputs(actuator)
    return (stated & ~int(_INPUT.mjINPUT_NONE)).bit_count() if stated else 1


def _keyframes(spec: Any, files: MjcfFiles) -> tuple[StatedKeyframe, ...]:
    # MuJoCo does not keep the lines of keyframes.
    lines = (number for number, line in enumerate(files.text.split("\n"), 1) if line.startswith(("<key ", "<key/")))
    places = map(files.place, lines)
    # Keyframes of attached models come last, and have no line in this text.
    return tuple(
        StatedKeyframe(key.name or str(number), tuple(key.qpos), tuple(key.ctrl), next(places, None))
        for number, key in enumerate(spec.keys)
    )


# --- parts that are left out ---


def _leave_out(spec: Any, notes: Notes) -> None:
    """Delete the parts that are not simulated. Raises ModelError if the rest is not a robot."""
    robot, chosen = robot_bodies(spec, notes.place)
    if chosen:
        notes.leave_out(next(body for body in spec.worldbody.bodies if body.name in robot), chosen)
    names = set[str]()
    others = [body for body in spec.worldbody.bodies if body.name not in robot]
    for body in others:
        names |= names_below(body)
    if others:
        first = named([body.name for body in others])
        notes.leave_out(others[0], f"the file also has body {first}: {_OTHER_BODY}")
    wrapped = {step.target.name for tendon in spec.tendons for step in tendon.path if step.target is not None}
    for tendon in _outside(spec.tendons, names, notes):
        names.add(tendon.name)
        spec.delete(tendon)
    dropped = [*spec.keys, *spec.pairs, *spec.excludes, *_outside(spec.equalities, names, notes)]
    dropped += [actuator for actuator in spec.actuators if actuator.target in names]
    dropped += _disabled(spec, names, notes)
    dropped += [body for body in spec.worldbody.bodies if body.name not in robot]
    _take_pairs(spec, names | {geom.name for geom in spec.worldbody.geoms}, notes)
    for geom in spec.worldbody.geoms:
        if geom.name in wrapped:
            geom.contype = geom.conaffinity = 0
            continue
        dropped.append(geom)
        notes.leave_out(geom, _WORLD_GEOM)
    for element in dropped:
        spec.delete(element)
    _leave_out_heightfields(spec, notes)


def _outside(elements: Iterable[Any], names: set[str], notes: Notes) -> list[Any]:
    """Return the tendons or equalities that need a part in `names`; note each that joins the robot to such a part."""
    outside = list[Any]()
    for element in elements:
        if isinstance(element, mujoco.MjsTendon):
            kind, ends = "a <tendon>", {step.target.name for step in element.path if step.target is not None}
        else:
            kind, ends = "an <equality>", {element.name1, element.name2} - {"", "world"}
        if ends & names:
            outside.append(element)
            if ends - names:
                notes.leave_out(element, f"{kind} {_TO_OTHER_BODY}")
    return outside


def _disabled(spec: Any, outside: set[str], notes: Notes) -> list[Any]:
    """Return the actuators that the file disables; `outside`: names of parts that are not the robot's."""
    groups = int(spec.option.disableactuator)
    actuators = [actuator for actuator in spec.actuators if actuator.target not in outside]
    actuators = [
        actuator for actuator in actuators if actuator.group in range(_MAX_GROUPS) and groups >> actuator.group & 1
    ]
    for actuator in actuators:
        notes.leave_out(actuator, "an <actuator> is left out, because <option actuatorgroupdisable> disables its group")
    return actuators


def _take_pairs(spec: Any, outside: set[str], notes: Notes) -> None:
    """Let geoms collide that the file pairs with the world; `outside`: names of geoms that are not the robot's."""
    for pair in spec.pairs:
        ours = [name for name in (pair.geomname1, pair.geomname2) if name not in outside]
        if len(ours) == 1:
            geom = spec.geom(ours[0])
            geom.contype = geom.contype or 1
        elif ours:
            notes.leave_out(
                pair, "<pair> in <contact> is not simulated, unless the scenario says robot.self_collision: true"
            )


# Groups that <option actuatorgroupdisable> can name.
_MAX_GROUPS: Final = 31
_OTHER_BODY: Final = "left out, because it is not a part of the robot; make it a body of 'world.objects'"
_TO_OTHER_BODY: Final = "that joins the robot to a body that is left out is left out too: nothing acts there"
_WORLD_GEOM: Final = "a <geom> of <worldbody> is left out, such as a floor: 'world' of the scenario has the ground"


def _floor(spec: Any, notes: Notes, patterns: Mapping[str, Pattern]) -> tuple[float, FloorLook | None]:
    """Return the height of the floor of the file in m and its look; note which one counts if there are several."""
    height, geom, count = floor_height(spec)
    if count > 1:
        text = f"geom '{geom.name}' at z = {height:g} m is the ground: it is the highest of {count} level planes"
        notes.leave_out(geom, f"{text}, and heights of keyframes and of a bolted robot start from it")
    return height, None if geom is None else floor_look(spec, geom, patterns)


def _leave_out_heightfields(spec: Any, notes: Notes) -> None:
    """Leave out heightfields that the robot does not use, and refuse files of the others."""
    used = {geom.hfieldname: geom for geom in spec.geoms if geom.hfieldname}
    for field in list(spec.hfields):
        if field.name not in used:
            spec.delete(field)
        elif field.file:
            problem = f"heightfield '{field.name}' of geom '{used[field.name].name}' is read from a file"
            remedy = "state its 'elevation' in the model, or make it a body of the scenario's world"
            raise ModelError(f"{problem}, which is not supported; {remedy}", notes.place(used[field.name]))


# --- geoms that are only looked at, and meshes ---


def _looked_at(spec: Any) -> frozenset[str]:
    """Return the geoms that neither collide nor have a part in the inertia of their bodies."""
    if spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        return frozenset()
    wrapped = {step.target.name for tendon in spec.tendons for step in tendon.path if step.target is not None}
    return frozenset(
        geom.name
        for geom in spec.geoms
        if not (geom.contype or geom.conaffinity)
        and (geom.parent.explicitinertial or geom.mass == 0 or (geom.density == 0 and not geom.mass > 0))
        and geom.name not in wrapped
    )


def _fill_meshes(spec: Any, mjcf: Mjcf) -> None:
    """Give each mesh with a file its points and triangles, and leave out unused ones: MuJoCo must not open a file."""
    used = {geom.meshname for geom in spec.geoms}
    for mesh in list(spec.meshes):
        if mesh.name not in used:
            spec.delete(mesh)
        elif mesh.name in mjcf.meshes:
            points, faces = mjcf.meshes[mesh.name]
            mesh.file = ""
            mesh.uservert = np.frombuffer(points, np.float32).tolist()
            mesh.userface = np.frombuffer(faces, np.int32).tolist()
        elif mesh.file:
            mesh.file = ""
            mesh.uservert, mesh.userface = list(_CORNERS), list(_FACES)
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL


def _frame(mesh: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return tuple(map(float, mesh.refpos)), tuple(map(float, mesh.refquat))


def _parsed(file: MeshFile) -> MeshBytes:
    """Return the points and triangles of a mesh file as bytes. Raises RefusedModel."""
    try:
        parsed = parsed_mesh(file.path)
    except MeshError as error:
        raise refusal(f"mesh '{file.name}': {error} [{error.rule}]", file.place) from None
    return parsed.points_xyz.astype(np.float32).tobytes(), np.concatenate(parsed.parts).astype(np.int32).tobytes()


_AS_IT_IS: Final = mujoco.mjtOrientation.mjORIENTATION_QUAT
_MAX_NAMED: Final = 5
_LEVEL: Final = 0.9986  # the vertical part of a unit normal: planes within 3 deg are level


def named(bodies: list[str]) -> str:
    """Return the first names of bodies, and the count of the others."""
    first = ", ".join(f"'{name}'" for name in bodies[:_MAX_NAMED])
    return f"{first} and {len(bodies) - _MAX_NAMED} more" if len(bodies) > _MAX_NAMED else first


def robot_bodies(spec: Any, place: Callable[[Any], Location]) -> tuple[frozenset[str], str]:
    """Return the bodies of the world that make up the robot, and a note on the choice, which may be empty.

    They are the bodies with joints of their own: one that moves freely, or all that are fixed to the world. If there
    are several, those with actuators are the robot. Raises ModelError if that is ambiguous. `place`: returns the place
    of an element.
    """
    tops = [body for body in spec.worldbody.bodies if not body.mocap]
    free = {body.name for body in tops if any(joint.type == _FREE for joint in body.joints)}
    jointed = {body.name for body in tops if _has_joints(body)}
    robot, note = jointed or free or {body.name for body in tops}, ""
    if len(robot) > 1 and jointed:
        driven = _driven(spec, {body.name: names_below(body) for body in tops if body.name in robot}, free)
        if not driven and not robot & free:
            names = named([body.name for body in tops if body.name in robot])
            note = f"the bodies {names} of <worldbody> are one robot: no <actuator> acts on a part of it only"
        robot = driven or robot
    if len(robot) == 1 or (robot and not robot & free and jointed):
        return frozenset(robot), note
    problem = f"the model has {len(robot)} bodies in its world"
    if robot:
        problem += f", {named([body.name for body in tops if body.name in robot])}"
        problem += ": move the others to files of their own, for 'world.objects'"
        problem += ", or give only the robot an <actuator>" if jointed else ""
    raise ModelError(f"a robot must be one body with its children, but {problem}", place(spec.worldbody))


def names_below(body: Any) -> set[str]:
    """Return the names of a body, of all bodies below it, and of their joints, geoms and sites."""
    own = {body.name, *(element.name for kind in (body.joints, body.geoms, body.sites) for element in kind)}
    return own.union(*map(names_below, body.bodies)) - {""}


def _has_joints(body: Any) -> bool:
    return any(joint.type != _FREE for joint in body.joints) or any(map(_has_joints, body.bodies))


def _driven(spec: Any, names: dict[str, set[str]], free: set[str]) -> set[str]:
    """Return the bodies with actuators and those coupled to them; `names`: of their parts; `free`: they move freely."""
    tendons = {tendon.name: _wrapped(tendon) for tendon in spec.tendons}
    targets = set[str]()
    for actuator in spec.actuators:
        targets |= tendons.get(actuator.target, {actuator.target})
    driven = {body for body, parts in names.items() if parts & targets}
    bonds = [{equality.name1, equality.name2} for equality in spec.equalities]
    bonds += list(tendons.values())
    grown = True
    while grown:
        ours = set[str]().union(*(names[body] for body in driven))
        coupled = {body for body, parts in names.items() if any(parts & bond and ours & bond for bond in bonds)} - free
        grown = not coupled <= driven
        driven |= coupled
    return driven


def _wrapped(tendon: Any) -> set[str]:
    return {step.target.name for step in tendon.path if step.target is not None}


def floor_height(spec: Any) -> tuple[float, Any, int]:
    """Return the height in m and geom of the highest level plane that collides, and their count; or 0, None, 0."""
    floors = list(_floors(spec))
    highest = max(floors, key=lambda floor: floor[0], default=(0.0, None))
    return (*highest, len(floors))


def _floors(spec: Any) -> Iterator[tuple[float, Any]]:
    for geom in spec.worldbody.geoms:
        if geom.type != mujoco.mjtGeom.mjGEOM_PLANE or not (geom.contype or geom.conaffinity):
            continue
        height, upward = _placed(spec, geom)
        if upward >= _LEVEL:
            yield height, geom


def _placed(spec: Any, geom: Any) -> tuple[float, float]:
    """Return the height of a plane of the world in m, and the vertical part of its normal."""
    if geom.frame is None and geom.alt.type == _AS_IT_IS and not any(geom.quat[1:]):
        return float(geom.pos[2]), 1.0
    # MuJoCo's compiler knows all kinds of orientation. A body stands for each <frame> around the plane.
    alone = mujoco.MjSpec()
    alone.compiler.degree = spec.compiler.degree
    alone.compiler.eulerseq = spec.compiler.eulerseq
    frames, frame = [], geom.frame
    while frame is not None:
        frames.append(frame)
        frame = frame.frame
    inner = alone.worldbody
    for frame in reversed(frames):
        inner = _copy_pose(frame, inner.add_body())
    plane = inner.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1])
    _copy_pose(geom, plane)
    model = alone.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return float(data.geom_xpos[0, 2]), float(data.geom_xmat[0, 8])


def _copy_pose(source: Any, target: Any) -> Any:
    target.pos, target.quat = source.pos, source.quat
    for name in ("type", "axisangle", "xyaxes", "zaxis", "euler"):
        setattr(target.alt, name, getattr(source.alt, name))
    return target

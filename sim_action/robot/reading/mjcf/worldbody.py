"""The world of an MJCF file: its bodies that make up the robot, and its floor."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Final

import mujoco

from sim_action.core.errors import Location, ModelError

_FREE: Final = mujoco.mjtJoint.mjJNT_FREE
_AS_IT_IS: Final = mujoco.mjtOrientation.mjORIENTATION_QUAT
_MAX_NAMED: Final = 5
# The vertical part of a unit normal: planes within 3 deg are level.
_LEVEL: Final = 0.9986


def named(bodies: list[str]) -> str:
    """Return the first names of bodies, and the count of the others."""
    first = ", ".join(f"'{name}'" for name in bodies[:_MAX_NAMED])
    return f"{first} and {len(bodies) - _MAX_NAMED} more" if len(bodies) > _MAX_NAMED else first


def robot_bodies(spec: Any, place: Callable[[Any], Location]) -> tuple[frozenset[str], str]:
    """Return the bodies of the world that make up the robot, and a note on the choice, which may be empty.

    They are the bodies with joints of their own: one that moves freely, or all that are fixed to the world. If there
    are several, those with actuators are the robot. Raises ModelError if that is ambiguous.

    :param place: returns the place of an element.
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
    found = f"the model has {len(robot)} bodies in its world"
    if robot:
        found += f", {named([body.name for body in tops if body.name in robot])}"
        found += ": move the others to files of their own, for 'world.objects'"
        found += ", or give only the robot an <actuator>" if jointed else ""
    raise ModelError(f"a robot must be one body with its children, but {found}", place(spec.worldbody))


def names_below(body: Any) -> set[str]:
    """Return the names of a body, of all bodies below it, and of their joints, geoms and sites."""
    own = {body.name, *(element.name for kind in (body.joints, body.geoms, body.sites) for element in kind)}
    return own.union(*map(names_below, body.bodies)) - {""}


def _has_joints(body: Any) -> bool:
    return any(joint.type != _FREE for joint in body.joints) or any(map(_has_joints, body.bodies))


def _driven(spec: Any, names: dict[str, set[str]], free: set[str]) -> set[str]:
    """Return the bodies with actuators, and those fixed to the world that an equality couples to them.

    :param names: body -> the names of its parts. free: bodies that move freely.
    """
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
    """Return the height of the highest level plane of the world that collides, its geom, and the count of such planes.

    The height is in m; without such a plane, the result is 0, None and 0.
    """
    found = list(_floors(spec))
    highest = max(found, key=lambda floor: floor[0], default=(0.0, None))
    return (*highest, len(found))


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

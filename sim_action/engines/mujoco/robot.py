"""The robot as bodies and joints of a MuJoCo model, from the cleaned URDF or from MJCF."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

import mujoco

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.engines.mujoco.contact_pairs import Collider
from sim_action.engines.mujoco.geoms import add_collision, wxyz
from sim_action.engines.mujoco.names import engine_name
from sim_action.robot.documents.urdf_elements import child_of
from sim_action.robot.model.robot_model import WORLD, Joint, Mimic, RobotModel, Surface
from sim_action.robot.reading.mjcf.mujoco_spec import engine_spec
from sim_action.world.mass_properties import symmetric, turned_tensor

_JOINT_TYPES: Final = {
    "revolute": mujoco.mjtJoint.mjJNT_HINGE,
    "continuous": mujoco.mjtJoint.mjJNT_HINGE,
    "prismatic": mujoco.mjtJoint.mjJNT_SLIDE,
}

# rad or m, beyond any joint. MuJoCo accepts no range that is open at one end.
_FAR: Final = 1e16


def add_robot(spec: Any, model: RobotModel, *, fixed: bool) -> list[Collider]:
    """Add the links and joints of a URDF with the base at the origin; return the colliders."""
    # `sim_action.robot` wrote this text.
    root = ET.fromstring(model.urdf)  # noqa: S314 - see above
    links = {link.attrib["name"]: link for link in root.iterfind("link")}
    joints = {joint.attrib["name"]: joint for joint in root.iterfind("joint")}
    base = spec.worldbody.add_body(name=engine_name(model.root))
    if not fixed:
        base.add_freejoint(align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE)
    colliders = _fill(spec, base, links[model.root], model)
    waiting = [(model.root, base)]
    while waiting:
        parent, above = waiting.pop()
        for joint in (joint for joint in model.joints if joint.parent == parent):
            # MuJoCo has joints in series in one body, and no massless bodies.
            parts = [joint, *_in_series(model, joint)]
            element = joints[parts[-1].ball or parts[-1].name]
            child = child_of(element)
            body = _hang(above, joint, child)
            for part in parts:
                _join(body, part, joints[part.ball or part.name])
            colliders += _fill(spec, body, links[child], model)
            waiting.append((child, body))
    for joint in model.joints:
        if joint.mimic is not None:
            _follow(spec, joint, joint.mimic)
    return colliders


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


def _hang(parent: Any, joint: Joint, child: str) -> Any:
    at = joint.origin
    return parent.add_body(name=engine_name(child), pos=list(at.position_xyz), quat=wxyz(at.orientation_xyzw))


def _join(body: Any, joint: Joint, element: Element) -> None:
    """Add a joint to its body; `joint`: of a ball joint, its first part."""
    dynamics = element.find("dynamics")
    if joint.ball:
        damping = [_number(dynamics, "damping"), 0, 0]
        body.add_joint(name=engine_name(joint.ball), type=mujoco.mjtJoint.mjJNT_BALL, damping=damping)
    elif joint.moves:
        body.add_joint(
            name=engine_name(joint.name),
            type=_JOINT_TYPES[joint.type],
            axis=list(joint.axis_xyz),
            damping=[_number(dynamics, "damping"), 0, 0],
            frictionloss=_number(dynamics, "friction"),
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
    # MuJoCo rejects a range of length 0.
    narrow = 1e-9 * (lower == upper)
    return {"limited": mujoco.mjtLimited.mjLIMITED_TRUE, "range": [lower - narrow, upper + narrow]}


def _fill(spec: Any, body: Any, link: Element, model: RobotModel) -> list[Collider]:
    inertial = link.find("inertial")
    if inertial is not None and _number(inertial.find("mass"), "value") > 0:
        _weigh(body, inertial)
    name = link.attrib["name"]
    surface = model.links_by_name[name].surface
    colliders = []
    for number, collision in enumerate(link.iterfind("collision")):
        shape = collision.find("geometry/*")
        assert shape is not None
        added = add_collision(
            spec, body, f"robot/{name}/{number}", shape, _origin(collision), hull_files=model.hull_files
        )
        colliders += [Collider(geom, name, surface) for geom in added]
    return colliders


def _weigh(body: Any, inertial: Element) -> None:
    pose, inertia = _origin(inertial), inertial.find("inertia")
    stated = symmetric(_number(inertia, name) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    # MuJoCo accepts a full tensor only in the axes of the link.
    tensor = turned_tensor(stated, pose.orientation_xyzw)
    body.explicitinertial = True
    body.mass = _number(inertial.find("mass"), "value")
    body.ipos = list(pose.position_xyz)
    body.fullinertia = tensor[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)].tolist()


def _origin(element: Element) -> Pose:
    stated = element.find("origin")
    position, rpy = (
        (0.0, 0.0, 0.0) if stated is None or name not in stated.attrib else _vector(stated.attrib[name])
        for name in ("xyz", "rpy")
    )
    return Pose(position, geometry.quaternion_from_rpy(*rpy))


def _vector(text: str) -> geometry.Vector3:
    x, y, z = map(float, text.split())
    return (x, y, z)


def _number(element: Element | None, name: str) -> float:
    return 0.0 if element is None else float(element.get(name, 0.0))


def add_native_robot(spec: Any, model: RobotModel, *, fixed: bool) -> list[Collider]:
    """Add the links, joints and actuators of an MJCF model; return the colliders."""
    assert model.mjcf is not None
    robot = engine_spec(model.mjcf)
    # Otherwise MuJoCo warns of each option that the model states in another way.
    for name in (name for name in dir(spec.option) if not name.startswith("_")):
        setattr(robot.option, name, getattr(spec.option, name))
    for joint in list(robot.joints):
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            robot.delete(joint)
    colliders = [_skin(geom) for geom in robot.geoms if geom.contype or geom.conaffinity]
    for geom in robot.geoms:
        geom.contype = geom.conaffinity = 0
    base = spec.worldbody.add_body(name=engine_name(WORLD)) if model.root == WORLD else spec.worldbody
    spec.attach(robot, prefix=engine_name(""), frame=base.add_frame())
    if not fixed:
        spec.body(engine_name(model.root)).add_freejoint(align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE)
    return colliders


def _skin(geom: Any) -> Collider:
    surface = Surface(float(geom.friction[0]))
    contype, conaffinity = int(geom.contype), int(geom.conaffinity)
    return Collider(engine_name(geom.name), geom.parent.name, surface, contype=contype, conaffinity=conaffinity)

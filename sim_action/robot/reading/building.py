"""Make a `RobotModel` of a draft: audit it, repair it, and write the URDF text that is safe for an engine.

An engine may read other parts of a file differently from its format, or from this reader. So the text has only the
parts that were understood, normalised: limits on both sides, axes of length 1, one <inertial> for each link.
tests/integration/test_fuzz.py compares both readers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final, cast
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core.geometry import Box, Vector3
from sim_action.robot.audit import joints, links
from sim_action.robot.documents.packages import Packages
from sim_action.robot.model.draft import (
    BALLS,
    SHAPES,
    UNLIMITED,
    ContactDraft,
    JointDraft,
    LinkDraft,
    OriginDraft,
    RobotDraft,
    ShapeDraft,
)
from sim_action.robot.model.findings import Finding, refuse_errors, without_harmless
from sim_action.robot.model.robot_model import (
    MOMENTS,
    STOP_PLAY,
    Inertial,
    Joint,
    JointType,
    Link,
    RobotModel,
    Shape,
    Visual,
    ball_joints,
)
from sim_action.robot.reading.control_tags import with_controllers
from sim_action.robot.reading.repairs import repaired, with_masses

Check = Callable[[RobotDraft], Iterator[Finding]]

# A stage relies on the facts that the stages before it have established.
STAGES: Final[tuple[tuple[Check, ...], ...]] = (
    (links.presence,),
    (joints.names, joints.joint_types, joints.tree, joints.joint_counts, links.kinds),
    (
        joints.axes,
        joints.limits,
        joints.motors,
        joints.passive,
        joints.mimics,
        joints.mimic_limits,
        links.sizes,
        links.extents,
        links.collisions,
        links.masses,
        links.tensors,
        links.inertials,
        links.angles,
        joints.limit_units,
    ),
)


def audit(draft: RobotDraft) -> list[Finding]:
    """Return the findings of all stages, up to and including the first stage with a fatal finding."""
    findings = list[Finding]()
    for stage in STAGES:
        findings += [finding for check in stage for finding in check(draft)]
        if any(finding.level == "fatal" for finding in findings):
            break
    return findings


def built(
    draft: RobotDraft | None, findings: Iterable[Finding], path: Path, packages: Packages, allow: Iterable[str]
) -> RobotModel:
    """Return the model of a draft. Raises ModelError.

    `draft`: None if its reader found something fatal; `findings`: of its reader; `path`: the file from which relative
    paths start; `allow`: rules whose errors are accepted.
    """
    allowed = set(allow)
    findings = [*findings, *(audit(draft) if draft is not None else ())]
    refuse_errors(findings, allowed)
    assert draft is not None, "a fatal finding raises"
    meshes = links.MeshResolver(path, packages)
    draft = meshes.resolved(draft)
    findings += meshes.findings
    refuse_errors(findings, allowed)
    draft = repaired(draft)
    complete = with_masses(draft)
    parts = tuple(map(_link, draft.links, complete.links))
    findings += links.proportions(draft, parts)
    made, between = _joints(draft)
    kept, harmless = without_harmless(findings)
    return RobotModel(
        draft.name or path.stem,
        str(path),
        (*parts, *between),
        made,
        engine_text(complete),
        kept,
        with_controllers(draft.plugins, path, packages),
        commanded=draft.commanded,
        harmless=harmless,
    )


def _link(stated: LinkDraft, complete: LinkDraft) -> Link:
    """Return a link; `stated`, `complete`: without and with a negligible mass where it has none."""
    inertial = complete.inertial
    assert inertial is not None
    pose = inertial.origin.pose
    return Link(
        stated.name,
        None if stated.inertial is None else stated.inertial.mass,
        tuple(map(_shape, stated.collisions)),
        stated.surface,
        pose.position_xyz,
        tuple(_visuals(stated)),
        Inertial(inertial.mass, pose, inertial.moments),
    )


def _shape(shape: ShapeDraft) -> Shape:
    clean = None if shape.mesh is None else shape.mesh.clean
    lower, upper = _box(shape) if clean is None else clean.box
    hulls = b"" if clean is None else clean.text
    radius, length = (shape.sizes[name][0] if name in shape.sizes else None for name in ("radius", "length"))
    return Shape(shape.kind, shape.origin.pose, radius, lower, upper, hulls, length=length)


def _box(shape: ShapeDraft) -> Box:
    """Return the box around a shape whose frame is at its centre; the audit has checked its sizes."""
    x, y, z = (size / 2 for size in cast(Vector3, shape.size_xyz))
    return (-x, -y, -z), (x, y, z)


def _visuals(link: LinkDraft) -> Iterator[Visual]:
    """Yield the visuals of a link that can be drawn."""
    for visual in link.visuals:
        color, opacity = visual.paint or (None, 1.0)
        if visual.mesh is not None and visual.mesh.path is not None:
            scale = visual.mesh.scale or (1.0, 1.0, 1.0)
            file = str(visual.mesh.path)
            yield Visual("mesh", visual.origin.pose, color, file=file, scale=scale, opacity=opacity)
        elif visual.size_xyz is not None:
            yield Visual(visual.kind, visual.origin.pose, color, visual.size_xyz, opacity=opacity)


def _joints(draft: RobotDraft) -> tuple[tuple[Joint, ...], tuple[Link, ...]]:
    """Return the joints, and the massless links between the parts of ball joints."""
    made: list[Joint] = []
    between: list[Link] = []
    for joint in draft.joints:
        if joint.type in BALLS:
            damping = joint.motion.damping or 0.0
            parts, inner = ball_joints(joint.name, joint.parent, joint.child, joint.origin.pose, damping=damping)
            made += parts
            between += inner
        else:
            made.append(_joint(joint, draft.starts.get(joint.name)))
    return tuple(made), tuple(between)


def _joint(joint: JointDraft, start: float | None) -> Joint:
    limit = joint.motion.limit
    effort, velocity = (None, None) if limit is None else (limit.effort, limit.velocity)
    lower, upper = joint.limits
    stiffness, at_rest = joint.motion.spring
    return Joint(
        name=joint.name,
        type=cast(JointType, joint.type),
        parent=joint.parent,
        child=joint.child,
        origin=joint.origin.pose,
        axis_xyz=joint.motion.direction,
        lower=lower,
        upper=upper,
        max_effort=effort if effort and effort > 0 else None,
        max_velocity=velocity if velocity and velocity > 0 else None,
        mimic=joint.mimic,
        stiffness=stiffness,
        spring_reference=at_rest,
        damping=joint.motion.damping or 0.0,
        friction=joint.motion.friction or 0.0,
        series=joint.series,
        start=start,
    )


def engine_text(draft: RobotDraft) -> str:
    """Return the URDF text, in short lines: the engine's parser splits long lines inside a token."""
    robot = Element("robot", name="robot")
    robot.extend(map(_written_link, draft.links))
    robot.extend(map(_written_joint, draft.joints))
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode")


def _written_link(link: LinkDraft) -> Element:
    written = Element("link", name=link.name)
    if link.inertial is not None:
        inertial = _with_origin(ET.SubElement(written, "inertial"), link.inertial.origin)
        ET.SubElement(inertial, "mass", value=repr(link.inertial.mass))
        ET.SubElement(inertial, "inertia", dict(zip(MOMENTS, map(repr, link.inertial.moments), strict=True)))
    written.extend(map(_written_collision, link.collisions))
    if link.contact is not None:
        written.append(_written_contact(link.contact))
    return written


def _written_collision(shape: ShapeDraft) -> Element:
    written = _with_origin(Element("collision"), shape.origin)
    geometry = ET.SubElement(written, "geometry")
    if shape.mesh is None:
        ET.SubElement(geometry, shape.kind, {name: _spelled(shape.sizes[name]) for name in SHAPES[shape.kind]})
    elif shape.mesh.clean is not None:
        from sim_action.meshes.collision_hulls import hull_file_name  # a usual run does without it

        ET.SubElement(geometry, "mesh", filename=hull_file_name(shape.mesh.clean.text))
    return written


def _written_contact(contact: ContactDraft) -> Element:
    """Write <contact> without stiffness and damping, which are in `Surface`: Bullet would guess the missing one."""
    written = Element("contact")
    for tag, value in contact.coefficients.items():
        if tag not in {"stiffness", "damping"}:
            ET.SubElement(written, tag, value=repr(value))
    if contact.has_friction_anchor:
        ET.SubElement(written, "friction_anchor")
    return written


def _written_joint(joint: JointDraft) -> Element:
    kind = "spherical" if joint.type in BALLS else joint.type
    written = _with_origin(Element("joint", name=joint.name, type=kind), joint.origin)
    ET.SubElement(written, "parent", link=joint.parent)
    ET.SubElement(written, "child", link=joint.child)
    if kind == "spherical":
        # It has no axis, but PyBullet warns without one.
        ET.SubElement(written, "axis", xyz="1 0 0")
    elif kind in ("revolute", "continuous", "prismatic"):
        # Bullet scales the motion of a prismatic joint by the length of its axis.
        ET.SubElement(written, "axis", xyz=_spelled(joint.motion.direction))
        ET.SubElement(written, "limit", _written_limit(joint))
    dynamics = {"damping": joint.motion.damping, "friction": None if kind == "spherical" else joint.motion.friction}
    stated = _stated(dynamics)
    if stated:
        ET.SubElement(written, "dynamics", stated)
    return written


def _written_limit(joint: JointDraft) -> dict[str, str]:
    """Return <limit>: no positions if no side is limited, else both, because Bullet's default upper limit is -1."""
    limit = joint.motion.limit
    motor = {} if limit is None else {"effort": limit.effort, "velocity": limit.velocity}
    written = _stated({name: value for name, value in motor.items() if value is not None and value >= 0})
    lower, upper = joint.limits
    if (lower, upper) != (None, None):
        below, above = -UNLIMITED if lower is None else lower, UNLIMITED if upper is None else upper
        written |= {"lower": repr(below - STOP_PLAY), "upper": repr(above + STOP_PLAY)}
    return written


def _with_origin(written: Element, origin: OriginDraft) -> Element:
    stated = {"xyz": origin.xyz, "rpy": origin.rpy}
    attributes = {name: _spelled(vector) for name, vector in stated.items() if vector is not None}
    if attributes:
        ET.SubElement(written, "origin", attributes)
    return written


def _stated(values: Mapping[str, float | None]) -> dict[str, str]:
    return {name: repr(value) for name, value in values.items() if value is not None}


def _spelled(values: tuple[float, ...]) -> str:
    return " ".join(map(repr, values))

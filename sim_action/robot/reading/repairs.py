"""Repair the draft of a robot that the audit has accepted, so that an engine simulates it as the findings say.

Joints with several motions become joints in series with massless links between them: a planar joint is two slides in
the plane normal to its axis and a hinge about the axis, a universal joint is two hinges, and a floating joint below the
base is three slides and a ball joint. No motor holds any of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from sim_action.core import geometry
from sim_action.core.geometry import Vector3
from sim_action.core.records import replace
from sim_action.robot.audit.joints import is_free_base, mimic_problem, still_position
from sim_action.robot.audit.links import RigidBodies, increase, principal_moments
from sim_action.robot.model.draft import (
    SERIES,
    InertialDraft,
    JointDraft,
    LinkDraft,
    MotionDraft,
    OriginDraft,
    RobotDraft,
    origin_at,
    part_names,
)
from sim_action.robot.model.kinematics import joint_motion
from sim_action.robot.model.robot_model import MOVING_TYPES, Joint, Moments

# A link without <inertial> gets this share of the mass of the others, as a ball of this radius.
_NEGLIGIBLE_SHARE: Final = 1e-4
_NEGLIGIBLE_RADIUS_M: Final = 0.05
_LEAST_MASS: Final = 1e-6
_DIAGONAL: Final[Moments] = (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)


def repaired(draft: RobotDraft) -> RobotDraft:
    """Return a robot without parts that cannot work, and with its joints with several motions in series."""
    return _with_series(_with_sound_links(_with_valid_mimics(_without_free_base(draft))))


def _without_free_base(draft: RobotDraft) -> RobotDraft:
    """Remove an empty root link and its floating joint. They mean that the base is free, which is the default."""
    free = [joint for joint in draft.joints if is_free_base(draft, joint)]
    roots = {joint.parent for joint in free}
    links = tuple(link for link in draft.links if link.name not in roots)
    return replace(draft, links=links, joints=tuple(joint for joint in draft.joints if joint not in free))


def _with_valid_mimics(draft: RobotDraft) -> RobotDraft:
    """Remove each <mimic> that cannot work; a joint that its <mimic> never moves becomes fixed, where it is held."""
    joints = draft.joints_by_name
    still = {
        name: position for name, joint in joints.items() if (position := still_position(joint, joints)) is not None
    }
    joints = {name: _held(joint, still[name]) if name in still else joint for name, joint in joints.items()}
    odd = {name for name, joint in joints.items() if mimic_problem(joint, joints) is not None}
    return replace(
        draft, joints=tuple(replace(joint, mimic=None) if name in odd else joint for name, joint in joints.items())
    )


def _held(joint: JointDraft, position: float) -> JointDraft:
    """Return a joint that is fixed at a position."""
    pose = joint.origin.pose
    if position and joint.type in MOVING_TYPES:
        moving = Joint("", joint.type, "", "", pose, joint.motion.direction)
        pose = geometry.compose(pose, joint_motion(moving, position))
    return replace(joint, type="fixed", mimic=None, origin=origin_at(pose, joint.origin.place))


def _with_sound_links(draft: RobotDraft) -> RobotDraft:
    """Remove collision shapes without any extent, and a mass of 0 from links that are fixed to others with a mass."""
    bodies = RigidBodies(draft)

    def mended(link: LinkDraft) -> LinkDraft:
        adds_nothing = link.inertial is not None and link.inertial.mass == 0 and bodies.holds_mass(link.name)
        shapes = tuple(shape for shape in link.collisions if not shape.is_empty)
        return replace(link, inertial=None if adds_nothing else link.inertial, collisions=shapes)

    return replace(draft, links=tuple(map(mended, draft.links)))


def _with_series(draft: RobotDraft) -> RobotDraft:
    """Replace the joints with several motions."""
    if not any(joint.type in SERIES for joint in draft.joints):
        return draft
    joints = list[JointDraft]()
    links = list[LinkDraft]()
    for joint in draft.joints:
        joints += _series_of(joint) if joint.type in SERIES else [joint]
        links += [LinkDraft(name, joint.place, is_massless=True) for name in _links_in(joint)]
    return replace(draft, links=(*draft.links, *links), joints=tuple(joints))


def _links_in(joint: JointDraft) -> tuple[str, ...]:
    """Return the names of the massless links in a joint with several motions."""
    names = part_names(joint)
    return names if joint.type == "floating" else names[:-1]


def _series_of(joint: JointDraft) -> Iterator[JointDraft]:
    """Yield the joints that replace a joint with several motions, from the parent to the child."""
    part = replace(joint, second=None, mimic=None, series=joint.name)
    ends = (*_links_in(joint), joint.child)
    for name, end, (kind, motion) in zip(part_names(joint), ends, _motions(joint), strict=False):
        part = replace(part, name=name, type=kind, child=end, motion=motion)
        yield part
        part = replace(part, parent=end, origin=OriginDraft())
    if joint.type == "floating":
        motion = MotionDraft(damping=joint.motion.damping)
        yield replace(part, name=joint.name, type="spherical", child=joint.child, motion=motion, series="")


def _motions(joint: JointDraft) -> Iterator[tuple[str, MotionDraft]]:
    """Yield the type and the motion of each part; only in a universal joint has each its own limits and friction."""
    if joint.type == "universal":
        for motion in (joint.motion, joint.second or MotionDraft()):
            limit = motion.limit
            is_limited = limit is not None and (limit.lower, limit.upper) != (None, None)
            yield "revolute" if is_limited else "continuous", replace(motion, axis_xyz=motion.direction)
        return
    damping = joint.motion.damping
    if joint.type == "floating":
        yield from (("prismatic", MotionDraft(along, damping=damping)) for along in geometry.AXES)
        return
    normal = joint.motion.direction
    first = _along_plane(normal)
    yield "prismatic", MotionDraft(first, damping=damping)
    yield "prismatic", MotionDraft(geometry.cross(normal, first), damping=damping)
    yield "continuous", MotionDraft(normal, damping=damping)


def _along_plane(normal: Vector3) -> Vector3:
    """Return the x axis of the plane normal to an axis: x for z, y for x, z for y."""
    x, y, z = map(abs, normal)
    start = geometry.AXES[1 if x >= max(y, z) else 2 if y >= z else 0]
    along = sum(a * b for a, b in zip(start, normal, strict=True))
    rest = tuple(a - along * b for a, b in zip(start, normal, strict=True))
    length = math.hypot(*rest)
    return (rest[0] / length, rest[1] / length, rest[2] / length)


def with_masses(draft: RobotDraft) -> RobotDraft:
    """Return a robot whose links all have a mass and possible moments of inertia; an engine would assume 1 kg.

    A mass of 0 that the audit accepted becomes a negligible one. The base link keeps it, which fixes the base.
    """
    children = {joint.child for joint in draft.joints}
    weighty = {
        link.name: link.inertial.mass
        for link in draft.links
        if link.inertial is not None and not (link.inertial.mass == 0 and link.name in children)
    }
    negligible = float(f"{max(_LEAST_MASS, _NEGLIGIBLE_SHARE * sum(weighty.values())):.6g}")
    inertials = (_inertial(link, None if link.name in weighty else negligible) for link in draft.links)
    links = (replace(link, inertial=inertial) for link, inertial in zip(draft.links, inertials, strict=True))
    return replace(draft, links=tuple(links))


def _inertial(link: LinkDraft, negligible: float | None) -> InertialDraft:
    """Return the inertia of a link, repaired, and with Bullet's factor on it, which other engines would ignore.

    `negligible`: its mass in kg if it has none of its own.
    """
    if link.inertial is None or negligible is not None:
        mass = 0.0 if link.is_massless else negligible or 0.0
        return InertialDraft(OriginDraft(), mass, _ball(mass), 0.0, link.place, link.place)
    moments = link.inertial.moments
    if not (link.inertial.mass or any(moments)):
        return link.inertial
    if principal_moments(moments)[2] <= 0:
        moments = _ball(link.inertial.mass or _LEAST_MASS)
    more = increase(moments)
    factor = 1.0 if link.contact is None else link.contact.inertia_scaling
    xx, xy, xz, yy, yz, zz = (factor * (moment + more * axis) for moment, axis in zip(moments, _DIAGONAL, strict=True))
    return replace(link.inertial, moments=(xx, xy, xz, yy, yz, zz))


def _ball(mass: float) -> Moments:
    moment = float(f"{0.4 * mass * _NEGLIGIBLE_RADIUS_M**2:.6g}")
    return moment, 0.0, 0.0, moment, 0.0, moment

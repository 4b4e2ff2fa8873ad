"""Check joints: axes, limits, motors, types and <mimic>, and that links and joints form a tree that an engine can hold.

The tree has one root, unique names, and one parent per link. PyBullet crashes on other models. It reports a state of
MAX_DEGREE_OF_FREEDOM = 128 numbers per body, and holds MAX_NUM_LINKS = 128 links (both in Bullet's
examples/SharedMemory/SharedMemoryCommands.h; bulletphysics/bullet3 issue 4621 asks for more). 7 of those numbers are
the pose of the base, also of a fixed base. Beyond that, PyBullet 3.2.7 gives wrong values without a warning: a joint
reads 0, and its position appears as a velocity of the base. From the 129th link on, it answers nothing.
tests/integration/test_engine_tables.py measures both.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from sim_action.core.geometry import ZERO
from sim_action.core.wording import FirstFew, did_you_mean, nearest
from sim_action.robot.model.draft import (
    BALLS,
    MAX_PART_SIZE_M,
    SERIES,
    UNLIMITED,
    JointDraft,
    LinkDraft,
    RobotDraft,
    part_names,
)
from sim_action.robot.model.findings import Finding, finding
from sim_action.robot.model.robot_model import MOVING_TYPES, RobotModel

LIMITED: Final = ("revolute", "prismatic")  # joint types that must have position limits

# Exporters round: smaller deviations are not reported; a share of the range, at most this many rad or m.
_ROUNDING: Final = 1e-3


_ODD_LIMITS: Final = {
    "revolute": ((20.0, 720.0), "rad, and a full turn is 6.28 rad: is it in degrees"),
    "prismatic": ((MAX_PART_SIZE_M, 10_000.0), "m: is it in millimetres"),
}
"""Joint type -> bounds between which a limit is suspicious, and the rest of the message.

A limit beyond the upper bound stands for "no limit".
"""


def axes(draft: RobotDraft) -> Iterator[Finding]:
    """Yield moving joints with an axis of length 0. Exporters write 0 0 0 for joints that do not move."""
    for joint in draft.joints:
        if joint.type in {"fixed", "floating", *BALLS}:
            continue
        for motion in filter(None, (joint.motion, joint.second)):
            if motion.axis_xyz == ZERO:
                message = f"joint '{joint.name}' has an axis of length 0"
                yield finding("zero-axis", message, motion.axis_place or joint.place)


def limits(draft: RobotDraft) -> Iterator[Finding]:
    """Yield joints with missing, reversed or equal limits, and continuous joints with limits, which do not count."""
    for joint in draft.joints:
        kind, name, limit = joint.type, joint.name, joint.motion.limit
        lower, upper = (None, None) if limit is None else (limit.lower, limit.upper)
        if kind == "continuous" and limit is not None and -UNLIMITED < (lower or 0.0) < (upper or 0.0) < UNLIMITED:
            message = (
                f"continuous joint '{name}' has limits of {lower or 0:g} and {upper or 0:g}, which do not count: it "
                "turns without limits; make it 'revolute' if they should"
            )
            yield finding("continuous-limits", message, limit.place)
        if kind not in LIMITED:
            continue
        if limit is None and kind == "revolute":
            message = (
                f"revolute joint '{name}' has no <limit>: it turns without limits; make it 'continuous' if it should"
            )
            yield finding("unlimited-joint", message, joint.place)
        elif limit is None or (lower is None and upper is None):
            other = ", or make it 'continuous' if it turns without end" if kind == "revolute" else ""
            message = (
                f"{kind} joint '{name}' has no limits, so it could not move: add <limit lower= upper= .../>{other}"
            )
            yield finding("missing-limits", message, joint.place if limit is None else limit.place)
        elif (lower or 0.0) > (upper or 0.0):
            message = f"joint '{name}' has a lower limit of {lower or 0:g} above its upper limit of {upper or 0:g}"
            yield finding("reversed-limits", message, limit.place)
        elif (lower or 0.0) == (upper or 0.0):
            other = "make it 'continuous' if it is a wheel, " if kind == "revolute" else ""
            message = f"joint '{name}' cannot move: both limits are {lower or 0:g}; {other}make it 'fixed' if not"
            yield finding("locked-joint", message, limit.place)


def limit_units(draft: RobotDraft) -> Iterator[Finding]:
    """Yield position limits that are probably in degrees or millimetres."""
    for joint in draft.joints:
        limit, kind = joint.motion.limit, joint.type
        if limit is None or kind not in _ODD_LIMITS:
            continue
        (least, most), unit = _ODD_LIMITS[kind]
        farthest = max(abs(limit.lower or 0.0), abs(limit.upper or 0.0))
        if least < farthest <= most:
            message = f"{kind} joint '{joint.name}' has a limit of {farthest:g} {unit}?"
            yield finding("odd-limits", message, limit.place)


def motors(draft: RobotDraft) -> Iterator[Finding]:
    """Yield effort and velocity limits of 0. Exporters write 0 for values that were not filled in."""
    for joint in draft.joints:
        limit = joint.motion.limit
        if limit is None or joint.type not in MOVING_TYPES:
            continue
        stated = {"an effort": limit.effort, "a velocity": limit.velocity}
        zeros = [f"{what} of {value + 0.0:g}" for what, value in stated.items() if value is not None and value <= 0]
        if zeros:
            message = (
                f"joint '{joint.name}' has {' and '.join(zeros)} in <limit>, so it could not move: it counts as no "
                "limit"
            )
            yield finding("zero-limit", message, limit.place)


def passive(draft: RobotDraft) -> Iterator[Finding]:
    """Yield ball, planar and floating joints with limits or friction, which are not simulated."""
    for joint in draft.joints:
        if joint.type not in {"planar", "floating", *BALLS} or is_free_base(draft, joint):
            continue
        limit = joint.motion.limit
        parts = {"<limit>": limit is not None and (limit.lower or limit.upper), "friction": joint.motion.friction}
        title = f"{'ball' if joint.type in BALLS else joint.type} joint '{joint.name}'"
        for part in (part for part, stated in parts.items() if stated):
            yield finding("passed-over", f"{title} moves freely: its {part} is not simulated", joint.place)


def is_free_base(draft: RobotDraft, joint: JointDraft) -> bool:
    """Return True if a floating joint connects an empty root link to the robot: it means that the base is free."""
    if joint.type != "floating":
        return False
    others = [other for other in draft.joints if other is not joint]
    is_bare = all(link.is_bare for link in draft.links if link.name == joint.parent)
    return is_bare and all(joint.parent not in (other.parent, other.child) for other in others)


def mimics(draft: RobotDraft) -> Iterator[Finding]:
    """Yield joints whose <mimic> cannot work."""
    joints = draft.joints_by_name
    for name, joint in joints.items():
        if (position := still_position(joint, joints)) is not None:
            message = f"joint '{name}' has a <mimic> that never moves it: it is fixed at {position:g}"
            yield finding("still-mimic", message, joint.place)
        elif (trouble := mimic_problem(joint, joints)) is not None:
            yield finding("bad-mimic", f"joint '{name}' mimics {trouble}", joint.place)


def mimic_limits(draft: RobotDraft) -> Iterator[Finding]:
    """Yield joints whose <mimic> takes them beyond their own limits."""
    joints = draft.joints_by_name
    for name, joint in joints.items():
        mimic = joint.mimic
        if mimic is None or mimic_problem(joint, joints) is not None:
            continue
        lower, upper = _range(joint)
        ends = sorted(mimic.multiplier * end + mimic.offset for end in _range(joints[mimic.joint]))
        slack = _ROUNDING * min(1.0, upper - lower)
        if lower <= upper and (ends[0] < lower - slack or ends[1] > upper + slack):
            message = (
                f"joint '{name}' mimics '{mimic.joint}', which moves it from {ends[0]:g} to {ends[1]:g}, but its own "
                f"limits are {lower:g} and {upper:g}: both stop there; widen the limits"
            )
            yield finding("follower-limits", message, joint.place)


def _range(joint: JointDraft) -> tuple[float, float]:
    lower, upper = joint.limits
    return -math.inf if lower is None else lower, math.inf if upper is None else upper


def still_position(joint: JointDraft, joints: Mapping[str, JointDraft]) -> float | None:
    """Return the position in rad (m) at which a <mimic> holds a joint for good; None if it may move it."""
    mimic = joint.mimic
    leader = None if mimic is None else joints.get(mimic.joint)
    if mimic is None or (leader is None and joint.type != "fixed"):
        return None
    if joint.type == "fixed":
        return 0.0
    is_still = leader is not None and leader.type == "fixed"
    return mimic.offset if joint.type in MOVING_TYPES and (is_still or mimic.multiplier == 0) else None


def mimic_problem(joint: JointDraft, joints: Mapping[str, JointDraft]) -> str | None:
    """Return the end of a message "joint 'a' mimics ..." if its <mimic> cannot work; None if it can, or if none."""
    if joint.mimic is None:
        return None
    leader = joint.mimic.joint
    if leader not in joints:
        return f"the unknown joint '{leader}'{did_you_mean(leader, joints)}"
    if joints[leader].type not in MOVING_TYPES or joint.type not in MOVING_TYPES:
        return f"'{leader}', but one of the two cannot move"
    if joint.mimic.multiplier == 0:
        return f"'{leader}' with a multiplier of 0, so it never moves: make it a fixed joint"
    followed = {joint.name}
    while leader not in followed:
        followed.add(leader)
        following = joints[leader].mimic if leader in joints else None
        if following is None:
            return None
        leader = following.joint
    return f"'{leader}', which mimics it in turn"


_JOINT_TYPES: Final = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar", "universal", *BALLS)


_MAX_HINTS: Final = 10  # each hint compares a name with all others

MAX_NAME_BYTES: Final = 255
"""The longest name, in bytes of UTF-8. PyBullet has a buffer of 1,024 bytes; a longer name ends the process."""

MAX_MOVING_JOINTS: Final = 128 - 7  # the largest number of joints that have a position
MAX_JOINTS: Final = 128 - 1  # the largest number of joints, fixed joints included: one link is the base
_BALL_NUMBERS: Final = 4  # the state of a ball joint is a quaternion
MOST_JOINTS: Final = 1000  # the largest number of joints in MuJoCo, which has no limit of its own
_MOVE: Final = "joints that move"
_ADVICE: Final = "merge links that are connected by fixed joints, or remove parts that the test does not need"


def names(draft: RobotDraft) -> Iterator[Finding]:
    """Yield names that occur twice or are too long."""
    named: dict[str, Sequence[LinkDraft | JointDraft]] = {"link": draft.links, "joint": draft.joints}
    for kind, parts in named.items():
        seen = set[str]()
        for part in parts:
            if (size := len(part.name.encode())) > MAX_NAME_BYTES:
                message = (
                    f"{kind} '{part.name[:40]}...': the name has {size} bytes; at most {MAX_NAME_BYTES} are allowed"
                )
                yield finding("bad-name", message, part.place)
            if part.name in seen:
                message = f"a second {kind} is named '{part.name}'; names must be unique"
                yield finding("duplicate-name", message, part.place)
            seen.add(part.name)
    yield from _part_names(draft)


def _part_names(draft: RobotDraft) -> Iterator[Finding]:
    """Yield joints with several motions whose parts would have the name of a joint or link."""
    taken = {link.name for link in draft.links} | draft.joints_by_name.keys()
    for joint in draft.joints:
        turns = [f"{joint.name}_{axis}" for axis in "xyz"] if joint.type in (*BALLS, "floating") else []
        for part in taken.intersection((*part_names(joint), *turns)):
            kind = "ball" if joint.type in BALLS else joint.type
            message = f"a motion of {kind} joint '{joint.name}' would be named '{part}', as another part"
            yield finding("duplicate-name", f"{message}; rename one of them", joint.place)


def joint_types(draft: RobotDraft) -> Iterator[Finding]:
    """Yield joints whose type URDF does not define."""
    hinted = FirstFew()
    for joint in draft.joints:
        if joint.type not in _JOINT_TYPES:
            near = nearest(joint.type, _JOINT_TYPES) if hinted.one_more() else None
            hint = f"; did you mean '{near}'?" if near else ""
            message = f"unknown joint type '{joint.type}'{hint} (allowed: {', '.join(_JOINT_TYPES)})"
            yield finding("joint-type", message, joint.place)


def tree(draft: RobotDraft) -> Iterator[Finding]:
    """Yield unknown links, links with two parents, missing or several roots, and loops."""
    links = {link.name for link in draft.links}
    children: dict[str, list[str]] = {}
    carriers: dict[str, str] = {}
    unknown = 0
    for joint in draft.joints:
        name, parent, child = joint.name, joint.parent, joint.child
        for link in sorted({parent, child} - links):
            hint = did_you_mean(link, links) if unknown < _MAX_HINTS else ""
            unknown += 1
            yield finding("unknown-link", f"joint '{name}' names the unknown link '{link}'{hint}", joint.place)
        if child in carriers:
            message = (
                f"link '{child}' is the child of two joints, '{carriers[child]}' and '{name}': only one is allowed"
            )
            yield finding("two-parents", message, joint.place)
        carriers[child] = name
        children.setdefault(parent, []).append(child)
    if not unknown:  # otherwise the links below an unknown link would be reported as a loop
        yield from _rooted(draft, sorted(links - carriers.keys()), links, children)


def _rooted(draft: RobotDraft, roots: list[str], links: set[str], children: dict[str, list[str]]) -> Iterator[Finding]:
    if len(roots) != 1:
        problem = (
            f"{len(roots)}: {', '.join(roots)}; connect them with fixed joints"
            if roots
            else "none: its joints form a loop"
        )
        yield finding("one-root", f"the model must have one root link, but it has {problem}", draft.place)
        return
    reached = set[str]()
    waiting = [roots[0]]
    while waiting:
        link = waiting.pop()
        if link not in reached:
            reached.add(link)
            waiting += children.get(link, [])
    if lost := sorted(links - reached):
        yield finding("loop", f"joints form a loop among the links {', '.join(lost)}", draft.place)


def joint_counts(draft: RobotDraft) -> Iterator[Finding]:
    """Yield a finding if the model has more joints than any engine simulates, or than PyBullet can hold."""
    # Each motion counts.
    joints = [joint for joint in draft.joints for _ in range(max(1, len(part_names(joint))))]
    moving = [joint for joint in joints if joint.type in {*MOVING_TYPES, *SERIES}]
    balls = [joint for joint in draft.joints if joint.type in {*BALLS, "floating"}]
    if len(joints) > MOST_JOINTS:
        message = f"{len(joints)} joints; at most {MOST_JOINTS} are supported: {_ADVICE}"
        yield finding("too-many-joints", message, joints[MOST_JOINTS].place)
        return
    yield from _beyond(joints, MAX_JOINTS, "joints")
    yield from _beyond([*moving, *balls * _BALL_NUMBERS], MAX_MOVING_JOINTS, _MOVE)


def _beyond(joints: Sequence[JointDraft], most: int, what: str) -> Iterator[Finding]:
    if len(joints) > most:
        yield finding("many-joints", _too_many(len(joints), most, what), joints[most].place)


def beyond_pybullet(model: RobotModel) -> str | None:
    """Return a message if a model has more joints than PyBullet can hold, else None."""
    motors, balls = len(model.motor_joints), len(model.balls)
    joints = balls + sum(not joint.ball for joint in model.joints)
    if joints > MAX_JOINTS:
        return f"the robot has {_too_many(joints, MAX_JOINTS, 'joints')}"
    moving = motors + _BALL_NUMBERS * balls
    return f"the robot has {_too_many(moving, MAX_MOVING_JOINTS, _MOVE)}" if moving > MAX_MOVING_JOINTS else None


def _too_many(count: int, most: int, what: str) -> str:
    return f"{count} {what}, but PyBullet supports at most {most}: set backend: mujoco, or {_ADVICE}"

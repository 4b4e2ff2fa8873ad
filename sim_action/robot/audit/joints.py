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
from xml.etree.ElementTree import Element

from sim_action.core.geometry import ZERO
from sim_action.core.wording import FirstFew, did_you_mean, nearest
from sim_action.robot.documents.extensions import SERIES, part_names
from sim_action.robot.documents.urdf_elements import (
    BALLS,
    MAX_PART_SIZE_M,
    UNLIMITED,
    child_of,
    number,
    parent_of,
    vector,
)
from sim_action.robot.documents.urdf_elements import limits as limits_of
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.findings import Finding
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


def axes(document: ModelDocument) -> Iterator[Finding]:
    """Yield moving joints with an axis of length 0. Exporters write 0 0 0 for joints that do not move."""
    for joint in document.elements("joint"):
        if joint.attrib["type"] in {"fixed", "floating", *BALLS}:
            continue
        for axis in (*joint.findall("axis"), *joint.findall("axis2")):
            if vector(axis, "xyz", (1.0, 0.0, 0.0)) == ZERO:
                message = f"joint '{joint.attrib['name']}' has an axis of length 0"
                yield document.finding("zero-axis", axis, message)


def limits(document: ModelDocument) -> Iterator[Finding]:
    """Yield joints with missing, reversed or equal limits, and continuous joints with limits, which do not count."""
    for joint in document.elements("joint"):
        kind, name, limit = joint.attrib["type"], joint.attrib["name"], joint.find("limit")
        lower, upper = number(limit, "lower"), number(limit, "upper")
        if kind == "continuous" and limit is not None and -UNLIMITED < (lower or 0.0) < (upper or 0.0) < UNLIMITED:
            message = (
                f"continuous joint '{name}' has limits of {lower or 0:g} and {upper or 0:g}, which do not count: it "
                "turns without limits; make it 'revolute' if they should"
            )
            yield document.finding("continuous-limits", limit, message)
        if kind not in LIMITED:
            continue
        if limit is None and kind == "revolute":
            message = (
                f"revolute joint '{name}' has no <limit>: it turns without limits; make it 'continuous' if it should"
            )
            yield document.finding("unlimited-joint", joint, message)
        elif limit is None or (lower is None and upper is None):
            other = ", or make it 'continuous' if it turns without end" if kind == "revolute" else ""
            message = (
                f"{kind} joint '{name}' has no limits, so it could not move: add <limit lower= upper= .../>{other}"
            )
            yield document.finding("missing-limits", joint if limit is None else limit, message)
        elif (lower or 0.0) > (upper or 0.0):
            message = f"joint '{name}' has a lower limit of {lower or 0:g} above its upper limit of {upper or 0:g}"
            yield document.finding("reversed-limits", limit, message)
        elif (lower or 0.0) == (upper or 0.0):
            other = "make it 'continuous' if it is a wheel, " if kind == "revolute" else ""
            message = f"joint '{name}' cannot move: both limits are {lower or 0:g}; {other}make it 'fixed' if not"
            yield document.finding("locked-joint", limit, message)


def limit_units(document: ModelDocument) -> Iterator[Finding]:
    """Yield position limits that are probably in degrees or millimetres."""
    for joint in document.elements("joint"):
        limit, kind = joint.find("limit"), joint.attrib["type"]
        if limit is None or kind not in _ODD_LIMITS:
            continue
        (least, most), unit = _ODD_LIMITS[kind]
        farthest = max(abs(number(limit, name) or 0.0) for name in ("lower", "upper"))
        if least < farthest <= most:
            message = f"{kind} joint '{joint.attrib['name']}' has a limit of {farthest:g} {unit}?"
            yield document.finding("odd-limits", limit, message)


def motors(document: ModelDocument) -> Iterator[Finding]:
    """Yield effort and velocity limits of 0. Exporters write 0 for values that were not filled in."""
    for joint in document.elements("joint"):
        limit = joint.find("limit")
        stated = {what: number(limit, what) for what in ("effort", "velocity")}
        zeros = {what: value for what, value in stated.items() if value is not None and value <= 0}
        if limit is not None and zeros and joint.attrib["type"] in MOVING_TYPES:
            zero_limits = " and ".join(
                f"{'an' if what == 'effort' else 'a'} {what} of {value + 0.0:g}" for what, value in zeros.items()
            )
            name = joint.attrib["name"]
            message = f"joint '{name}' has {zero_limits} in <limit>, so it could not move: it counts as no limit"
            yield document.finding("zero-limit", limit, message)


def passive(document: ModelDocument) -> Iterator[Finding]:
    """Yield ball, planar and floating joints with limits or friction, which are not simulated."""
    for joint in document.elements("joint"):
        kind = joint.attrib["type"]
        if kind not in {"planar", "floating", *BALLS} or is_free_base(document, joint):
            continue
        parts = {("limit", "lower"): "<limit>", ("limit", "upper"): "<limit>", ("dynamics", "friction"): "friction"}
        for what in dict.fromkeys(what for (tag, name), what in parts.items() if number(joint.find(tag), name)):
            title = f"{'ball' if kind in BALLS else kind} joint '{joint.attrib['name']}'"
            message = f"{title} moves freely: its {what} is not simulated"
            yield document.finding("passed-over", joint, message)


def is_free_base(document: ModelDocument, joint: Element) -> bool:
    """Return True if a floating joint connects an empty root link to the robot: it means that the base is free."""
    if joint.attrib["type"] != "floating":
        return False
    root = parent_of(joint)
    joints = list(document.elements("joint"))
    beside = any(parent_of(other) == root for other in joints if other is not joint)
    empty = all(link.find("*") is None for link in document.elements("link") if link.attrib["name"] == root)
    return empty and not beside and root not in map(child_of, joints)


def mimics(document: ModelDocument) -> Iterator[Finding]:
    """Yield joints whose <mimic> cannot work."""
    joints = {joint.attrib["name"]: joint for joint in document.elements("joint")}
    for joint in joints.values():
        if (position := still_position(joint, joints)) is not None:
            message = f"joint '{joint.attrib['name']}' has a <mimic> that never moves it: it is fixed at {position:g}"
            yield document.finding("still-mimic", joint, message)
        elif (trouble := mimic_problem(joint, joints)) is not None:
            yield document.finding("bad-mimic", joint, f"joint '{joint.attrib['name']}' mimics {trouble}")


def mimic_limits(document: ModelDocument) -> Iterator[Finding]:
    """Yield joints whose <mimic> takes them beyond their own limits."""
    joints = {joint.attrib["name"]: joint for joint in document.elements("joint")}
    for name, joint in joints.items():
        mimic = joint.find("mimic")
        if mimic is None or mimic_problem(joint, joints) is not None:
            continue
        lower, upper = _range(joint)
        low, high = _taken(mimic, joints[mimic.attrib["joint"]])
        slack = _ROUNDING * min(1.0, upper - lower)
        if lower <= upper and (low < lower - slack or high > upper + slack):
            leader = mimic.attrib["joint"]
            message = (
                f"joint '{name}' mimics '{leader}', which moves it from {low:g} to {high:g}, but its own limits are "
                f"{lower:g} and {upper:g}: both stop there; widen the limits"
            )
            yield document.finding("follower-limits", joint, message)


def _taken(mimic: Element, leader: Element) -> tuple[float, float]:
    multiplier, offset = number(mimic, "multiplier"), number(mimic, "offset") or 0.0
    ends = [end * (1.0 if multiplier is None else multiplier) + offset for end in _range(leader)]
    return min(ends), max(ends)


def _range(joint: Element) -> tuple[float, float]:
    lower, upper = limits_of(joint)
    return -math.inf if lower is None else lower, math.inf if upper is None else upper


def still_position(joint: Element, joints: Mapping[str, Element]) -> float | None:
    """Return the position in rad (m) at which a <mimic> holds a joint for good; None if it may move it."""
    mimic = joint.find("mimic")
    leader = None if mimic is None else joints.get(mimic.attrib["joint"])
    if mimic is None or (leader is None and joint.attrib["type"] != "fixed"):
        return None
    if joint.attrib["type"] == "fixed":
        return 0.0
    is_still = leader is not None and leader.attrib["type"] == "fixed"
    if joint.attrib["type"] in MOVING_TYPES and (is_still or number(mimic, "multiplier") == 0):
        return number(mimic, "offset") or 0.0
    return None


def mimic_problem(joint: Element, joints: Mapping[str, Element]) -> str | None:
    """Return the end of a message "joint 'a' mimics ..." if its <mimic> cannot work; None if it can, or if none."""
    mimic = joint.find("mimic")
    if mimic is None:
        return None
    leader = mimic.attrib["joint"]
    if leader not in joints:
        return f"the unknown joint '{leader}'{did_you_mean(leader, joints)}"
    if joints[leader].attrib["type"] not in MOVING_TYPES or joint.attrib["type"] not in MOVING_TYPES:
        return f"'{leader}', but one of the two cannot move"
    if number(mimic, "multiplier") == 0:
        return f"'{leader}' with a multiplier of 0, so it never moves: make it a fixed joint"
    followed = {joint.attrib["name"]}
    while leader not in followed:
        followed.add(leader)
        following = joints[leader].find("mimic") if leader in joints else None
        if following is None:
            return None
        leader = following.attrib["joint"]
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


def names(document: ModelDocument) -> Iterator[Finding]:
    """Yield names that occur twice or are too long."""
    for tag in ("link", "joint"):
        seen = set[str]()
        for element in document.elements(tag):
            name = element.attrib["name"]
            if (size := len(name.encode())) > MAX_NAME_BYTES:
                message = f"{tag} '{name[:40]}...': the name has {size} bytes; at most {MAX_NAME_BYTES} are allowed"
                yield document.finding("bad-name", element, message)
            if name in seen:
                yield document.finding(
                    "duplicate-name", element, f"a second {tag} is named '{name}'; names must be unique"
                )
            seen.add(name)
    yield from _part_names(document)


def _part_names(document: ModelDocument) -> Iterator[Finding]:
    """Yield joints with several motions whose parts would have the name of a joint or link."""
    taken = {element.attrib["name"] for element in document.elements("link", "joint")}
    for joint in document.elements("joint"):
        name, kind = joint.attrib["name"], joint.attrib["type"]
        turns = [f"{name}_{axis}" for axis in "xyz"] if kind in (*BALLS, "floating") else []
        for part in taken.intersection((*part_names(joint), *turns)):
            kind = "ball" if kind in BALLS else kind
            message = f"a motion of {kind} joint '{name}' would be named '{part}', as another part"
            yield document.finding("duplicate-name", joint, f"{message}; rename one of them")


def joint_types(document: ModelDocument) -> Iterator[Finding]:
    """Yield joints whose type URDF does not define."""
    hinted = FirstFew()
    for joint in document.elements("joint"):
        if (kind := joint.attrib["type"]) not in _JOINT_TYPES:
            near = nearest(kind, _JOINT_TYPES) if hinted.one_more() else None
            hint = f"; did you mean '{near}'?" if near else ""
            message = f"unknown joint type '{kind}'{hint} (allowed: {', '.join(_JOINT_TYPES)})"
            yield document.finding("joint-type", joint, message)


def tree(document: ModelDocument) -> Iterator[Finding]:
    """Yield unknown links, links with two parents, missing or several roots, and loops."""
    links = {link.attrib["name"] for link in document.elements("link")}
    children: dict[str, list[str]] = {}
    carriers: dict[str, str] = {}
    unknown = 0
    for joint in document.elements("joint"):
        name, parent, child = joint.attrib["name"], parent_of(joint), child_of(joint)
        for link in sorted({parent, child} - links):
            hint = did_you_mean(link, links) if unknown < _MAX_HINTS else ""
            unknown += 1
            yield document.finding("unknown-link", joint, f"joint '{name}' names the unknown link '{link}'{hint}")
        if child in carriers:
            message = (
                f"link '{child}' is the child of two joints, '{carriers[child]}' and '{name}': only one is allowed"
            )
            yield document.finding("two-parents", joint, message)
        carriers[child] = name
        children.setdefault(parent, []).append(child)
    if not unknown:  # otherwise the links below an unknown link would be reported as a loop
        yield from _rooted(document, sorted(links - carriers.keys()), links, children)


def _rooted(
    document: ModelDocument, roots: list[str], links: set[str], children: dict[str, list[str]]
) -> Iterator[Finding]:
    if len(roots) != 1:
        problem = (
            f"{len(roots)}: {', '.join(roots)}; connect them with fixed joints"
            if roots
            else "none: its joints form a loop"
        )
        yield document.finding("one-root", document.root, f"the model must have one root link, but it has {problem}")
        return
    reached = set[str]()
    waiting = [roots[0]]
    while waiting:
        link = waiting.pop()
        if link not in reached:
            reached.add(link)
            waiting += children.get(link, [])
    if lost := sorted(links - reached):
        yield document.finding("loop", document.root, f"joints form a loop among the links {', '.join(lost)}")


def joint_counts(document: ModelDocument) -> Iterator[Finding]:
    """Yield a finding if the model has more joints than any engine simulates, or than PyBullet can hold."""
    # Each motion counts.
    joints = [joint for joint in document.elements("joint") for _ in range(max(1, len(part_names(joint))))]
    moving = [joint for joint in joints if joint.get("type") in {*MOVING_TYPES, *SERIES}]
    balls = [joint for joint in document.elements("joint") if joint.get("type") in {*BALLS, "floating"}]
    if len(joints) > MOST_JOINTS:
        message = f"{len(joints)} joints; at most {MOST_JOINTS} are supported: {_ADVICE}"
        yield document.finding("too-many-joints", joints[MOST_JOINTS], message)
        return
    yield from _beyond(document, joints, MAX_JOINTS, "joints")
    yield from _beyond(document, [*moving, *balls * _BALL_NUMBERS], MAX_MOVING_JOINTS, _MOVE)


def _beyond(document: ModelDocument, joints: Sequence[Element], most: int, what: str) -> Iterator[Finding]:
    if len(joints) > most:
        yield document.finding("many-joints", joints[most], _too_many(len(joints), most, what))


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

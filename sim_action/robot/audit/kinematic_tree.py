"""Check that links and joints form a tree that the engine can hold: one root, unique names, one parent per link.

PyBullet crashes on other models. It reports a state of MAX_DEGREE_OF_FREEDOM = 128 numbers per body, and holds
MAX_NUM_LINKS = 128 links (both in Bullet's examples/SharedMemory/SharedMemoryCommands.h; bulletphysics/bullet3 issue
4621 asks for more). 7 of those numbers are the pose of the base, also of a fixed base. Beyond that, PyBullet 3.2.7
gives wrong values without a warning: a joint reads 0, and its position appears as a velocity of the base. From the
129th link on, it answers nothing. tests/integration/test_engine_tables.py measures both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.wording import FirstFew, did_you_mean, nearest
from sim_action.robot.documents.series_joints import SERIES, part_names
from sim_action.robot.documents.urdf_elements import BALLS, child_of, parent_of
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.findings import Finding
from sim_action.robot.model.robot_model import MOVING_TYPES, RobotModel

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
        found = (
            f"{len(roots)}: {', '.join(roots)}; connect them with fixed joints"
            if roots
            else "none: its joints form a loop"
        )
        yield document.finding("one-root", document.root, f"the model must have one root link, but it has {found}")
        return
    if lost := sorted(links - _reached(roots[0], children)):
        yield document.finding("loop", document.root, f"joints form a loop among the links {', '.join(lost)}")


def _reached(root: str, children: dict[str, list[str]]) -> set[str]:
    reached, waiting = set[str](), [root]
    while waiting:
        link = waiting.pop()
        if link not in reached:
            reached.add(link)
            waiting += children.get(link, [])
    return reached


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

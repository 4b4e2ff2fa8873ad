"""Links and joints form a tree: one root, no name twice, no two parents. An engine dies of anything else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.messages import did_you_mean
from sim_action.robot.robot_model import MOVING_TYPES, Finding
from sim_action.robot.urdf_elements import child_of, parent_of
from sim_action.robot.xml_document import ModelDocument

_JOINT_TYPES: Final = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


# Each compares a name with all others.
_MOST_HINTS: Final = 10

LONGEST_NAME: Final = 255
"""In bytes of UTF-8. PyBullet writes a name into 1,024 bytes, and what is longer ends the process."""


def names(document: ModelDocument) -> Iterator[Finding]:
    """No name is there twice, and none is longer than any name is."""
    for tag in ("link", "joint"):
        seen = set[str]()
        for element in document.elements(tag):
            name = element.attrib["name"]
            if (size := len(name.encode())) > LONGEST_NAME:
                message = f"{tag} '{name[:40]}...': a name of {size} bytes; the engine takes {LONGEST_NAME}"
                yield document.finding("bad-name", element, message)
            if name in seen:
                yield document.finding("duplicate-name", element, f"a second {tag} named '{name}'")
            seen.add(name)


def joint_types(document: ModelDocument) -> Iterator[Finding]:
    """Each is one of URDF's."""
    for joint in document.elements("joint"):
        if joint.attrib["type"] not in _JOINT_TYPES:
            message = f"joint type '{joint.attrib['type']}' is none of {', '.join(_JOINT_TYPES)}"
            yield document.finding("joint-type", joint, message)


def tree(document: ModelDocument) -> Iterator[Finding]:
    """Every link can be reached from one root, in one way."""
    links = {link.attrib["name"] for link in document.elements("link")}
    children: dict[str, list[str]] = {}
    carriers: dict[str, str] = {}
    unknown = 0
    for joint in document.elements("joint"):
        name, parent, child = joint.attrib["name"], parent_of(joint), child_of(joint)
        for link in sorted({parent, child} - links):
            hint = did_you_mean(link, links) if unknown < _MOST_HINTS else ""
            unknown += 1
            yield document.finding("unknown-link", joint, f"joint '{name}' names the unknown link '{link}'{hint}")
        if child in carriers:
            message = f"link '{child}' is the child of two joints, '{carriers[child]}' and '{name}': it can hang on one"
            yield document.finding("two-parents", joint, message)
        carriers[child] = name
        children.setdefault(parent, []).append(child)
    if not unknown:  # else what hangs on it would seem lost, and is not
        yield from _rooted(document, sorted(links - carriers.keys()), links, children)


def _rooted(
    document: ModelDocument, roots: list[str], links: set[str], children: dict[str, list[str]]
) -> Iterator[Finding]:
    if len(roots) != 1:
        found = (
            f"{len(roots)}: {', '.join(roots)}; join them by fixed joints" if roots else "none: its joints form a loop"
        )
        yield document.finding("one-root", document.root, f"a model has one root link, this one has {found}")
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


MOST_MOVING_JOINTS: Final = 128 - 7
"""Of joints that have a position."""

MOST_JOINTS: Final = 128 - 1
"""Of all joints, those that are fixed too: one link is the base."""

_ADVICE: Final = "make one link of those that fixed joints hold together, and leave out what need not move"


def joint_counts(document: ModelDocument) -> Iterator[Finding]:
    """The engine has room for all joints."""
    joints = list(document.elements("joint"))
    moving = [joint for joint in joints if joint.get("type") in MOVING_TYPES]
    yield from _beyond(document, joints, MOST_JOINTS, "joints")
    yield from _beyond(document, moving, MOST_MOVING_JOINTS, "joints that move")


def _beyond(document: ModelDocument, joints: Sequence[Element], most: int, what: str) -> Iterator[Finding]:
    if len(joints) > most:
        message = f"{len(joints)} {what}, and the engine takes {most}: {_ADVICE}"
        yield document.finding("too-many-joints", joints[most], message)

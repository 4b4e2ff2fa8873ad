"""Joints that an engine would take for others than they are meant to be."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.geometry import ZERO
from sim_action.core.messages import did_you_mean
from sim_action.robot.audit.shapes import LARGEST
from sim_action.robot.robot_model import MOVING_TYPES, Finding
from sim_action.robot.urdf_elements import child_of, number, parent_of, vector
from sim_action.robot.urdf_elements import limits as limits_of
from sim_action.robot.xml_document import ModelDocument

UNSUPPORTED: Final = ("floating", "planar")
"""Types of URDF that no engine here has inside a robot."""

LIMITED: Final = ("revolute", "prismatic")
"""Types that say how far they go."""

# Exporters round: what is off by less, of a range or in rad, or m, is not told.
_ROUNDING: Final = 1e-3


_ODD_LIMITS: Final = {
    "revolute": ((20.0, 720.0), "rad, and a whole turn is 6.28 rad: is this in degrees"),
    "prismatic": ((LARGEST, 10_000.0), "m: is this in millimetres"),
}
"""Kind -> limits that no robot has in rad or m, and what to say; what is beyond stands for none."""


def axes(document: ModelDocument) -> Iterator[Finding]:
    """What turns or slides has a direction to do so; exporters write 0 0 0 for joints that do not move."""
    for joint in document.elements("joint"):
        axis = joint.find("axis")
        if joint.attrib["type"] in {"fixed", "floating"} or axis is None:
            continue
        if vector(axis, "xyz", (1.0, 0.0, 0.0)) == ZERO:
            message = f"joint '{joint.attrib['name']}' turns about an axis of length 0"
            yield document.finding("zero-axis", axis, message)


def limits(document: ModelDocument) -> Iterator[Finding]:
    """A joint that is not continuous says how far it goes (URDF requires <limit> of both kinds)."""
    for joint in document.elements("joint"):
        kind, name, limit = joint.attrib["type"], joint.attrib["name"], joint.find("limit")
        if kind not in LIMITED:
            continue
        lower, upper = number(limit, "lower"), number(limit, "upper")
        if limit is None or (lower is None and upper is None):
            other = "; a joint that turns for ever is 'continuous'" if kind == "revolute" else ""
            message = f"{kind} joint '{name}' has no limits, and could not move: add <limit lower= upper= .../>{other}"
            yield document.finding("missing-limits", joint if limit is None else limit, message)
        elif (lower or 0.0) > (upper or 0.0):
            message = f"joint '{name}' has a lower limit of {lower or 0:g} above its upper limit of {upper or 0:g}"
            yield document.finding("reversed-limits", limit, message)
        elif (lower or 0.0) == (upper or 0.0):
            other = "what turns for ever, as a wheel does, is 'continuous'; " if kind == "revolute" else ""
            message = f"joint '{name}' cannot move, its limits are both {lower or 0:g}: {other}what is held is 'fixed'"
            yield document.finding("locked-joint", limit, message)


def limit_units(document: ModelDocument) -> Iterator[Finding]:
    """Joints turn a few times, and slide as far as a house is long."""
    for joint in document.elements("joint"):
        limit, kind = joint.find("limit"), joint.attrib["type"]
        if limit is None or kind not in _ODD_LIMITS:
            continue
        (least, most), unit = _ODD_LIMITS[kind]
        farthest = max(abs(number(limit, name) or 0.0) for name in ("lower", "upper"))
        if least < farthest <= most:
            message = f"{kind} joint '{joint.attrib['name']}' goes as far as {farthest:g} {unit}?"
            yield document.finding("odd-limits", limit, message)


def motors(document: ModelDocument) -> Iterator[Finding]:
    """Motors can do something; exporters write 0 for what nobody has filled in."""
    for joint in document.elements("joint"):
        limit = joint.find("limit")
        zeros = [what for what in ("effort", "velocity") if number(limit, what) == 0]
        if limit is not None and zeros and joint.attrib["type"] in MOVING_TYPES:
            found = " and ".join(f"{'an' if what == 'effort' else 'a'} {what} of 0" for what in zeros)
            message = f"joint '{joint.attrib['name']}' has {found}, and could not move: as if left out, it is no limit"
            yield document.finding("zero-limit", limit, message)


def kinds(document: ModelDocument) -> Iterator[Finding]:
    """Every joint is one that engines have."""
    for joint in document.elements("joint"):
        kind = joint.attrib["type"]
        if kind in UNSUPPORTED and not is_free_base(document, joint):
            message = (
                f"{kind} joint '{joint.attrib['name']}': it has more than one motion; use revolute or prismatic ones"
            )
            yield document.finding("unsupported-joint", joint, message)


def is_free_base(document: ModelDocument, joint: Element) -> bool:
    """Whether a joint only says that the robot moves freely: it floats, from an empty root without another joint."""
    if joint.attrib["type"] != "floating":
        return False
    root = parent_of(joint)
    joints = list(document.elements("joint"))
    beside = any(parent_of(other) == root for other in joints if other is not joint)
    empty = all(link.find("*") is None for link in document.elements("link") if link.attrib["name"] == root)
    return empty and not beside and root not in map(child_of, joints)


def mimics(document: ModelDocument) -> Iterator[Finding]:
    """Every follower has a leader that moves, and no two follow each other."""
    joints = {joint.attrib["name"]: joint for joint in document.elements("joint")}
    for joint in joints.values():
        if (trouble := trouble_of_mimic(joint, joints)) is not None:
            yield document.finding("bad-mimic", joint, f"joint '{joint.attrib['name']}' mimics {trouble}")


def mimic_limits(document: ModelDocument) -> Iterator[Finding]:
    """No follower is taken beyond its own limits: which of the two then gives way, nobody has said."""
    joints = {joint.attrib["name"]: joint for joint in document.elements("joint")}
    for name, joint in joints.items():
        mimic = joint.find("mimic")
        if mimic is None or trouble_of_mimic(joint, joints) is not None:
            continue
        (lower, upper), (low, high) = _range(joint), _taken(mimic, joints[mimic.attrib["joint"]])
        slack = _ROUNDING * min(1.0, upper - lower)
        if lower <= upper and (low < lower - slack or high > upper + slack):
            leader = mimic.attrib["joint"]
            message = (
                f"joint '{name}' mimics '{leader}', which takes it from {low:g} to {high:g}, and has limits of "
                f"{lower:g} and {upper:g}: which of the two gives way depends on their motors and masses"
            )
            yield document.finding("follower-limits", joint, message)


def _taken(mimic: Element, leader: Element) -> tuple[float, float]:
    """From where to where a leader's limits take its follower."""
    multiplier, offset = number(mimic, "multiplier"), number(mimic, "offset") or 0.0
    ends = [end * (1.0 if multiplier is None else multiplier) + offset for end in _range(leader)]
    return min(ends), max(ends)


def _range(joint: Element) -> tuple[float, float]:
    lower, upper = limits_of(joint)
    return -math.inf if lower is None else lower, math.inf if upper is None else upper


def trouble_of_mimic(joint: Element, joints: Mapping[str, Element]) -> str | None:
    """What is wrong with whom a joint follows."""
    mimic = joint.find("mimic")
    if mimic is None:
        return None
    leader = mimic.attrib["joint"]
    if leader not in joints:
        return f"the unknown joint '{leader}'{did_you_mean(leader, joints)}"
    if joints[leader].attrib["type"] not in MOVING_TYPES or joint.attrib["type"] not in MOVING_TYPES:
        return f"'{leader}', and one of them does not move"
    if number(mimic, "multiplier") == 0:
        return f"'{leader}' times 0: it stands still, and is a fixed joint"
    followed = {joint.attrib["name"]}
    while leader not in followed:
        followed.add(leader)
        following = joints[leader].find("mimic") if leader in joints else None
        if following is None:
            return None
        leader = following.attrib["joint"]
    return f"'{leader}', which follows it in turn"

"""Joints that an engine would take for others than they are meant to be."""

from __future__ import annotations

from collections.abc import Iterator

from sim_action.geometry import ZERO
from sim_action.models.document import ModelDocument
from sim_action.models.values import number, vector
from sim_action.robot_model import Finding


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
        if kind not in {"revolute", "prismatic"}:
            continue
        lower, upper = number(limit, "lower"), number(limit, "upper")
        if limit is None or (lower is None and upper is None):
            other = "; a joint that turns for ever is 'continuous'" if kind == "revolute" else ""
            message = f"{kind} joint '{name}' has no limits, and could not move: add <limit lower= upper= .../>{other}"
            yield document.finding("missing-limits", joint if limit is None else limit, message)
        elif (lower or 0.0) > (upper or 0.0):
            message = f"joint '{name}' has a lower limit of {lower or 0:g} above its upper limit of {upper or 0:g}"
            yield document.finding("reversed-limits", limit, message)

"""State extensions of URDF in its own words before the audit, so that the reader and each engine see them.

- URDF 1.1: `quat_xyzw` of an <origin> (urdfdom).
- ros2_control: the parameters `mimic`, `multiplier` and `offset` of a joint, and its start position in `initial_value`
  or, in old descriptions, `initial_position` (control.ros.org, "gz_ros2_control" and "Mock Components").
- Drake: the friction in <drake:proximity_properties> (drake.mit.edu, "Parsing").
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.errors import Location
from sim_action.core.records import replace
from sim_action.robot.documents.urdf_elements import is_numbers
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.draft import SERIES
from sim_action.robot.model.findings import Finding

_DRAKE: Final = "drake:"
_DRAKE_FRICTION: Final = ("mu_dynamic", "mu_static")
_MAX_SHOWN: Final = 40


def with_extensions(document: ModelDocument) -> ModelDocument:
    """Return the document with its extensions in the words of URDF, and findings about them."""
    added: dict[Element, Location] = {}
    findings = [*_quaternions(document), *_control_mimics(document, added), *_drake(document, added)]
    findings += _start_notes(document)
    return replace(document, places={**document.places, **added}, findings=(*document.findings, *findings))


def start_positions(document: ModelDocument) -> dict[str, float]:
    """Return joint -> the position in rad (m) at which <ros2_control> starts it."""
    return {joint: float(text) for joint, text, _ in _starts(document) if is_numbers(text, 1)}


def _start_notes(document: ModelDocument) -> Iterator[Finding]:
    """Yield one note on the joints with a start position, and one for each that is not a number."""
    stated = []
    for joint, text, param in _starts(document):
        if is_numbers(text, 1):
            stated.append((f"'{joint}' at {text}", param))
            continue
        message = f"the start position of joint '{joint}' is {text[:_MAX_SHOWN]!r}, which is not a number"
        yield document.finding("passed-over", param, message)
    if stated:
        names = ", ".join(name for name, _ in stated)
        message = f"<ros2_control> starts joints away from 0 (rad, m): {names}; 'robot.joints' overrides it"
        yield document.finding("start-position", stated[0][1], message)


def _starts(document: ModelDocument) -> Iterator[tuple[str, str, Element]]:
    """Yield joint, text and parameter of each start position."""
    joints = [*document.elements("joint")]
    moving = {joint.get("name", "") for joint in joints}
    moving.update(f"{joint.get('name')}_{end}" for joint in joints for end in SERIES.get(joint.get("type", ""), ()))
    for joint in document.elements("ros2_control/joint"):
        params = [*joint.findall("state_interface[@name='position']/param[@name='initial_value']")]
        params += joint.findall("param[@name='initial_position']")
        text = (params[0].text or "").strip() if params else ""
        if text and joint.get("name") in moving and not (is_numbers(text, 1) and not float(text)):
            yield joint.get("name", ""), text, params[0]


def _quaternions(document: ModelDocument) -> Iterator[Finding]:
    for origin in document.root.iter("origin"):
        text = origin.attrib.pop("quat_xyzw", None)
        if text is None:
            continue
        x, y, z, w = map(float, text.split()) if is_numbers(text, 4) else (0.0,) * 4
        length = math.hypot(x, y, z, w)
        if not length:
            message = f'<origin quat_xyzw="{text[:_MAX_SHOWN]}">: expected four numbers that are not all 0'
            yield document.finding("bad-number", origin, message)
        elif "rpy" in origin.attrib:
            yield document.finding("bad-number", origin, "<origin> has both rpy and quat_xyzw: remove one of them")
        else:
            rpy = geometry.rpy_from_quaternion((x / length, y / length, z / length, w / length))
            origin.set("rpy", " ".join(map(repr, rpy)))


def _control_mimics(document: ModelDocument, added: dict[Element, Location]) -> Iterator[Finding]:
    joints = {joint.get("name"): joint for joint in document.elements("joint")}
    for control in document.elements("ros2_control/joint"):
        stated = {param.get("name", ""): param for param in control.findall("param")}
        joint = joints.get(control.get("name"))
        leader = stated.get("mimic")
        if leader is None or joint is None or joint.find("mimic") is not None:
            continue
        mimic = ET.SubElement(joint, "mimic", joint=(leader.text or "").strip())
        mimic.attrib.update({key: (stated[key].text or "") for key in ("multiplier", "offset") if key in stated})
        added[mimic] = document.places[leader]
        message = f"joint '{joint.get('name')}' mimics '{mimic.get('joint')}', as <ros2_control> states"
        yield document.finding("control-mimic", leader, message)


def _drake(document: ModelDocument, added: dict[Element, Location]) -> Iterator[Finding]:
    for link in document.elements("link"):
        stated = [mu for collision in link.findall("collision") if (mu := _drake_friction(collision)) is not None]
        if not stated or link.find("contact/lateral_friction") is not None:
            continue
        values = {mu.get("value", "") for mu in stated}
        contact = link.find("contact")
        contact = ET.SubElement(link, "contact") if contact is None else contact
        least = min(values, key=lambda text: float(text) if is_numbers(text, 1) else -1.0)
        friction = ET.SubElement(contact, "lateral_friction", value=least)
        added |= {contact: document.places[stated[0]], friction: document.places[stated[0]]}
        if len(values) > 1:
            message = f"the shapes of link '{link.get('name')}' have different frictions: {least} is used for all"
            yield document.finding("shared-friction", stated[0], message)


def _drake_friction(collision: Element) -> Element | None:
    properties = {child.tag: child for child in collision}.get(f"{_DRAKE}proximity_properties", ())
    stated = {part.tag.removeprefix(_DRAKE): part for part in properties}
    return next((stated[name] for name in _DRAKE_FRICTION if name in stated), None)
